// Stage: scene. Comes in: cages and rays. Goes out: hits. The one class C++ users need.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "limitray/cage/cage.h"
#include "limitray/patches/patch_buffer.h"

namespace limitray {

/// A batch of n rays. Row i of `rays` is origin (3), direction (3); t is in units of |direction|.
/// `tnear` (exclusive) and `tfar` (inclusive) hold one value a ray, or one for all.
template <class T>
struct RayBatch {
  std::span<const T> rays;   // 6 n values
  std::span<const T> tnear;  // n values or 1
  std::span<const T> tfar;   // n values or 1

  std::size_t size() const { return rays.size() / 6; }
};

/// Where to write the answers; a null pointer means not wanted. Ray i writes row i. A miss writes
/// t = inf, ids = 0xFFFFFFFF, zeros elsewhere.
template <class T>
struct HitArrays {
  T* t = nullptr;                         // n
  T* t_error = nullptr;                   // n: bound on |t - t of the surface|
  std::uint32_t* geometry_id = nullptr;   // n: as returned by add_mesh / add_instance
  std::uint32_t* primitive_id = nullptr;  // n: base face
  std::uint32_t* sub_quad = nullptr;      // n: corner of an n-gon, 0 for quads
  std::uint32_t* patch_id = nullptr;      // n: patch of the geometry
  T* uv = nullptr;                        // 2 n: (u,v) in the base face or its sub-quad
  T* normal = nullptr;                    // 3 n: unit, on the side given by the face winding
  T* point = nullptr;                     // 3 n: the surface at (u,v)
  T* dp_du = nullptr;                     // 3 n
  T* dp_dv = nullptr;                     // 3 n
};

/// Work done since the scene was made or reset_statistics was called.
struct Statistics {
  std::uint64_t rays = 0, node_visits = 0, patch_tests = 0, early_outs = 0, splits = 0,
                backtracks = 0, newton_runs = 0, newton_steps = 0, unresolved = 0;
};

/// What `info` prints about one mesh of the scene.
struct MeshStatistics {
  std::size_t patches = 0, gregory_patches = 0;
  std::vector<std::size_t> patches_by_level;
  std::size_t patch_bytes = 0, bvh_bytes = 0;
  double build_seconds = 0;
  int isolation_level = 0;  // as given or chosen
  /// Estimated bound on the distance of the surface from the true limit, in units of the longest
  /// side of the box around the cage: what Gregory patches at extraordinary vertices leave.
  double limit_error = 0;
};

/// Lets a caller watch and stop a long call from another thread.
struct Progress {
  std::atomic<std::uint64_t> done{0};  // rays finished
  std::atomic<bool> cancel{false};     // set: the call returns soon, throwing Cancelled
};
struct Cancelled : std::exception {
  const char* what() const noexcept override { return "cancelled"; }
};

/// Tolerance of a mesh for which nothing is asked.
inline constexpr double default_tolerance = 1e-5;

struct MeshOptions {
  /// How deep irregular features are isolated, 1 to 10; 0: as deep as `tolerance` needs.
  int isolation_level = 0;
  Affine transform{};
  /// Above 0: MeshStatistics::limit_error is at most this where a level from 2 to 6 (to 10 for less
  /// than the default) can reach it.
  double tolerance = default_tolerance;
  /// Bytes that the mesh may need while it is made; 0: what the machine has free.
  std::size_t memory_limit = 0;
};

/// n places on surfaces, one row each: a hit's ids and parameters. Id 0xFFFFFFFF: nowhere.
struct SurfacePlaces {
  std::span<const std::uint32_t> geometry_ids, faces, sub_quads;
  std::span<const double> uv;  // 2 n
};

/// All intersections along rays: row `offsets[i]` to `offsets[i+1]` belong to ray i, sorted by t.
struct IntersectionList {
  std::vector<std::uint64_t> offsets;
  std::vector<double> t, uv, normal;
  std::vector<std::uint32_t> geometry_id, primitive_id, sub_quad;
};

struct BvhNode;

/// What the tracer reads of one mesh, for tracers elsewhere (a GPU): views into the scene, valid
/// until it is changed. Patches are in the order of the tree's leaves; all is relative to `center`.
struct MeshData {
  std::span<const PatchNet<float>> nets;
  std::span<const PatchBump<float>> bumps;
  std::span<const PatchInfo> infos;
  std::span<const PatchModel<float>> models;
  std::span<const std::uint32_t> patch_ids;  // leaf -> patch id
  const BvhNode* nodes = nullptr;            // null for an empty surface
  std::size_t node_count = 0;
  Vec3d center{}, half{};  // half of the size of a box about `center` that contains the mesh
  double radius = 0;       // largest |control value| or |corner of a box| of any axis
  bool left_handed = false;
};
/// One placement of a mesh.
struct InstanceData {
  std::uint32_t mesh = 0;  // as counted by mesh_count
  bool identity = true;
  Affine to_object{}, to_world{};
};
/// The tree over the instances, boxes relative to `center`; no nodes for less than two instances.
struct TopData {
  const BvhNode* nodes = nullptr;
  std::size_t node_count = 0;
  Vec3d center{}, half{};
  double radius = 0;
};

class Scene {
 public:
  /// threads: 0 (all cores) to 4096.
  explicit Scene(int threads = 0);
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  /// Adds a cage (validated here; throws std::invalid_argument). Returns its geometry id. Throws
  /// OutOfMemory (memory.h) if its patches need more than there is; after any exception the scene
  /// is as it was.
  std::uint32_t add_mesh(ControlCage cage, const MeshOptions& options = {},
                         Progress* progress = nullptr);
  /// Adds geometry `geometry_id` again under another transform; costs no patches.
  std::uint32_t add_instance(std::uint32_t geometry_id, const Affine& transform);
  /// Takes back what was added last, until `count` geometries are left; does nothing if there are
  /// no more.
  void truncate(std::size_t count) noexcept;
  /// Moves the control points of a mesh; topology stays, and so does the shape of its tree. Throws
  /// std::invalid_argument for a wrong number or size; after any exception the scene is as it was.
  void update_points(std::uint32_t geometry_id, std::span<const Vec3d> points);

