// Stage: bindings. Methods of Scene that have files of their own: bind_queries.cpp, bind_gpu.cpp.
#pragma once

#include "bind.h"
#include "limitray/scene.h"

namespace limitray::bindings {

void bind_queries(nb::class_<Scene>& scene);
void bind_gpu(nb::class_<Scene>& scene);

}  // namespace limitray::bindings
