// Stage: shading. Comes in: an image and the footprints of pixels in it. Goes out: filtered
// colours.
//
// Williams 1983, "Pyramidal Parametrics": levels of half the size each, lookups linear between
// texels and between levels. A long footprint counts as at most four times its width, so that
// surfaces seen edge-on keep detail; several samples a pixel cover what that leaves out.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace limitray {

/// What lies beyond [0, 1].
enum class Wrap { repeat, mirror, clamp, black };

/// n lookups: places (s, t), (0, 0) at the first texel's outer corner, and the differences of (s,
/// t) to two neighbouring pixels; these hold one row a lookup, or one for all.
struct TextureLookups {
  std::span<const double> st, d_dx, d_dy;  // 2 n values; 2 n or 2
};

class MipMap {
 public:
  /// `texels` are `height` rows of `width` colours of three numbers. Throws std::invalid_argument
  /// unless there is at least one and the sizes agree.
  MipMap(std::span<const float> texels, std::size_t width, std::size_t height);

  std::size_t width() const { return levels_[0].width; }
  std::size_t height() const { return levels_[0].height; }
  std::size_t level_count() const { return levels_.size(); }

  /// Writes 3 n numbers. Places and differences that are not finite give black. Throws
  /// std::invalid_argument if the sizes do not agree.
  void sample(const TextureLookups& at, Wrap wrap_s, Wrap wrap_t, double* colours) const;

 private:
  struct Level {
    std::size_t width, height;
    std::vector<float> texels;
  };
  struct Colour {
    double c[3];
  };

  static Level halved(const Level& fine);
  static Colour bilinear(const Level& level, double s, double t, Wrap wrap_s, Wrap wrap_t);
  /// Level for the differences of one lookup: 0 is the finest.
  double level_of(const double* d_dx, const double* d_dy) const;

  std::vector<Level> levels_;
};

}  // namespace limitray
