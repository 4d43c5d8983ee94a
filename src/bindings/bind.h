// Stage: bindings. What the bind_x files share: their declarations, and numpy arrays that own or
// view C++ memory. Types and shapes only; all mathematics is in src/limitray.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <vector>

#include "limitray/math/vec.h"

namespace limitray::bindings {

namespace nb = nanobind;

void bind_cage(nb::module_& module);
void bind_limit(nb::module_& module);
void bind_scene(nb::module_& module);
void bind_texture(nb::module_& module);

/// C-contiguous input array, read in place. The dtype must match exactly (see
/// `nb::arg::noconvert`).
template <class T, nb::ssize_t... Shape>
using Input = nb::ndarray<const T, nb::shape<Shape...>, nb::c_contig, nb::device::cpu>;

/// Array handed to numpy.
template <class T>
using Output = nb::ndarray<nb::numpy, T>;

/// Memory for `count` values that is not initialised: the caller writes each of them.
template <class T>
std::unique_ptr<T[]> uninitialised(std::size_t count) {
  return std::unique_ptr<T[]>(new T[count]);
}

/// A numpy array of `shape` that takes over `data`.
template <class T>
Output<T> own(std::unique_ptr<T[]> data, std::initializer_list<std::size_t> shape) {
  T* values = data.get();
  nb::capsule owner(data.release(), [](void* p) noexcept { delete[] static_cast<T*>(p); });
  return Output<T>(values, shape, owner);
}

/// A numpy array of `shape` that takes over the elements of `values`.
template <class T>
Output<T> own(std::vector<T>&& values, std::initializer_list<std::size_t> shape) {
  auto kept = std::make_unique<std::vector<T>>(std::move(values));
  T* data = kept->data();
  nb::capsule owner(kept.release(),
                    [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return Output<T>(data, shape, owner);
}

static_assert(sizeof(Vec3d) == 3 * sizeof(double), "rows of (n, 3) arrays are read as Vec3d");

/// The rows of an (n, 3) array as points.
inline std::vector<Vec3d> to_points(const Input<double, -1, 3>& rows) {
  const Vec3d* first = reinterpret_cast<const Vec3d*>(rows.data());
  return {first, first + rows.shape(0)};
}

/// The affine map of a (4, 4) matrix that acts on column vectors; its last row is not read.
inline Affine to_affine(const Input<double, 4, 4>& m) {
  Affine map;
  for (std::size_t i = 0; i < 3; ++i) {
    map.linear[i] = {m(i, 0), m(i, 1), m(i, 2)};
    map.offset[static_cast<int>(i)] = m(i, 3);
  }
  return map;
}

}  // namespace limitray::bindings
