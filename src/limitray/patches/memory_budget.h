// Stage: patches (S0). Comes in: the recipes of groups of faces as they are made. Goes out: an
// error as soon as it is clear that the patches of all groups won't fit in memory.
#pragma once

#include <atomic>
#include <cstddef>

#include "limitray/patches/patch_recipe.h"

namespace limitray {

/// The first groups tell what all of them will need: groups have the same number of faces.
class MemoryBudget {
 public:
  /// `limit` in bytes, 0 for what the machine has free.
  MemoryBudget(std::size_t limit, std::size_t groups, int isolation_level);
  /// Counts the next group in. Thread-safe. Throws OutOfMemory.
  void add(const PatchRecipe& recipe);

 private:
  std::size_t limit_, groups_;
  int isolation_level_;
  std::atomic<std::size_t> groups_done_{0}, patches_{0}, recipe_bytes_{0};
};

}  // namespace limitray
