// Stage: patches (S0). See refine.h. The only file that includes OpenSubdiv.
//
// The faces are refined in groups that share the base topology: groups run in parallel, the memory
// of a refinement is that of one group a thread, and what is kept of each is a PatchRecipe.
#include "limitray/patches/refine.h"

#include <opensubdiv/far/patchTable.h>
#include <opensubdiv/far/patchTableFactory.h>
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/ptexIndices.h>
#include <opensubdiv/far/stencilTable.h>
#include <opensubdiv/far/topologyDescriptor.h>
#include <opensubdiv/far/topologyRefinerFactory.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "limitray/patches/bspline.h"
#include "limitray/patches/patch_recipe.h"

namespace limitray {
namespace {

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

using RefinerFactory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
using FarRefiner = std::unique_ptr<Far::TopologyRefiner>;
using FarTable = std::unique_ptr<const Far::PatchTable>;

constexpr int deepest_level = 10;  // OpenSubdiv's limit
constexpr std::size_t faces_per_group = 8192;

// The base topology.

Sdc::Options scheme_options(const ControlCage& cage) {
  Sdc::Options options;
  switch (cage.interpolate_boundary) {
    case InterpolateBoundary::none:
      options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_NONE);
      break;
    case InterpolateBoundary::edge_only:
      options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
      break;
    case InterpolateBoundary::edge_and_corner:
      options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER);
      break;
  }
  options.SetCreasingMethod(cage.creasing_method == CreasingMethod::chaikin
                                ? Sdc::Options::CREASE_CHAIKIN
                                : Sdc::Options::CREASE_UNIFORM);
  options.SetTriangleSubdivision(cage.triangle_subdivision_rule == TriangleSubdivisionRule::smooth
                                     ? Sdc::Options::TRI_SUB_SMOOTH
                                     : Sdc::Options::TRI_SUB_CATMARK);
  return options;
}

FarRefiner make_base(const ControlCage& cage) {
  std::vector<std::int32_t> crease_vertices;
  std::vector<float> crease_weights;
  for (const CreaseEdge& edge : crease_edges(cage)) {
    crease_vertices.insert(crease_vertices.end(), {edge.v0, edge.v1});
    crease_weights.push_back(edge.sharpness);
  }

  Far::TopologyDescriptor d;
  d.numVertices = static_cast<int>(cage.points.size());
  d.numFaces = static_cast<int>(cage.face_count());
  d.numVertsPerFace = cage.face_vertex_counts.data();
  d.vertIndicesPerFace = cage.face_vertex_indices.data();
  d.numCreases = static_cast<int>(crease_weights.size());
  d.creaseVertexIndexPairs = crease_vertices.data();
  d.creaseWeights = crease_weights.data();
  d.numCorners = static_cast<int>(cage.corner_indices.size());
  d.cornerVertexIndices = cage.corner_indices.data();
  d.cornerWeights = cage.corner_sharpnesses.data();
  d.numHoles = static_cast<int>(cage.hole_indices.size());
  d.holeIndices = cage.hole_indices.data();

  RefinerFactory::Options options(Sdc::SCHEME_CATMARK, scheme_options(cage));
  FarRefiner base(RefinerFactory::Create(d, options));
  if (!base)
    throw std::invalid_argument("cage: the topology cannot be refined (" +
                                std::to_string(cage.points.size()) + " points, " +
                                std::to_string(cage.face_count()) + " faces)");
  return base;
}

/// Base face and corner of each ptex face.
struct PtexFaces {
  std::vector<std::uint32_t> face;
  std::vector<std::uint16_t> sub_quad;

  explicit PtexFaces(const ControlCage& cage) {
    for (std::size_t f = 0; f < cage.face_count(); ++f) {
      const int n = cage.face_vertex_counts[f];
      for (int corner = 0; corner < (n == 4 ? 1 : n); ++corner) {
        face.push_back(static_cast<std::uint32_t>(f));
        sub_quad.push_back(static_cast<std::uint16_t>(corner));
      }
    }
  }
};

// Levels.

struct Levels {
  int smooth;  // where smooth irregular features end
  int sharp;   // where semi-sharp features have decayed
};

/// Semi-sharp features must be followed until they have decayed, or the surface is not exact; only
/// they are followed deeper than asked. Smooth features go to level 2 at least then: at level 1 the
/// centre of an n-gon can still share a face with a semi-sharp edge point.
Levels levels_for(const ControlCage& cage, int isolation_level) {
  float largest = 0;
  for (const std::vector<float>* sharpnesses : {&cage.crease_sharpnesses, &cage.corner_sharpnesses})
    for (float s : *sharpnesses)
      if (s < infinite_sharpness) largest = std::max(largest, s);
  if (largest <= 0) return {isolation_level, isolation_level};
  const int smooth = std::max(isolation_level, 2);
  return {smooth, std::max(smooth, static_cast<int>(std::ceil(largest)))};
}

