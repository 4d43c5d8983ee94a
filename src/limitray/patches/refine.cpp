// Stage: patches (S0). See refine.h. The only file that includes OpenSubdiv.
//
// Groups of faces are refined in parallel; what is kept of each refinement is a PatchRecipe.
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
#include <optional>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "limitray/patches/face_groups.h"
#include "limitray/patches/memory_budget.h"
#include "limitray/patches/recorded_stencils.h"
#include "limitray/patches/write_nets.h"

namespace limitray {
namespace {

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

using RefinerFactory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
using FarRefiner = std::unique_ptr<Far::TopologyRefiner>;
using FarTable = std::unique_ptr<const Far::PatchTable>;

constexpr int deepest_level = 10;  // OpenSubdiv's limit

// The base topology.

/// In the order of FaceVaryingLinearInterpolation.
constexpr Sdc::Options::FVarLinearInterpolation face_varying_rules[] = {
    Sdc::Options::FVAR_LINEAR_NONE,          Sdc::Options::FVAR_LINEAR_CORNERS_ONLY,
    Sdc::Options::FVAR_LINEAR_CORNERS_PLUS1, Sdc::Options::FVAR_LINEAR_CORNERS_PLUS2,
    Sdc::Options::FVAR_LINEAR_BOUNDARIES,    Sdc::Options::FVAR_LINEAR_ALL};

Sdc::Options scheme_options(const ControlCage& cage) {
  Sdc::Options options;
  // The rule `none` only takes faces away, which FaceGroups has done.
  options.SetVtxBoundaryInterpolation(cage.interpolate_boundary ==
                                              InterpolateBoundary::edge_and_corner
                                          ? Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER
                                          : Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
  options.SetCreasingMethod(cage.creasing_method == CreasingMethod::chaikin
                                ? Sdc::Options::CREASE_CHAIKIN
                                : Sdc::Options::CREASE_UNIFORM);
  options.SetTriangleSubdivision(cage.triangle_subdivision_rule == TriangleSubdivisionRule::smooth
                                     ? Sdc::Options::TRI_SUB_SMOOTH
                                     : Sdc::Options::TRI_SUB_CATMARK);
  options.SetFVarLinearInterpolation(
      face_varying_rules[static_cast<int>(cage.face_varying_linear_interpolation)]);
  return options;
}

/// The values of a face-varying primvar at the corners of a group, with a numbering of their own.
struct GroupValues {
  std::vector<std::int32_t> rows;     // of the primvar's values, one a value of the group
  std::vector<std::int32_t> indices;  // into rows, one a corner of the group

  GroupValues(const FaceGroup& group, const Primvar& primvar) {
    std::unordered_map<std::int32_t, std::int32_t> numbers;
    for (const std::int32_t corner : group.corners) {
      const std::int32_t row = primvar.indices[corner];
      const auto number = static_cast<std::int32_t>(rows.size());
      const auto [it, is_new] = numbers.try_emplace(row, number);
      if (is_new) rows.push_back(row);
      indices.push_back(it->second);
    }
  }
};

/// With `values` as a face-varying channel, unless null.
FarRefiner make_base(const FaceGroup& group, const GroupValues* values,
                     const Sdc::Options& scheme) {
  Far::TopologyDescriptor d;
  d.numVertices = static_cast<int>(group.vertices.size());
  d.numFaces = static_cast<int>(group.faces.size());
  d.numVertsPerFace = group.face_vertex_counts.data();
  d.vertIndicesPerFace = group.face_vertex_indices.data();
  d.numCreases = static_cast<int>(group.crease_sharpnesses.size());
  d.creaseVertexIndexPairs = group.crease_pairs.data();
  d.creaseWeights = group.crease_sharpnesses.data();
  d.numCorners = static_cast<int>(group.corner_indices.size());
  d.cornerVertexIndices = group.corner_indices.data();
  d.cornerWeights = group.corner_sharpnesses.data();

  Far::TopologyDescriptor::FVarChannel channel;
  if (values) {
    channel.numValues = static_cast<int>(values->rows.size());
    channel.valueIndices = values->indices.data();
    d.numFVarChannels = 1;
    d.fvarChannels = &channel;
  }

  FarRefiner base(RefinerFactory::Create(d, {Sdc::SCHEME_CATMARK, scheme}));
  if (!base)
    throw std::invalid_argument("cage: faces and vertices must have less than " +
                                std::to_string(OpenSubdiv::Vtr::VALENCE_LIMIT) + " neighbours");
  return base;
}

/// Base face and corner of each ptex face.
struct PtexFaces {
  std::vector<std::uint32_t> face;
  std::vector<std::uint16_t> sub_quad;

  explicit PtexFaces(const FaceGroup& group) {
    for (std::size_t f = 0; f < group.faces.size(); ++f) {
      const int n = group.face_vertex_counts[f];
      for (int corner = 0; corner < (n == 4 ? 1 : n); ++corner) {
        face.push_back(static_cast<std::uint32_t>(group.faces[f]));
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

/// Semi-sharp features must be followed until they have decayed, or the surface is not exact.
/// Smooth features end where asked, if no face with a smooth irregular vertex can still have a
/// semi-sharp feature (it would be refined further, its neighbour not, and the two would not meet).
/// That holds from level 2 on, at level 1 the centre of an n-gon may be beside a semi-sharp edge
/// point; but with Chaikin's rule a crease may decay at the vertex before it does beside it.
Levels levels_for(const ControlCage& cage, int isolation_level) {
  float largest = 0;
  for (const std::vector<float>* sharpnesses : {&cage.crease_sharpnesses, &cage.corner_sharpnesses})
    for (float s : *sharpnesses)
      if (s < infinite_sharpness) largest = std::max(largest, s);
  if (largest <= 0) return {isolation_level, isolation_level};
  const int smooth = std::max(isolation_level, 2);
  const int sharp = std::max(smooth, static_cast<int>(std::ceil(largest)));
  return {cage.creasing_method == CreasingMethod::chaikin ? sharp : smooth, sharp};
}

// One group of faces: from OpenSubdiv's refinement to a recipe.

/// A refined group and its patches. The points are vertices, or the values of the face-varying
/// channel: OpenSubdiv keeps the same tables of both.
struct RefinedGroup {
  FarRefiner refiner;
  FarTable table;
  bool face_varying;

  int point_count(int level) const {
    const Far::TopologyLevel& l = refiner->GetLevel(level);
    return face_varying ? l.GetNumFVarValues() : l.GetNumVertices();
  }
  /// Over all levels; Gregory points come after them.
  int refined_count() const {
    return face_varying ? refiner->GetNumFVarValuesTotal() : refiner->GetNumVerticesTotal();
  }
  int local_count() const {
    return face_varying ? table->GetNumLocalPointsFaceVarying() : table->GetNumLocalPoints();
  }
  const Far::StencilTableReal<double>* local_stencils() const {
    return face_varying ? table->GetLocalPointFaceVaryingStencilTable<double>()
                        : table->GetLocalPointStencilTable<double>();
  }
  Far::PatchParam param(int array, int i) const {
    return face_varying ? table->GetPatchFVarPatchParam(array, i) : table->GetPatchParam(array, i);
  }
  /// The 16 points of a regular patch, the 20 of a Gregory patch.
  Far::ConstIndexArray points(int array, int i) const {
    const Far::ConstIndexArray all =
        face_varying ? table->GetPatchFVarValues(array, i) : table->GetPatchVertices(array, i);
    return {all.begin(), param(array, i).IsRegular() ? 16 : 20};
  }
  /// Of the one crease edge of a regular patch; 0 for none.
  float crease_sharpness(int array, int i) const {
    return face_varying ? 0 : table->GetSingleCreasePatchSharpnessValue(array, i);
  }
  template <class Visit>
  void for_each_patch(const Visit& visit) const {
    for (int array = 0; array < table->GetNumPatchArrays(); ++array)
      for (int i = 0; i < table->GetNumPatches(array); ++i) visit(array, i);
  }
};

RecordedStencils record_refinement(const RefinedGroup& group) {
  RecordedStencils list;
  const Far::PrimvarRefinerReal<double> primvars(*group.refiner);
  int offset = 0;
  for (int level = 1; level < group.refiner->GetNumLevels(); ++level) {
    const RecordedStencils::Level source{&list, offset};
    offset += group.point_count(level - 1);
    RecordedStencils::Level target{&list, offset};
    if (group.face_varying)
      primvars.InterpolateFaceVarying(level, source, target);
    else
      primvars.Interpolate(level, source, target);
  }
  list.begin.push_back(static_cast<int>(list.sources.size()));
  return list;
}

class RecipeBuilder {
 public:
  /// `points` are the control points of the group: its vertices, or rows of the primvar's values.
  RecipeBuilder(const RefinedGroup& group, const FaceGroup& faces,
                const std::vector<std::int32_t>& points)
      : group_(group),
        ptex_(faces),
        numbers_(recipe_.control_points, points, group.refined_count() + group.local_count()) {}

  PatchRecipe build() {
    add_stencils();
    for (const bool regular : {true, false})  // the order of a recipe
      group_.for_each_patch([&](int array, int i) {
        if (group_.param(array, i).IsRegular() == regular) add_patch(array, i);
      });
    return std::move(recipe_);
  }

 private:
  void add_stencils() {
    const RecordedStencils refined = record_refinement(group_);
    const auto* local = group_.local_stencils();
    for (int source : refined.sources) numbers_.use(source);
    if (local)
      for (int source : local->GetControlIndices()) numbers_.use(source);
    group_.for_each_patch([&](int array, int i) {
      for (int source : group_.points(array, i)) numbers_.use(source);
    });

    for (std::size_t i = 0; i < refined.target.size(); ++i) {
      const int begin = refined.begin[i], end = refined.begin[i + 1];
      add_stencil(refined.target[i], refined.sources.data() + begin, refined.weights.data() + begin,
                  end - begin);
    }
    if (local) add_local_points(*local);
    recipe_.stencils.finish();
  }

  void add_local_points(const Far::StencilTableReal<double>& local) {
    int target = group_.refined_count();
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
    numbers_.define(target, recipe_.control_points.size() + recipe_.stencils.size());
    recipe_.stencils.add(sources_, {weights, static_cast<std::size_t>(size)});
  }

  void add_patch(int array, int i) {
    const Far::ConstIndexArray points = group_.points(array, i);
    const Far::PatchParam param = group_.param(array, i);
    PatchInfo info = patch_info(param);
    if (param.IsRegular()) {
      add_regular(points, param.GetBoundary(), group_.crease_sharpness(array, i), info);
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
    RegularPatch patch{{}, edges, no_piece};
    for (int k = 0; k < 16; ++k) patch.points[k] = numbers_[points[k]];
    if (sharpness <= 0) {
      recipe_.regular.push_back(patch);
      recipe_.infos.push_back(info);
      return;
    }
    const auto [first, count] = find_crease(sharpness);
    for (std::uint32_t piece = first; piece < first + count; ++piece) {
      patch.piece = piece;
      recipe_.regular.push_back(patch);
      recipe_.infos.push_back(piece_info(info, edges, recipe_.pieces[piece]));
    }
  }

  /// The pieces for a sharpness in recipe_.pieces.
  struct PieceRange {
    std::uint32_t first, count;
  };
  PieceRange find_crease(float sharpness) {
    const auto [it, is_new] = creases_.try_emplace(sharpness);
    if (is_new) {
      const std::vector<CreasePiece> pieces = crease_pieces(sharpness);
      it->second = {static_cast<std::uint32_t>(recipe_.pieces.size()),
                    static_cast<std::uint32_t>(pieces.size())};
      recipe_.pieces.insert(recipe_.pieces.end(), pieces.begin(), pieces.end());
    }
    return it->second;
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

  const RefinedGroup& group_;
  const PtexFaces ptex_;
  PatchRecipe recipe_;
  PointNumbers numbers_;
  std::vector<std::int32_t> sources_;
  std::unordered_map<float, PieceRange> creases_;  // by sharpness
};

Far::ConstIndexArray far_array(const std::vector<std::int32_t>& indices) {
  return {indices.data(), static_cast<int>(indices.size())};
}

/// Of the positions, or of `face_varying` unless null.
PatchRecipe refine_group(const FaceGroup& group, const Primvar* face_varying,
                         const Sdc::Options& scheme, Levels levels) {
  Far::PatchTableFactory::Options options(levels.sharp);
  options.useSingleCreasePatch = !face_varying;  // OpenSubdiv has no face-varying ones
  options.useInfSharpPatch = true;
  options.generateLegacySharpCornerPatches = false;
  options.generateFVarLegacyLinearPatches = false;
  options.generateVaryingTables = false;
  options.generateFVarTables = face_varying != nullptr;
  options.SetPatchPrecision<double>();
  options.SetFVarPatchPrecision<double>();
  options.SetEndCapType(Far::PatchTableFactory::Options::ENDCAP_GREGORY_BASIS);
  Far::TopologyRefiner::AdaptiveOptions adaptive = options.GetRefineAdaptiveOptions();
  adaptive.SetSecondaryLevel(levels.smooth);

  std::optional<GroupValues> values;
  if (face_varying) values.emplace(group, *face_varying);
  FarRefiner refiner = make_base(group, values ? &*values : nullptr, scheme);
  refiner->RefineAdaptive(adaptive, far_array(group.refined_faces));
  FarTable table(Far::PatchTableFactory::Create(*refiner, options, far_array(group.own_faces)));
  const RefinedGroup refined{std::move(refiner), std::move(table), face_varying != nullptr};
  return RecipeBuilder(refined, group, values ? values->rows : group.vertices).build();
}

/// Of the positions, or of `face_varying` unless null.
std::vector<PatchRecipe> make_recipes(const ControlCage& cage, const Primvar* face_varying,
                                      const RefineOptions& options) {
  if (options.isolation_level < 1 || options.isolation_level > deepest_level)
    throw std::invalid_argument("isolation_level: must be 1 to 10, got " +
                                std::to_string(options.isolation_level));
  const Levels levels = levels_for(cage, options.isolation_level);
  const FaceGroups groups(cage, levels.sharp);
  const Sdc::Options scheme = scheme_options(cage);
  MemoryBudget budget(options.memory_limit, groups.size(), options.isolation_level);
  std::vector<PatchRecipe> recipes(groups.size());
  tbb::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t i) {
    if (options.stop) options.stop();
    recipes[i] = refine_group(groups.make(i), face_varying, scheme, levels);
    budget.add(recipes[i]);
  });
  return recipes;
}

}  // namespace

struct Refiner::Topology {
  std::size_t point_count;
  std::vector<PatchRecipe> recipes;
};

Refiner::Refiner(const ControlCage& cage, const RefineOptions& options)
    : topology_(new Topology{cage.points.size(), make_recipes(cage, nullptr, options)}) {}

Refiner::Refiner(const ControlCage& cage, const Primvar& face_varying, const RefineOptions& options)
    : topology_(new Topology{face_varying.values.size() / face_varying.width,
                             make_recipes(cage, &face_varying, options)}) {}

Refiner::~Refiner() = default;
Refiner::Refiner(Refiner&&) noexcept = default;
Refiner& Refiner::operator=(Refiner&&) noexcept = default;

PatchExtent Refiner::write_patches(std::span<const Vec3d> points, const BlockWriter& write,
                                   const std::function<void()>& stop) const {
  if (points.size() != topology_->point_count)
    throw std::invalid_argument("points: must be as many as the cage has, " +
                                std::to_string(topology_->point_count) + ", got " +
                                std::to_string(points.size()));
  const Vec3d origin = centre(topology_->recipes, points);
  return {origin, run_recipes(topology_->recipes, points, origin, write, stop)};
}

template <class T>
PatchBuffer<T> Refiner::unwritten_patches() const {
  PatchBuffer<T> patches;
  patches.infos = infos_of(topology_->recipes);
  patches.nets.resize(patches.infos.size());
  std::size_t bumps = 0;
  for (const PatchRecipe& recipe : topology_->recipes) bumps += recipe.gregory.size();
  patches.bumps.resize(bumps);
  return patches;
}
template PatchBuffer<float> Refiner::unwritten_patches() const;
template PatchBuffer<double> Refiner::unwritten_patches() const;

void Refiner::sort_patches(std::span<std::uint32_t> place) {
  std::vector<PatchRecipe>& recipes = topology_->recipes;
  std::vector<std::size_t> first{0};
  for (const PatchRecipe& recipe : recipes) first.push_back(first.back() + recipe.size());
  tbb::parallel_for(std::size_t{0}, recipes.size(), [&](std::size_t r) {
    recipes[r].sort_patches(place.subspan(first[r], recipes[r].size()));
  });
}

PatchBuffer<double> Refiner::make_patches(std::span<const Vec3d> points) const {
  auto patches = unwritten_patches<double>();
  const NetPlaces<double> places{patches.nets.data(), patches.bumps.data(), patches.infos.data(),
                                 nullptr};
  const PatchExtent extent =
      write_patches(points, [&](const PatchBlock& block) { return write_nets(block, places); });
  patches.origin = extent.origin;
  patches.radius = extent.radius;
  return patches;
}

}  // namespace limitray
