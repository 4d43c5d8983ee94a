#include "limitray/intersect/kernels_impl.h"

namespace limitray {

const Kernels& kernels_portable() {
  static const Kernels k = make_kernels("portable");
  return k;
}

}  // namespace limitray