// One group of faces: from OpenSubdiv's refinement to a recipe.

/// Numbers the points of a group: control points as they are met, then computed points. OpenSubdiv
/// counts the vertices of all levels through, then the Gregory points.
class PointNumbers {
 public:
  PointNumbers(PatchRecipe& recipe, int base_count, int total)
      : recipe_(recipe), base_count_(base_count), local_(total, unknown) {}

  bool is_base(int far_index) const { return far_index < base_count_; }

  /// Counts a control point in.
  void use(int far_index) {
    if (!is_base(far_index) || local_[far_index] != unknown) return;
    local_[far_index] = static_cast<std::int32_t>(recipe_.control_points.size());
    recipe_.control_points.push_back(far_index);
  }
  void define(int far_index, std::int32_t local) { local_[far_index] = local; }
  std::int32_t operator[](int far_index) const { return local_[far_index]; }

 private:
  static constexpr std::int32_t unknown = -1;
  PatchRecipe& recipe_;
  int base_count_;
  std::vector<std::int32_t> local_;
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

RecordedStencils record_refinement(const Far::TopologyRefiner& refiner) {
  RecordedStencils list;
  const Far::PrimvarRefinerReal<double> primvars(refiner);
  int offset = 0;
  for (int level = 1; level < refiner.GetNumLevels(); ++level) {
    const RecordedStencils::Level source{&list, offset};
    offset += refiner.GetLevel(level - 1).GetNumVertices();
    RecordedStencils::Level target{&list, offset};
    primvars.Interpolate(level, source, target);
  }
  list.begin.push_back(static_cast<int>(list.sources.size()));
  return list;
}

class GroupBuilder {
 public:
  GroupBuilder(const Far::TopologyRefiner& refiner, const Far::PatchTable& table,
               const PtexFaces& ptex)
      : refiner_(refiner),
        table_(table),
        ptex_(ptex),
        numbers_(recipe_, refiner.GetLevel(0).GetNumVertices(),
                 refiner.GetNumVerticesTotal() + table.GetNumLocalPoints()) {}

  PatchRecipe build() {
    add_stencils();
    for (int array = 0; array < table_.GetNumPatchArrays(); ++array)
      for (int i = 0; i < table_.GetNumPatches(array); ++i) add_patch(array, i);
    return std::move(recipe_);
  }

 private:
  void add_stencils() {
    const RecordedStencils refined = record_refinement(refiner_);
    const auto* local = table_.GetLocalPointStencilTable<double>();
    for (int source : refined.sources) numbers_.use(source);
    if (local)
      for (int source : local->GetControlIndices()) numbers_.use(source);
    for (int source : table_.GetPatchControlVerticesTable()) numbers_.use(source);

    for (std::size_t i = 0; i < refined.target.size(); ++i) {
      const int begin = refined.begin[i], end = refined.begin[i + 1];
      add_stencil(refined.target[i], refined.sources.data() + begin, refined.weights.data() + begin,
                  end - begin);
    }
    if (local) add_local_points(*local);
    recipe_.stencils.finish();
  }

  void add_local_points(const Far::StencilTableReal<double>& local) {
    int target = refiner_.GetNumVerticesTotal();
    const int* source = local.GetControlIndices().data();
    const double* weight = local.GetWeights().data();
    for (int size : local.GetSizes()) {
      add_stencil(target++, source, weight, size);
      source += size;
      weight += size;
    }
  }

  void add_stencil(int target, const int* sources, const double* weights, int size) {
    sources_.resize(size);
    for (int i = 0; i < size; ++i) sources_[i] = numbers_[sources[i]];
    numbers_.define(target, static_cast<std::int32_t>(recipe_.control_points.size() +
                                                      recipe_.stencils.size()));
    recipe_.stencils.add(sources_, {weights, static_cast<std::size_t>(size)});
  }

