// Stage: bindings. Queries of Scene, in a file of their own.
#pragma once

#include "bind.h"
#include "limitray/scene.h"

namespace limitray::bindings {

void bind_queries(nb::class_<Scene>& scene);

}  // namespace limitray::bindings
