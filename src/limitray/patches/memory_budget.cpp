// Stage: patches (S0). See memory_budget.h.
#include "limitray/patches/memory_budget.h"

#include <cstdint>
#include <sstream>

#include "limitray/memory.h"

namespace limitray {
namespace {

/// What a patch takes while a mesh is made, beside its recipe: its net, bump and info (268), its
/// model (64), its hull and box (48), its part of Embree's tree (482) and of ours (88), rounded up.
constexpr double bytes_a_patch = 1200;
/// A patch is named by 31 bits in the tree.
constexpr double patches_at_most = 2147483648.0;

}  // namespace

MemoryBudget::MemoryBudget(std::size_t limit, std::size_t groups, int isolation_level)
    : limit_(limit != 0 ? limit : free_memory()),
      groups_(groups),
      isolation_level_(isolation_level) {}

void MemoryBudget::add(const PatchRecipe& recipe) {
  const auto patches = static_cast<double>(patches_ += recipe.infos.size());
  const auto bytes = static_cast<double>(recipe_bytes_ += recipe.bytes());
  const double share = static_cast<double>(groups_) / static_cast<double>(++groups_done_);
  const double all_patches = patches * share;
  const double needed = (bytes + bytes_a_patch * patches) * share;
  if (needed <= static_cast<double>(limit_) && all_patches < patches_at_most) return;
  std::ostringstream text;
  text.precision(2);
  text << std::fixed << "the cage needs about " << needed / 1e9 << " GB for "
       << static_cast<std::uint64_t>(all_patches) << " patches at isolation_level "
       << isolation_level_ << ", of which " << static_cast<double>(limit_) / 1e9
       << " GB can be had; a lower level needs less";
  throw OutOfMemory(text.str());
}

}  // namespace limitray