  void add_patch(int array, int i) {
    const Far::ConstIndexArray points = table_.GetPatchVertices(array, i);
    const Far::PatchParam param = table_.GetPatchParam(array, i);
    PatchInfo info = patch_info(param);
    if (table_.GetPatchArrayDescriptor(array).GetType() == Far::PatchDescriptor::REGULAR) {
      add_regular(points, param.GetBoundary(), table_.GetSingleCreasePatchSharpnessValue(array, i),
                  info);
      return;
    }
    info.bump = static_cast<std::uint32_t>(recipe_.gregory.size());
    recipe_.infos.push_back(info);
    GregoryPatch& patch = recipe_.gregory.emplace_back();
    for (int k = 0; k < 20; ++k) patch[k] = numbers_[points[k]];
  }

  PatchInfo patch_info(const Far::PatchParam& param) const {
    PatchInfo info;
    info.face = ptex_.face[param.GetFaceId()];
    info.sub_quad = ptex_.sub_quad[param.GetFaceId()];
    info.level = param.GetDepth();
    info.du = info.dv = param.GetParamFraction();
    info.u0 = static_cast<float>(param.GetU()) * info.du;
    info.v0 = static_cast<float>(param.GetV()) * info.dv;
    return info;
  }

  void add_regular(const Far::ConstIndexArray& points, unsigned edges, float sharpness,
                   const PatchInfo& info) {
    RegularPatch& patch = recipe_.regular.emplace_back();
    for (int k = 0; k < 16; ++k) patch.points[k] = numbers_[points[k]];
    patch.edges = static_cast<std::uint16_t>(edges);
    if (sharpness <= 0) {
      recipe_.infos.push_back(info);
      return;
    }
    patch.crease = find_crease(sharpness);
    for (const CreasePiece& piece : recipe_.creases[patch.crease])
      recipe_.infos.push_back(piece_info(info, edges, piece));
  }

  std::uint16_t find_crease(float sharpness) {
    const auto it = std::find(sharpnesses_.begin(), sharpnesses_.end(), sharpness);
    const std::size_t index = it - sharpnesses_.begin();
    if (it == sharpnesses_.end()) {
      sharpnesses_.push_back(sharpness);
      recipe_.creases.push_back(crease_pieces(sharpness));
    }
    return static_cast<std::uint16_t>(index);
  }

  /// The rectangle of a piece: distances from the crease edge become s or t.
  static PatchInfo piece_info(PatchInfo info, unsigned edge, const CreasePiece& piece) {
    const bool reversed = edge == edge_t1 || edge == edge_s1;
    const double begin = reversed ? 1 - piece.end : piece.begin;
    float& start = edge == edge_t0 || edge == edge_t1 ? info.v0 : info.u0;
    float& size = edge == edge_t0 || edge == edge_t1 ? info.dv : info.du;
    start = static_cast<float>(start + begin * size);
    size = static_cast<float>((piece.end - piece.begin) * size);
    return info;
  }

  const Far::TopologyRefiner& refiner_;
  const Far::PatchTable& table_;
  const PtexFaces& ptex_;
  PatchRecipe recipe_;
  PointNumbers numbers_;
  std::vector<std::int32_t> sources_;
  std::vector<float> sharpnesses_;  // of recipe_.creases
};

PatchRecipe refine_group(const Far::TopologyRefiner& base, const PtexFaces& ptex,
                         const std::vector<int>& faces, Levels levels) {
  Far::PatchTableFactory::Options options(levels.sharp);
  options.useSingleCreasePatch = true;
  options.useInfSharpPatch = true;
  options.generateLegacySharpCornerPatches = false;
  options.generateFVarLegacyLinearPatches = false;
  options.generateVaryingTables = false;
  options.SetPatchPrecision<double>();
  options.SetEndCapType(Far::PatchTableFactory::Options::ENDCAP_GREGORY_BASIS);

  Far::TopologyRefiner::AdaptiveOptions adaptive = options.GetRefineAdaptiveOptions();
  adaptive.SetSecondaryLevel(levels.smooth);

  const Far::ConstIndexArray selected(faces.data(), static_cast<int>(faces.size()));
  const FarRefiner refiner(RefinerFactory::Create(base));
  refiner->RefineAdaptive(adaptive, selected);
  const FarTable table(Far::PatchTableFactory::Create(*refiner, options, selected));
  return GroupBuilder(*refiner, *table, ptex).build();
}

/// Faces that have a surface, in groups. OpenSubdiv adds the faces that the boundary rule `none`
/// takes away to the cage's holes.
std::vector<std::vector<int>> face_groups(const Far::TopologyRefiner& base) {
  std::vector<int> faces;
  const Far::TopologyLevel& level = base.GetLevel(0);
  for (int f = 0; f < level.GetNumFaces(); ++f)
    if (!level.IsFaceHole(f)) faces.push_back(f);

  std::vector<std::vector<int>> groups;
  for (std::size_t i = 0; i < faces.size(); i += faces_per_group)
    groups.emplace_back(faces.begin() + i,
                        faces.begin() + std::min(faces.size(), i + faces_per_group));
  return groups;
}

Vec3d centre(std::span<const Vec3d> points) {
  if (points.empty()) return {};
  Vec3d low = points[0], high = points[0];
  for (const Vec3d& p : points)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  return 0.5 * low + 0.5 * high;
}

}  // namespace

