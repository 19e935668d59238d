// Engine: a scene in memory, the poses of its bodies, and jobs that answer batched queries.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/counters.h"
#include "engine/certificate/certificate.h"
#include "engine/cost/query_cost.h"
#include "engine/pose/body_pose.h"
#include "engine/query/job.h"
#include "engine/scene/scene.h"
#include "engine/selection/query.h"

namespace clearance {
class CoverStore;       // engine/cover/cover_store.h
class JointTableStore;  // engine/joint_table/joint_table_store.h
class DevicePlan;       // engine/device/query/device_plan.h
}  // namespace clearance

namespace clearance::engine {

/// When covers are made (engine/cover/cover.h), which speed up answers. An answer without them may be another proved
/// interval within the tolerance, or unresolved.
enum class Covers : std::uint8_t {
  kBackground,  ///< on a thread of lowest priority, after the engine is ready
  kOff,
};
/// The value of this name, "background" or "off". Throws std::invalid_argument.
Covers covers_named(std::string_view name);
/// Bodies whose shapes get a cover, one of each shape, the most important ones first: links of robots, then at most 64
/// shapes of other bodies that may move.
std::vector<std::uint32_t> bodies_to_cover(const Scene& scene);

/// Thread-safe. Poses may be set while jobs run, and each job uses one snapshot.
class Engine {
 public:
  struct Options {
    std::string backend = "auto";  ///< "auto", "cpu", "cuda", or "reference" (brute force, the fast path's oracle)
    int threads = 0;               ///< 0 for all cores
    /// Limit on how far a stamp may be ahead of this machine's clock (TAI is 37 s ahead of UTC). A stamp far ahead by
    /// mistake would remain the newest forever.
    std::chrono::nanoseconds max_stamp_lead = std::chrono::seconds(60);
    /// SIMD instruction set of the CPU: "auto", "avx512", "avx2", "baseline". Answers do not depend on it, only speed
    /// does.
    std::string instruction_set = "auto";
    /// Search of reductions for near pairs: "auto", "brute" (every pair's boxes), "tree". Only speed depends on it.
    std::string broad_phase = "auto";
    std::uint64_t max_rows = std::uint64_t{1} << 28;  ///< larger answers are rejected
    std::uint64_t device_memory = 0;                  ///< limit on each device's memory, in bytes; 0 for all of it
    /// Whether the CPU answers a query when the device fails, lacks memory or does not support it. If not, such queries
    /// are rejected (kNotSupported, with the reason).
    bool device_fallback = true;
    /// CUDA devices of backends cuda and auto, by number; empty for the calling thread's current device. Each holds the
    /// scene, and queries are distributed over them. Answers do not depend on their number.
    std::vector<int> devices{};
    /// Whether instruction sets and devices that fail the self-test (engine/narrow/self_test.h) are rejected. Tests of
    /// wrong builds turn it off.
    bool self_test = true;
    Covers covers = Covers::kBackground;
    /// The store of another engine, cover_store(), to which this engine adds its covers; by default a new one.
    std::shared_ptr<CoverStore> cover_store = {};
    std::shared_ptr<JointTableStore> joint_table_store = {};  ///< likewise, joint_table_store()
  };

  /// Throws std::invalid_argument for an unknown backend, instruction set or broad phase, and for a repeated device.
  /// Throws std::runtime_error for an absent backend or device, for one that failed the self-test, for a device without
  /// memory for the scene if there is no fallback, and if all instruction sets failed the self-test.
  explicit Engine(Scene scene) : Engine(std::move(scene), Options()) {}
  Engine(Scene scene, const Options& options);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  const Scene& scene() const;
  std::uint64_t scene_revision() const;  ///< Scene::revision()
  std::string_view backend() const;      ///< name of the backend in use; with "auto", each reply names its own
  /// Last error of the device, or empty.
  std::string device_error() const;
  static std::vector<std::string> backends();  ///< available on this machine
  std::string_view instruction_set() const;    ///< name of the one in use
  /// Instruction sets that this machine has and that pass the self-test, fastest first.
  static std::vector<std::string> instruction_sets();

