// Stage: patches. Comes in: where patches lie on the cage. Goes out: the patch at a place of the
// surface, for values that are not traced (primvars).
//
// The patches of a face (of a sub-quad of an n-gon) are cells of a quadtree; sorted along its
// Z-curve (Morton order), the cell of a point is the last one that does not begin after the point.
// A cell cut into crease pieces has several patches.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limitray/patches/patch_buffer.h"

namespace limitray {

/// Numbers of the quads that patches lie in: one a quad, n for an n-gon. OpenSubdiv's ptex faces.
class QuadNumbers {
 public:
  QuadNumbers() = default;
  explicit QuadNumbers(std::span<const std::int32_t> face_vertex_counts);

  std::size_t size() const { return first_.empty() ? 0 : first_.back(); }
  std::size_t face_count() const { return first_.empty() ? 0 : first_.size() - 1; }
  /// Quads of `face`: 1 or the number of its corners.
  std::uint32_t count(std::uint32_t face) const { return first_[face + 1] - first_[face]; }
  std::uint32_t operator()(std::uint32_t face, std::uint32_t sub_quad) const {
    return first_[face] + sub_quad;
  }

 private:
  std::vector<std::uint32_t> first_;
};

class PatchLookup {
 public:
  PatchLookup() = default;
  /// Of the patches that `infos` describes.
  PatchLookup(const QuadNumbers& quads, std::span<const PatchInfo> infos);

  /// Index into `infos` of the patch at (u,v) in [0,1]^2 of quad number `quad`; invalid_id if the
  /// quad has none (a hole).
  std::uint32_t find(std::uint32_t quad, double u, double v) const;

 private:
  struct Entry {
    std::uint32_t cell;  // where its cell begins on the Z-curve
    std::uint32_t patch;
    float u0, v0;
  };
  std::vector<std::uint32_t> begin_;  // into entries_; quad q ends where q+1 begins
  std::vector<Entry> entries_;
};

}  // namespace limitray