  /// Closest hits. T = float runs the SIMD path, T = double the oracle's arithmetic. Float rays of
  /// a call are traced together, so one call with 10^4 rays or more is almost twice as fast as many
  /// with a few hundred; their order does not matter.
  template <class T>
  void cast_rays(const RayBatch<T>& rays, const HitArrays<T>& hits,
                 Progress* progress = nullptr) const;
  /// Any hit: occluded[i] = 1 or 0.
  template <class T>
  void test_occlusions(const RayBatch<T>& rays, std::uint8_t* occluded,
                       Progress* progress = nullptr) const;
  /// Number of intersections along each ray (always in double).
  void count_intersections(const RayBatch<double>& rays, std::uint32_t* counts,
                           Progress* progress = nullptr) const;
  /// All intersections along each ray (always in double).
  IntersectionList list_intersections(const RayBatch<double>& rays,
                                      Progress* progress = nullptr) const;

  /// Components of the primvar `name`, 0 if no mesh has it. Throws std::invalid_argument if two
  /// have it with different widths.
  int primvar_width(const std::string& name) const;
  /// The primvar `name` and its derivatives by u and v, each n x primvar_width(name): 0 nowhere,
  /// NaN where the mesh lacks it. The first call for a mesh makes its patches. Throws
  /// std::invalid_argument for ids out of range, and where primvar_width does.
  void evaluate_primvar(const std::string& name, const SurfacePlaces& at, double* values,
                        double* d_du, double* d_dv, Progress* progress = nullptr) const;

  std::size_t geometry_count() const;
  MeshStatistics mesh_statistics(std::uint32_t geometry_id) const;
  /// Meshes without their instances, and the data that a tracer needs.
  std::size_t mesh_count() const;
  MeshData mesh_data(std::size_t mesh) const;
  InstanceData instance_data(std::uint32_t geometry_id) const;
  TopData top_data() const;
  /// Lower and upper corner of everything in the scene; inverted when it is empty.
  std::array<Vec3d, 2> bounds() const;
  Statistics statistics() const;
  void reset_statistics();
  /// Instruction set in use: "avx512", "avx2" or "portable" (environment LIMITRAY_ISA forces one).
  static std::string isa();
  /// S8 on (default) or off: off leaves the pure bisection, the reference it is tested against.
  void set_newton(bool on);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace limitray