  /// Applies a batch of poses atomically. If it throws QueryError, nothing is applied: for a stamp that check_stamp()
  /// rejects, and for a stamp older than the publisher's last one for one of the bodies, as in a late or repeated
  /// update. A clock that restarts needs another publisher number; an update without a stamp also resets it for its
  /// bodies.
  /// \param stamp_ns the publisher's clock, or 0
  /// \param sequence the publisher's count of its updates, or 0
  /// \param publisher any number that distinguishes publishers
  PoseUpdateResult set_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns = 0, std::int64_t sequence = 0,
                             std::uint64_t publisher = 0);
  /// Applies joint positions, and so the poses of links, as set_poses() does. Throws QueryError also for a repeated
  /// joint. A position that is not finite or beyond 1e6 is stored as bad: its links are kBadPose until a good one is
  /// received.
  PoseUpdateResult set_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns = 0,
                              std::int64_t sequence = 0, std::uint64_t publisher = 0);
  /// Replaces all points of a cloud (Scene::add_points()) at once. Their tree is built on the calling thread while jobs
  /// and poses go on. `applied` of the result counts points. If it throws QueryError, nothing is replaced: for another
  /// body, a coordinate that is not finite or beyond 1e9 m, a bad radius, and stamps as in set_poses().
  /// \param points (N, 3) metres, in the body's frame; may be empty
  /// \param radius of each point, in metres; by default that of the scene
  PoseUpdateResult set_points(std::uint32_t body, std::span<const CloudPoint> points, std::optional<double> radius = {},
                              std::int64_t stamp_ns = 0, std::int64_t sequence = 0, std::uint64_t publisher = 0);
  JointState joint_state(std::uint32_t joint) const;
  /// Throws QueryError for a stamp below 0, or ahead of this machine's clock (UTC) by more than
  /// Options::max_stamp_lead.
  void check_stamp(std::int64_t stamp_ns) const;
  /// Makes `child` follow `parent` from its present pose, or with `X_pc` if given. With kNone as parent, it becomes
  /// free where it is. Throws QueryError for an unknown body, a cycle, a static child, or a body without a usable pose.
  /// \param allow bodies and groups (selectors) whose pairs with the child are ignored while it is attached
  PoseUpdateResult attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc = nullptr,
                          std::span<const std::uint32_t> allow = {});
  /// Ignores the pairs of two bodies or groups (selectors), or enables them again, except those of a parent and its
  /// child. `applied` of the result counts changed pairs. Throws QueryError for an unknown selector, and for more pairs
  /// than IgnoredPairs::kMostAdded.
  PoseUpdateResult allow(std::uint32_t a, std::uint32_t b, bool allow = true);
  /// Whether body ids and group selectors of an older scene revision mean the same now. False for an unknown revision.
  /// \param with_parents also compares the bodies' parents, to which their poses are relative
  bool ids_valid_since(std::uint64_t scene_revision, std::span<const std::uint32_t> selectors, bool with_parents) const;
  /// The same for their names alone: a replaced shape does not count, and neither do bodies in a selector of all.
  bool names_valid_since(std::uint64_t scene_revision, std::span<const std::uint32_t> selectors,
                         bool with_parents) const;
  /// Whether joint ids of an older scene revision mean the same now, with the same limits.
  bool joints_still_mean(std::uint64_t scene_revision, std::span<const std::uint32_t> joints) const;
  /// Takes over the received poses, joint positions and attachments of another engine for bodies with the same names,
  /// as a daemon does that reloads its scene. Other bodies keep the state of this scene.
  /// \param reshaped body whose shape was replaced, so that points received for it are dropped; or empty
  void take_poses(const Engine& old, std::string_view reshaped = {});
  /// Makes updates of poses, joints, points, attachments and allowed pairs throw UpdatesStopped, or accepts them again.
  /// Nothing can then be lost while another engine takes over.
  void stop_updates(bool stop);
  BodyState body_state(std::uint32_t body) const;
  /// Oldest stamp of the poses of a body or group (selector). Unstamped bodies are ignored; 0 if none is stamped.
  /// Throws QueryError for an unknown body or group.
  std::int64_t oldest_stamp(std::uint32_t bodies) const;
  std::uint64_t pose_revision() const;

  /// The size of the answer. Throws QueryError.
  QuerySize size(const QueryView& query) const;
  /// The pairs of a query, in order. Throws QueryError, also for more than Options::max_rows.
  std::vector<BodyPair> pairs(const QueryView& query) const;
  /// For each configuration of a query in joint space, the largest s proved to keep all pairs beyond their margins
  /// while no joint moves by more than s times its weight (radians or metres). It is 0 if a pair is not proved to be
  /// beyond its margin, and +inf if no pair can come nearer. Joint limits are ignored. Margins are those of
  /// Reduce::kAny; reduction and fields are ignored. Runs on the CPU until done. Throws QueryError, also for
  /// bodies in the query, for robots that stand on links that its joints move, and for bodies with a max_speed that
  /// follow links.
  /// \param weights (J,) >= 0
  std::vector<double> free_scale(const QueryView& query, std::span<const double> weights) const;
  /// Begins a query on the newest snapshot, and copies its data as needed. Throws QueryError.
  Job start(const QueryView& query, const ReplyView& reply) const;
  /// Prepares a query, so that the size of its answer is known before start(), until when the data of `query` must
  /// stay. Both throw QueryError.
  /// \param pool of earlier jobs of this query with other configurations, and for its next one; may be null
  PreparedQuery prepare(const QueryView& query, const std::shared_ptr<JobPool>& pool = nullptr) const;
  /// Whether prepare() repeats a job of the pool, which may be null, so that the query is valid with any inputs that fit.
  bool has_job(const QueryView& query, const std::shared_ptr<JobPool>& pool) const;
  /// Checks a query as prepare() does, without its configurations. Throws QueryError.
  /// \param pool keeps its pairs for prepare(); may be null
  void plan_ahead(const QueryView& query, const std::shared_ptr<JobPool>& pool) const;
  /// Prepares a query in slices. The caller calls PreparedQuery::advance().
  PreparedQuery begin_preparing(const QueryView& query, const std::shared_ptr<JobPool>& pool = nullptr) const;
  Job start(PreparedQuery query, const ReplyView& reply) const;
  /// Answers a query at once by a job that has answered it with other configurations, in less time than by a pool.
  /// Returns false, and does nothing, unless the job is of as many configurations and of the current poses. Throws
  /// QueryError.
  /// \param job of this engine, after Job::rest()
  bool answer_again(Job& job, const QueryView& query, const ReplyView& reply) const;
  /// Bound on the memory that its job takes for lists of pairs, beyond PreparedQuery::bytes().
  std::uint64_t list_bytes(const PreparedQuery& query) const;

  /// A query that a device answers from poses and joint positions in its memory to rows in its memory (docs/cuda.md),
  /// with Reduce::kNone, kMin or kAny. Throws QueryError that names an unsupported feature: other reductions, motions,
  /// depths, bodies with a max_speed, limits on the age of poses, surfaces.
  /// \param query its configurations are ignored; each run gives its own
  std::unique_ptr<DevicePlan> plan_on_device(const QueryView& query) const;

  /// Evaluates rows of a query without reduction on the newest snapshot, as a job on the CPU does. Returns their
  /// answers with proofs of their bounds: a JSON document that tools/check_certificate.py checks independently
  /// (docs/trust/certificates.md). Takes ten times as long as the rows do. Throws QueryError, also for an unknown row.
  /// \param rows numbers in any order; by default all
  std::string certificate(const QueryView& query, std::optional<std::span<const std::uint64_t>> rows = {}) const;
  /// Makes a certificate in slices. The engine and the data of `query` must outlive it.
  CertificateRun begin_certificate(const QueryView& query, CertificateRows rows) const;

  /// Waits until all covers are made, and returns whether they are. The calling thread makes covers, too, so it may take
  /// about a second longer than the timeout. With Covers::kOff, there is nothing to wait for.
  bool wait_covers(std::chrono::nanoseconds timeout) const;
  /// The covers, for an engine of a changed scene; null with Covers::kOff.
  const std::shared_ptr<CoverStore>& cover_store() const;
  const std::shared_ptr<JointTableStore>& joint_table_store() const;

  /// Upper bound on the cost of a query (SceneCost::of()).
  QueryCost cost(const QueryView& query) const;
  /// Whether the CPU may answer queries: false if backend cuda was requested.
  bool has_cpu() const;

  Counters stats() const;
  /// Number of part pairs whose bounds contradicted each other and were recomputed by the most independent method. It
  /// is 0 unless the machine, the build or a table is broken.
  std::uint64_t contradictions() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance::engine
