// Stage: bindings. The extension module limitray._core; the public Python names are in
// python/limitray.
#include "bind.h"

NB_MODULE(_core, module) {
  nanobind::set_leak_warnings(false);  // caches of a user's program may outlive the interpreter
  module.doc() = "Private C++ core of limitray; use the package limitray.";
  limitray::bindings::bind_cage(module);
  limitray::bindings::bind_limit(module);
  limitray::bindings::bind_scene(module);
  limitray::bindings::bind_texture(module);
}
