// Stage: bindings. LimitEvaluator over arrays of faces and parameters.
#include <array>
#include <cstddef>

#include "bind.h"
#include "interruptible.h"
#include "limitray/cage/limit.h"

namespace limitray::bindings {
namespace {

using namespace nb::literals;

using LimitArrays =
    nb::typed<nb::tuple, Output<double>, Output<double>, Output<double>, Output<double>>;

LimitArrays evaluate_all(const LimitEvaluator& self, Input<std::int32_t, -1> faces,
                         Input<std::int32_t, -1> sub_quads, Input<double, -1, 2> uv) {
  const std::size_t n = faces.size();
  if (sub_quads.size() != n || uv.shape(0) != n) {
    throw nb::value_error("faces, sub_quads and uv must have equal lengths");
  }
  std::array<std::unique_ptr<Vec3d[]>, 4> out;
  for (auto& array : out) array = uninitialised<Vec3d>(n);

  run_interruptibly([&](Progress& progress) {
    for (std::size_t i = 0; i < n && !progress.cancel; ++i) {
      const LimitSample sample = self.evaluate(faces.data()[i], sub_quads.data()[i],
                                               uv.data()[2 * i], uv.data()[2 * i + 1]);
      out[0][i] = sample.point;
      out[1][i] = sample.normal;
      out[2][i] = sample.dp_du;
      out[3][i] = sample.dp_dv;
    }
  });

  const auto rows = [n](std::unique_ptr<Vec3d[]>& vectors) {
    Vec3d* first = vectors.release();
    nb::capsule owner(first, [](void* p) noexcept { delete[] static_cast<Vec3d*>(p); });
    return Output<double>(first, {n, std::size_t{3}}, owner);
  };
  return nb::make_tuple(rows(out[0]), rows(out[1]), rows(out[2]), rows(out[3]));
}

}  // namespace

void bind_limit(nb::module_& module) {
  nb::class_<LimitEvaluator>(module, "LimitEvaluator",
                             "The true limit surface in double; shares no code with the tracer.")
      .def(nb::init<ControlCage>(), "cage"_a)
      .def("evaluate", &evaluate_all, "faces"_a.noconvert(), "sub_quads"_a.noconvert(),
           "uv"_a.noconvert(),
           "Points, normals, dp_du and dp_dv, each (n, 3) float64, at faces (n,) int32, "
           "sub_quads (n,) int32 and uv (n, 2) float64.");
}

}  // namespace limitray::bindings
