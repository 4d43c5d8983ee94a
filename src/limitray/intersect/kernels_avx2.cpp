#include "limitray/intersect/kernels_impl.h"

namespace limitray {

const Kernels& kernels_avx2() {
  static const Kernels k = make_kernels("avx2");
  return k;
}

}  // namespace limitray
