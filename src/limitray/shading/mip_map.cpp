// Stage: shading. See mip_map.h.
#include "limitray/shading/mip_map.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace limitray {
namespace {

constexpr double max_anisotropy = 4;

/// Texel of index `i` on an axis of `size` texels; -1 for black.
std::ptrdiff_t wrapped(std::ptrdiff_t i, std::ptrdiff_t size, Wrap wrap) {
  const auto modulo = [](std::ptrdiff_t x, std::ptrdiff_t n) { return (x % n + n) % n; };
  switch (wrap) {
    case Wrap::repeat:
      return modulo(i, size);
    case Wrap::mirror: {
      const std::ptrdiff_t period = modulo(i, 2 * size);
      return std::min(period, 2 * size - 1 - period);
    }
    case Wrap::clamp:
      return std::clamp<std::ptrdiff_t>(i, 0, size - 1);
    case Wrap::black:
      break;
  }
  return i < 0 || i >= size ? -1 : i;
}

}  // namespace

MipMap::MipMap(std::span<const float> texels, std::size_t width, std::size_t height) {
  if (width == 0 || height == 0 || texels.size() != 3 * width * height)
    throw std::invalid_argument("texels: must be 3 x width x height numbers and not empty, got " +
                                std::to_string(texels.size()));
  levels_.push_back({width, height, {texels.begin(), texels.end()}});
  while (levels_.back().width > 1 || levels_.back().height > 1)
    levels_.push_back(halved(levels_.back()));
}

/// Averages of 2 x 2 texels; an odd last row or column counts twice.
MipMap::Level MipMap::halved(const Level& fine) {
  Level half{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
  half.texels.resize(3 * half.width * half.height);
  tbb::parallel_for(std::size_t{0}, half.height, [&](std::size_t y) {
    const float* row0 = fine.texels.data() + 6 * y * fine.width;
    const float* row1 = 2 * y + 1 < fine.height ? row0 + 3 * fine.width : row0;
    for (std::size_t x = 0; x < half.width; ++x) {
      const std::size_t a = 6 * x, b = 2 * x + 1 < fine.width ? a + 3 : a;
      for (std::size_t k = 0; k < 3; ++k)
        half.texels[3 * (y * half.width + x) + k] =
            0.25f * (row0[a + k] + row0[b + k] + row1[a + k] + row1[b + k]);
    }
  });
  return half;
}

MipMap::Colour MipMap::bilinear(const Level& level, double s, double t, Wrap wrap_s, Wrap wrap_t) {
  const auto width = static_cast<std::ptrdiff_t>(level.width),
             height = static_cast<std::ptrdiff_t>(level.height);
  const double x = s * static_cast<double>(width) - 0.5, y = t * static_cast<double>(height) - 0.5;
  constexpr double farthest = 1e15;  // beyond it texels cannot be counted
  if (!(std::abs(x) < farthest && std::abs(y) < farthest)) return {};
  const auto i = static_cast<std::ptrdiff_t>(std::floor(x)),
             j = static_cast<std::ptrdiff_t>(std::floor(y));
  const double across[2] = {1 - (x - std::floor(x)), x - std::floor(x)};
  const double upward[2] = {1 - (y - std::floor(y)), y - std::floor(y)};
  Colour sum{};
  for (int b = 0; b < 2; ++b)
    for (int a = 0; a < 2; ++a) {
      const std::ptrdiff_t column = wrapped(i + a, width, wrap_s),
                           row = wrapped(j + b, height, wrap_t);
      if (column < 0 || row < 0) continue;
      const float* texel = level.texels.data() + 3 * (row * width + column);
      for (int k = 0; k < 3; ++k) sum.c[k] += across[a] * upward[b] * texel[k];
    }
  return sum;
}

double MipMap::level_of(const double* d_dx, const double* d_dy) const {
  const auto w = static_cast<double>(width()), h = static_cast<double>(height());
  const double a = std::hypot(d_dx[0] * w, d_dx[1] * h), b = std::hypot(d_dy[0] * w, d_dy[1] * h);
  const double longer = std::max(a, b), shorter = std::min(a, b);
  const double footprint = shorter > 0 ? std::min(longer, max_anisotropy * shorter) : longer;
  if (!(footprint > 1)) return 0;
  return std::min(std::log2(footprint), static_cast<double>(levels_.size() - 1));
}

void MipMap::sample(const TextureLookups& at, Wrap wrap_s, Wrap wrap_t, double* colours) const {
  const std::size_t n = at.st.size() / 2;
  for (const std::span<const double>& d : {at.d_dx, at.d_dy})
    if (at.st.size() % 2 != 0 || (d.size() != 2 && d.size() != 2 * n))
      throw std::invalid_argument("d_dx, d_dy: must have one row, or one a place (" +
                                  std::to_string(n) + "), got " + std::to_string(d.size() / 2));
  const std::size_t step_x = at.d_dx.size() == 2 ? 0 : 2, step_y = at.d_dy.size() == 2 ? 0 : 2;
  const auto sample_one = [&](std::size_t i) {
    const double s = at.st[2 * i], t = at.st[2 * i + 1];
    const double level = level_of(&at.d_dx[step_x * i], &at.d_dy[step_y * i]);
    const auto finer = static_cast<std::size_t>(level);
    Colour colour = bilinear(levels_[finer], s, t, wrap_s, wrap_t);
    const double blend = level - static_cast<double>(finer);
    if (blend > 0) {
      const Colour coarse = bilinear(levels_[finer + 1], s, t, wrap_s, wrap_t);
      for (int k = 0; k < 3; ++k) colour.c[k] += blend * (coarse.c[k] - colour.c[k]);
    }
    std::copy_n(colour.c, 3, colours + 3 * i);
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 1024), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) sample_one(i);
  });
}

}  // namespace limitray