struct Refiner::Topology {
  std::size_t point_count = 0;
  std::vector<PatchRecipe> groups;
  std::vector<std::size_t> first_net{0}, first_bump{0};  // one a group, and the totals
};

Refiner::Refiner(const ControlCage& cage, const RefineOptions& options)
    : topology_(std::make_unique<Topology>()) {
  if (options.isolation_level < 1 || options.isolation_level > deepest_level)
    throw std::invalid_argument("isolation_level: must be 1 to 10, got " +
                                std::to_string(options.isolation_level));
  Topology& t = *topology_;
  t.point_count = cage.points.size();

  const FarRefiner base = make_base(cage);
  const PtexFaces ptex(cage);
  const Levels levels = levels_for(cage, options.isolation_level);
  const std::vector<std::vector<int>> groups = face_groups(*base);
  t.groups.resize(groups.size());
  tbb::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t g) {
    t.groups[g] = refine_group(*base, ptex, groups[g], levels);
  });
  for (const PatchRecipe& group : t.groups) {
    t.first_net.push_back(t.first_net.back() + group.infos.size());
    t.first_bump.push_back(t.first_bump.back() + group.gregory.size());
  }
}

Refiner::~Refiner() = default;
Refiner::Refiner(Refiner&&) noexcept = default;
Refiner& Refiner::operator=(Refiner&&) noexcept = default;

PatchBuffer<double> Refiner::make_patches(std::span<const Vec3d> points) const {
  const Topology& t = *topology_;
  if (points.size() != t.point_count)
    throw std::invalid_argument("points: must be as many as the cage has, " +
                                std::to_string(t.point_count) + ", got " +
                                std::to_string(points.size()));
  PatchBuffer<double> patches;
  patches.origin = centre(points);
  patches.nets.resize(t.first_net.back());
  patches.infos.resize(t.first_net.back());
  patches.bumps.resize(t.first_bump.back());

  std::vector<double> radius(t.groups.size());
  tbb::parallel_for(std::size_t{0}, t.groups.size(), [&](std::size_t g) {
    const std::size_t net = t.first_net[g], bump = t.first_bump[g];
    radius[g] = t.groups[g].make(points, patches.origin, patches.nets.data() + net,
                                 patches.bumps.data() + bump);
    for (std::size_t i = 0; i < t.groups[g].infos.size(); ++i) {
      PatchInfo info = t.groups[g].infos[i];
      if (info.bump != no_bump) info.bump += static_cast<std::uint32_t>(bump);
      patches.infos[net + i] = info;
    }
  });
  for (double r : radius) patches.radius = std::max(patches.radius, r);
  return patches;
}

template <class T>
PatchBuffer<T> round_patches(const PatchBuffer<double>& patches,
                             std::span<const std::uint32_t> order) {
  PatchBuffer<T> rounded;
  rounded.origin = patches.origin;
  rounded.radius = patches.radius;
  rounded.nets.resize(patches.size());
  rounded.infos.resize(patches.size());
  rounded.bumps.reserve(patches.bumps.size());
  for (std::size_t i = 0; i < patches.size(); ++i) {
    const std::size_t from = order.empty() ? i : order[i];
    const double* net = patches.nets[from].c[0];
    std::transform(net, net + 48, rounded.nets[i].c[0], [](double x) { return T(x); });
    PatchInfo info = patches.infos[from];
    if (info.bump != no_bump) {
      const double* bump = patches.bumps[info.bump].c[0];
      info.bump = static_cast<std::uint32_t>(rounded.bumps.size());
      PatchBump<T>& to = rounded.bumps.emplace_back();
      std::transform(bump, bump + 12, to.c[0], [](double x) { return T(x); });
    }
    rounded.infos[i] = info;
  }
  return rounded;
}

template PatchBuffer<float> round_patches(const PatchBuffer<double>&,
                                          std::span<const std::uint32_t>);
template PatchBuffer<double> round_patches(const PatchBuffer<double>&,
                                           std::span<const std::uint32_t>);

}  // namespace limitray
