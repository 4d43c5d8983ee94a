// Stage: mathematics. Bernstein weights, splits and restrictions of bicubic Bezier nets.
// Farin, "Curves and Surfaces for CAGD", chapters 4 and 5 (de Casteljau, blossoms).
#pragma once

#include "limitray/math/net.h"

namespace limitray {
inline namespace LIMITRAY_ISA {

/// The four cubic Bernstein weights at u, or their derivatives.
///
/// Horner's rule around u = 1/2: there the coefficients in magnitude sum to at most 3/2 on [0,1],
/// so a weight is off by at most gamma(4) * 3/2 (around 0 the sum would be 12).
template <class T>
Quad<T> bernstein(T u) {
  const T r = u - T(0.5);
  const Quad<T> c0{T(0.125), T(0.375), T(0.375), T(0.125)};
  const Quad<T> c1{T(-0.75), T(-0.75), T(0.75), T(0.75)};
  const Quad<T> c2{T(1.5), T(-1.5), T(-1.5), T(1.5)};
  const Quad<T> c3{T(-1), T(3), T(-3), T(1)};
  return c0 + r * (c1 + r * (c2 + r * c3));
}
template <class T>
Quad<T> bernstein_derivative(T u) {
  const T r = u - T(0.5);
  const Quad<T> c1{T(-0.75), T(-0.75), T(0.75), T(0.75)};
  const Quad<T> c2{T(3), T(-3), T(-3), T(3)};
  const Quad<T> c3{T(-3), T(9), T(-9), T(3)};
  return c1 + r * (c2 + r * c3);
}

/// Columns of the matrix that restricts a cubic to [a, b]: new point i = sum_k column[k][i] * old
/// k. The entries are the blossom's weights: >= 0, each row sums to 1.
template <class T>
struct Restriction {
  Quad<T> column[4];
};
template <class T>
Restriction<T> restriction(T a, T b) {
  const T na = 1 - a, nb = 1 - b;
  // Row i is the blossom at (3-i) times a and i times b.
  const Quad<T> p{a, a, a, b}, q{a, a, b, b}, r{a, b, b, b};
  const Quad<T> np{na, na, na, nb}, nq{na, na, nb, nb}, nr{na, nb, nb, nb};
  return {{np * nq * nr, p * nq * nr + np * q * nr + np * nq * r,
           np * q * r + p * nq * r + p * q * nr, p * q * r}};
}
/// Restrictions to [0, 1/2] and [1/2, 1]: de Casteljau at 1/2 written as matrices.
template <class T>
Restriction<T> low_half() {
  return {{quad<T>(1, T(0.5), T(0.25), T(0.125)), quad<T>(0, T(0.5), T(0.5), T(0.375)),
           quad<T>(0, 0, T(0.25), T(0.375)), quad<T>(0, 0, 0, T(0.125))}};
}
template <class T>
Restriction<T> high_half() {
  return {{quad<T>(T(0.125), 0, 0, 0), quad<T>(T(0.375), T(0.25), 0, 0),
           quad<T>(T(0.375), T(0.5), T(0.5), 0), quad<T>(T(0.125), T(0.25), T(0.5), 1)}};
}

/// The four columns (rows) of a net, each repeated over all columns (rows): what the products below
/// share between two children.
template <class T>
struct Spread {
  Net<T> n[4];
};
template <class T>
Spread<T> spread_columns(const Net<T>& p) {
  return {{permute_columns<0, 0, 0, 0>(p), permute_columns<1, 1, 1, 1>(p),
           permute_columns<2, 2, 2, 2>(p), permute_columns<3, 3, 3, 3>(p)}};
}
template <class T>
Spread<T> spread_rows(const Net<T>& p) {
  return {{permute_rows<0, 0, 0, 0>(p), permute_rows<1, 1, 1, 1>(p), permute_rows<2, 2, 2, 2>(p),
           permute_rows<3, 3, 3, 3>(p)}};
}
template <class T>
Net<T> restrict_u(const Spread<T>& p, const Restriction<T>& a) {
  return (along_rows<T>(a.column[0]) * p.n[0] + along_rows<T>(a.column[1]) * p.n[1]) +
         (along_rows<T>(a.column[2]) * p.n[2] + along_rows<T>(a.column[3]) * p.n[3]);
}
template <class T>
Net<T> restrict_v(const Spread<T>& p, const Restriction<T>& a) {
  return (along_columns<T>(a.column[0]) * p.n[0] + along_columns<T>(a.column[1]) * p.n[1]) +
         (along_columns<T>(a.column[2]) * p.n[2] + along_columns<T>(a.column[3]) * p.n[3]);
}
/// S6: the net of p on the domain of au x av; two 4x4 products, gamma(8) * max|p| off at most.
template <class T>
Net<T> restrict_uv(const Net<T>& p, const Restriction<T>& au, const Restriction<T>& av) {
  return restrict_v(spread_rows(restrict_u(spread_columns(p), au)), av);
}

/// Control values of the derivative by s (by t) divided by 3; the last column (row) repeats the one
/// before it, so that bounds over all lanes hold.
template <class T>
Net<T> difference_u(const Net<T>& p) {
  return permute_columns<1, 2, 3, 3>(p) - permute_columns<0, 1, 2, 2>(p);
}
template <class T>
Net<T> difference_v(const Net<T>& p) {
  return permute_rows<1, 2, 3, 3>(p) - permute_rows<0, 1, 2, 2>(p);
}
/// Second differences, with repeated lanes alike.
template <class T>
Net<T> second_difference_u(const Net<T>& p) {
  return (permute_columns<2, 3, 3, 2>(p) - permute_columns<1, 2, 2, 1>(p)) -
         (permute_columns<1, 2, 2, 1>(p) - permute_columns<0, 1, 1, 0>(p));
}
template <class T>
Net<T> second_difference_v(const Net<T>& p) {
  return (permute_rows<2, 3, 3, 2>(p) - permute_rows<1, 2, 2, 1>(p)) -
         (permute_rows<1, 2, 2, 1>(p) - permute_rows<0, 1, 1, 0>(p));
}

}  // namespace LIMITRAY_ISA
}  // namespace limitray
