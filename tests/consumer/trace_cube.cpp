// A user's program: makes a cube cage, shoots one ray at the middle of a face, checks the distance.
#include <cmath>
#include <cstdio>

#include "limitray/scene.h"

int main() {
  limitray::ControlCage cube;
  cube.points = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                 {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};
  cube.face_vertex_counts = {4, 4, 4, 4, 4, 4};
  cube.face_vertex_indices = {0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4,
                              1, 2, 6, 5, 2, 3, 7, 6, 3, 0, 4, 7};
  limitray::Scene scene;
  scene.add_mesh(cube);

  const float ray[] = {0, 0, 5, 0, 0, -1}, tnear[] = {0}, tfar[] = {INFINITY};
  float t = 0;
  scene.cast_rays<float>({ray, tnear, tfar}, {.t = &t});

  // Catmull-Clark's limit masks put the middle of the cube's face at 68/81.
  const double expected = 5 - 68.0 / 81.0;
  std::printf("t = %.7f, expected %.7f\n", t, expected);
  return std::abs(t - expected) < 2e-6 ? 0 : 1;
}
