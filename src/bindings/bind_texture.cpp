// Stage: bindings. MipMap: filtered lookups in images.
#include <nanobind/stl/string.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "bind.h"
#include "interruptible.h"
#include "limitray/shading/mip_map.h"

namespace limitray::bindings {
namespace {

using namespace nb::literals;

constexpr std::array<std::string_view, 4> wraps{"repeat", "mirror", "clamp", "black"};

Wrap to_wrap(const std::string& name) {
  const auto it = std::find(wraps.begin(), wraps.end(), name);
  if (it == wraps.end()) throw nb::value_error(("unknown wrap mode \"" + name + "\"").c_str());
  return static_cast<Wrap>(it - wraps.begin());
}

Output<double> sample(const MipMap& self, Input<double, -1, 2> st, Input<double, -1, 2> d_dx,
                      Input<double, -1, 2> d_dy, const std::string& wrap_s,
                      const std::string& wrap_t) {
  const TextureLookups at{
      {st.data(), st.size()}, {d_dx.data(), d_dx.size()}, {d_dy.data(), d_dy.size()}};
  const Wrap s = to_wrap(wrap_s), t = to_wrap(wrap_t);
  auto colours = uninitialised<double>(3 * st.shape(0));
  {
    nb::gil_scoped_release release;
    self.sample(at, s, t, colours.get());
  }
  return own(std::move(colours), {st.shape(0), 3});
}

}  // namespace

void bind_texture(nb::module_& module) {
  nb::class_<MipMap>(module, "MipMap", "An image and its smaller levels.")
      .def(
          "__init__",
          [](MipMap* self, Input<float, -1, -1, 3> texels) {
            new (self) MipMap({texels.data(), texels.size()}, texels.shape(1), texels.shape(0));
          },
          "texels"_a.noconvert(), "Linear colours (h, w, 3); row 0 is the bottom.")
      .def_prop_ro("width", &MipMap::width)
      .def_prop_ro("height", &MipMap::height)
      .def("sample", &sample, "st"_a.noconvert(), "d_dx"_a.noconvert(), "d_dy"_a.noconvert(),
           "wrap_s"_a, "wrap_t"_a,
           "Colours (n, 3) at st (n, 2); d_dx and d_dy are (n, 2) or (1, 2).");
}

}  // namespace limitray::bindings
