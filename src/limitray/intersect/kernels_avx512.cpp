#include "limitray/intersect/kernels_impl.h"

namespace limitray {

const Kernels& kernels_avx512() {
  static const Kernels k = make_kernels("avx512");
  return k;
}

}  // namespace limitray
