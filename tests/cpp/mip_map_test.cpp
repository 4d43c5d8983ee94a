// Mip maps: levels, wrap modes and footprints.
#include "limitray/shading/mip_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace limitray {
namespace {

/// Grey texels 0, 1, 2, ... row by row.
MipMap ramp(std::size_t width, std::size_t height) {
  std::vector<float> texels;
  for (std::size_t i = 0; i < width * height; ++i) texels.insert(texels.end(), 3, float(i));
  return MipMap(texels, width, height);
}

double grey(const MipMap& map, double s, double t, double size = 0, Wrap wrap = Wrap::clamp) {
  const double st[2] = {s, t}, d_dx[2] = {size, 0}, d_dy[2] = {0, size};
  double colour[3];
  map.sample({st, d_dx, d_dy}, wrap, wrap, colour);
  EXPECT_EQ(colour[0], colour[1]);
  EXPECT_EQ(colour[0], colour[2]);
  return colour[0];
}

TEST(MipMap, HasLevelsDownToOneTexel) {
  EXPECT_EQ(ramp(8, 8).level_count(), 4u);
  EXPECT_EQ(ramp(1, 1).level_count(), 1u);
  EXPECT_EQ(ramp(5, 2).level_count(), 4u);  // 5x2, 3x1, 2x1, 1x1
}

TEST(MipMap, IsLinearBetweenTexelCentres) {
  const MipMap map = ramp(4, 1);
  for (double s : {0.125, 0.2, 0.5, 0.875}) EXPECT_NEAR(grey(map, s, 0.5), 4 * s - 0.5, 1e-12);
}

TEST(MipMap, AveragesOverWideFootprints) {
  EXPECT_NEAR(grey(ramp(4, 4), 0.3, 0.8, 1), 7.5, 1e-6);
  EXPECT_NEAR(grey(ramp(4, 4), 0.3, 0.8, 100), 7.5, 1e-6);
}

TEST(MipMap, WrapsFarPlaces) {
  const MipMap map = ramp(4, 1);
  EXPECT_NEAR(grey(map, 1000.375, 0.5, 0, Wrap::repeat), 1, 1e-9);
  EXPECT_NEAR(grey(map, -999.625, 0.5, 0, Wrap::repeat), 1, 1e-9);
  EXPECT_NEAR(grey(map, 1001 - 0.375, 0.5, 0, Wrap::mirror), 2, 1e-9);
  EXPECT_NEAR(grey(map, 1e9, 0.5, 0, Wrap::clamp), 3, 1e-9);
  EXPECT_EQ(grey(map, 1e9, 0.5, 0, Wrap::black), 0);
}

TEST(MipMap, AnswersBlackWhereNothingIsKnown) {
  const double infinity = std::numeric_limits<double>::infinity();
  for (Wrap wrap : {Wrap::repeat, Wrap::mirror, Wrap::clamp, Wrap::black}) {
    EXPECT_EQ(grey(ramp(4, 4), std::nan(""), 0.5, 0, wrap), 0);
    EXPECT_EQ(grey(ramp(4, 4), 0.5, -infinity, 0, wrap), 0);
    EXPECT_EQ(grey(ramp(4, 4), 1e300, 0.5, 0, wrap), 0);
  }
  EXPECT_TRUE(std::isfinite(grey(ramp(4, 4), 0.5, 0.5, infinity)));
  EXPECT_TRUE(std::isfinite(grey(ramp(4, 4), 0.5, 0.5, std::nan(""))));
}

TEST(MipMap, ChecksSizes) {
  const std::vector<float> texels(12);
  EXPECT_THROW(MipMap(texels, 2, 1), std::invalid_argument);
  EXPECT_THROW(MipMap({}, 0, 0), std::invalid_argument);
  const double st[4] = {}, d[2] = {}, wrong[6] = {};
  double colours[6];
  EXPECT_THROW(MipMap(texels, 2, 2).sample({st, d, wrong}, Wrap::clamp, Wrap::clamp, colours),
               std::invalid_argument);
}

}  // namespace
}  // namespace limitray
