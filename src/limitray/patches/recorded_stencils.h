// Stage: patches (S0). Between OpenSubdiv's numbering of points and a recipe's. Includes nothing of
// OpenSubdiv: it is its templates that fill RecordedStencils.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace limitray {

/// Numbers the points of a recipe: control points as they are met, then computed points. OpenSubdiv
/// counts the vertices of all levels through, then the Gregory points.
class PointNumbers {
 public:
  PointNumbers(std::vector<std::int32_t>& control_points,
               const std::vector<std::int32_t>& group_points, int total)
      : control_points_(control_points), group_points_(group_points), numbers_(total, unknown) {}

  /// Counts a control point in; does nothing for computed points.
  void use(int far_index) {
    if (far_index >= static_cast<int>(group_points_.size()) || numbers_[far_index] != unknown)
      return;
    numbers_[far_index] = static_cast<std::int32_t>(control_points_.size());
    control_points_.push_back(group_points_[far_index]);
  }
  void define(int far_index, std::size_t number) {
    numbers_[far_index] = static_cast<std::int32_t>(number);
  }
  std::int32_t operator[](int far_index) const { return numbers_[far_index]; }

 private:
  static constexpr std::int32_t unknown = -1;
  std::vector<std::int32_t>& control_points_;      // into the cage's points
  const std::vector<std::int32_t>& group_points_;  // the group's, the same
  std::vector<std::int32_t> numbers_;              // one an OpenSubdiv point
};

/// Weighted sums as OpenSubdiv's PrimvarRefiner tells them: it "interpolates" point numbers.
struct RecordedStencils {
  std::vector<int> target, begin, sources;
  std::vector<double> weights;

  struct Point {
    RecordedStencils* list;
    int index;

    void Clear() {
      list->target.push_back(index);
      list->begin.push_back(static_cast<int>(list->sources.size()));
    }
    void AddWithWeight(Point source, double weight) {
      list->sources.push_back(source.index);
      list->weights.push_back(weight);
    }
  };
  struct Level {
    RecordedStencils* list;
    int offset;
    Point operator[](int i) const { return {list, offset + i}; }
  };
};

}  // namespace limitray
