// Stage: patches. See patch_lookup.h.
#include "limitray/patches/patch_lookup.h"

#include <algorithm>
#include <cmath>

namespace limitray {
namespace {

/// Finest cells a side of a quad: the deepest level of refinement is 10.
constexpr std::uint32_t resolution = 1024;

/// Number of a finest cell on the Z-curve: the bits of i and j in turn.
std::uint32_t z_order(std::uint32_t i, std::uint32_t j) {
  std::uint32_t z = 0;
  for (int bit = 0; bit < 10; ++bit)
    z |= (i >> bit & 1u) << (2 * bit) | (j >> bit & 1u) << (2 * bit + 1);
  return z;
}
std::uint32_t z_order(double u, double v) {
  const auto cell = [](double x) {
    return static_cast<std::uint32_t>(std::clamp(x * resolution, 0.0, resolution - 1.0));
  };
  return z_order(cell(u), cell(v));
}

}  // namespace

QuadNumbers::QuadNumbers(std::span<const std::int32_t> face_vertex_counts) : first_{0} {
  first_.reserve(face_vertex_counts.size() + 1);
  for (const std::int32_t n : face_vertex_counts)
    first_.push_back(first_.back() + (n == 4 ? 1 : static_cast<std::uint32_t>(n)));
}

PatchLookup::PatchLookup(const QuadNumbers& quads, std::span<const PatchInfo> infos)
    : begin_(quads.size() + 1), entries_(infos.size()) {
  // Counting sort by quad, then each quad by cell, and the pieces of a cell by where they begin.
  for (const PatchInfo& info : infos) ++begin_[quads(info.face, info.sub_quad) + 1];
  for (std::size_t q = 0; q < quads.size(); ++q) begin_[q + 1] += begin_[q];
  std::vector<std::uint32_t> next = begin_;
  for (std::size_t i = 0; i < infos.size(); ++i) {
    const PatchInfo& info = infos[i];
    const double size = std::max(info.du, info.dv);  // a piece is as long as its cell
    const std::uint32_t cell =
        z_order(std::floor(info.u0 / size) * size, std::floor(info.v0 / size) * size);
    entries_[next[quads(info.face, info.sub_quad)]++] = {cell, static_cast<std::uint32_t>(i),
                                                         info.u0, info.v0};
  }
  for (std::size_t q = 0; q < quads.size(); ++q)
    std::sort(entries_.begin() + begin_[q], entries_.begin() + begin_[q + 1],
              [](const Entry& a, const Entry& b) {
                return a.cell != b.cell ? a.cell < b.cell : a.u0 + a.v0 < b.u0 + b.v0;
              });
}

std::uint32_t PatchLookup::find(std::uint32_t quad, double u, double v) const {
  const auto begin = entries_.begin() + begin_[quad], end = entries_.begin() + begin_[quad + 1];
  if (begin == end) return invalid_id;
  auto entry = std::upper_bound(begin, end, z_order(u, v),
                                [](std::uint32_t cell, const Entry& e) { return cell < e.cell; });
  if (entry != begin) --entry;
  // The last piece of the cell that does not begin after the point.
  while (entry != begin && std::prev(entry)->cell == entry->cell &&
         (entry->u0 > u || entry->v0 > v))
    --entry;
  return entry->patch;
}

}  // namespace limitray
