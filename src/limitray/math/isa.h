// Stage: mathematics. The instruction set this file is compiled for, as an inline namespace, so
// that the same templates compiled three times (intersect/kernels_*.cpp) never mix at link time.
#pragma once

#if defined(__AVX512F__) && defined(__AVX512VL__) && defined(__AVX512DQ__)
#define LIMITRAY_AVX512 1
#define LIMITRAY_AVX2 1
#define LIMITRAY_ISA avx512
#elif defined(__AVX2__) && defined(__FMA__)
#define LIMITRAY_AVX2 1
#define LIMITRAY_ISA avx2
#else
#define LIMITRAY_ISA portable
#endif

#if defined(LIMITRAY_AVX2)
#include <immintrin.h>
#endif
