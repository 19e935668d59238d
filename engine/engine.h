// The engine: a scene resident in memory, the poses of its bodies, and jobs that answer batched queries.
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
#include "engine/pose/body_pose.h"
#include "engine/query/job.h"
#include "engine/query/query_cost.h"
#include "engine/scene/scene.h"
#include "engine/selection/query.h"

namespace clearance {

class DevicePlan;  // engine/device/query/device_plan.h

/// Thread-safe: poses may be set while jobs run; each job sees one snapshot.
class Engine {
 public:
  struct Options {
    std::string backend = "auto";  ///< "auto", "cpu", "cuda", or "reference" (brute force, the fast path's oracle)
    int threads = 0;               ///< 0: all cores
    /// A stamp may be so far ahead of this machine's clock (TAI is 37 s ahead of UTC): one that is far ahead by mistake
    /// would be the newest for good.
    std::chrono::nanoseconds max_stamp_lead = std::chrono::seconds(60);
    /// Of the CPU's SIMD lanes: "auto", "avx512", "avx2", "baseline". Only speed depends on it, not one bit of an
    /// answer.
    std::string instruction_set = "auto";
    /// How reductions find near pairs: "auto", "brute" (every pair's boxes), "tree". Only speed depends on it.
    std::string broad_phase = "auto";
    std::uint64_t max_rows = std::uint64_t{1} << 28;     ///< larger answers are refused
    std::uint64_t warm_memory = std::uint64_t{1} << 30;  ///< bytes of warm state on the host, of all clients together
    std::uint64_t device_memory = 0;  ///< bytes of each device's memory that backend cuda may take; 0: what there is
    /// Whether the CPU answers where the device cannot: it failed, or memory does not suffice. If not, such queries are
    /// refused (kNotSupported, with the reason).
    bool device_fallback = true;
    /// CUDA devices of backends cuda and auto, by their numbers; none: the calling thread's current one. Each holds the
    /// scene, and queries are shared out among them; answers do not depend on how many there are.
    std::vector<int> devices{};
    /// Whether what the self-test (engine/narrow/self_test.h) finds wrong is refused. Tests of wrong builds leave it
    /// out.
    bool self_test = true;
  };

  /// Throws std::invalid_argument for an unknown backend, instruction set or broad phase, and for a device named twice;
  /// std::runtime_error for a backend or device that is absent on this machine or, without fallback, has no room for
  /// the scene, for one that the self-test (engine/narrow/self_test.h) found wrong, and where it found all instruction
  /// sets wrong.
  explicit Engine(Scene scene) : Engine(std::move(scene), Options()) {}
  Engine(Scene scene, const Options& options);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  const Scene& scene() const;
  std::uint64_t scene_revision() const;  ///< Scene::revision()
  std::string_view backend() const;      ///< the one in use, by name; "auto": the CPU or the device, as each reply says
  /// What the device said last where it did not answer; empty: there was nothing.
  std::string device_error() const;
  static std::vector<std::string> backends();  ///< those that can be asked for on this machine
  std::string_view instruction_set() const;    ///< the one in use, by name
  /// Those that this machine has and that compute rightly, the fastest first.
  static std::vector<std::string> instruction_sets();

  /// Applies a batch of poses atomically. \param stamp_ns the publisher's clock; 0: it gives none. \param sequence the
  /// publisher's count of its updates; 0: it keeps none. \param publisher any number that tells publishers apart. The
  /// receipt is taken here. Throws QueryError, and nothing is applied, for a stamp that check_stamp() refuses, and for
  /// one before that which the publisher gave last for one of the bodies: an old update that came late, or once more. A
  /// clock that begins anew is another publisher's; an update without a stamp also lets it begin anew for its bodies.
  PoseUpdateResult set_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns = 0, std::int64_t sequence = 0,
                             std::uint64_t publisher = 0);
  /// The same of joints, whose links then have new poses. Throws QueryError also for a joint that is named twice. A
  /// position that is no number, or beyond 1e6, is stored as bad: its links are kBadPose until a good one comes.
  PoseUpdateResult set_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns = 0,
                              std::int64_t sequence = 0, std::uint64_t publisher = 0);
  /// Replaces the points of a body of points (Scene::add_points()), all at once: a job sees all of the old ones or all
  /// of the new. The tree over them is made here, on the calling thread; jobs and poses go on meanwhile. `applied` of
  /// the result counts points. Throws QueryError, and nothing is replaced, for another body, a coordinate that is not
  /// finite or beyond 1e9 m, a bad radius, and stamps as set_poses() does. \param points (N, 3) metres, the body's
  /// frame; none: there is nothing \param radius metres, that they are grown by; none: as the scene has it
  PoseUpdateResult set_points(std::uint32_t body, std::span<const CloudPoint> points, std::optional<double> radius = {},
                              std::int64_t stamp_ns = 0, std::int64_t sequence = 0, std::uint64_t publisher = 0);
  JointState joint_state(std::uint32_t joint) const;
  /// Throws QueryError for a stamp below 0, or ahead of this machine's clock (UTC) by more than
  /// Options::max_stamp_lead.
  void check_stamp(std::int64_t stamp_ns) const;
  /// Makes `child` follow `parent` from where it is now, or with `X_pc` if given; kNone as parent sets it free where it
  /// is. Throws QueryError for an unknown body, a cycle, a static child, or a body without a usable pose.
  /// \param allow bodies and groups (selectors) that the child may touch while it is attached so.
  PoseUpdateResult attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc = nullptr,
                          std::span<const std::uint32_t> allow = {});
  /// Leaves the pairs of a body or group (selectors) with another out of the enabled pairs, or brings them back, but
  /// for those of a parent and its child. `applied` of the result counts pairs that have changed. Throws QueryError for
  /// an unknown selector, and for more pairs than IgnoredPairs::kMostAdded.
  PoseUpdateResult allow(std::uint32_t a, std::uint32_t b, bool allow = true);
  /// Whether body ids and group selectors of an older revision of the scene mean the same in this one. False also for a
  /// revision that is unknown. \param with_parents also that those bodies have the parents that they had, to which
  /// their poses are relative.
  bool ids_valid_since(std::uint64_t scene_revision, std::span<const std::uint32_t> selectors, bool with_parents) const;
  /// The same of joint ids: false also where another robot's joints, or other limits, have those ids now.
  bool joints_still_mean(std::uint64_t scene_revision, std::span<const std::uint32_t> joints) const;
  /// Takes over the poses, joint positions and attachments that another engine has received, for bodies that both know
  /// by name: what a daemon does that loads its scene anew. Other bodies stay as this scene has them.
  void take_poses(const Engine& old);
  BodyState body_state(std::uint32_t body) const;
  /// The oldest stamp of the poses of a body or of a group (selector). Bodies that never had a stamp do not count. 0:
  /// none of them had one. Throws QueryError for an unknown body or group.
  std::int64_t oldest_stamp(std::uint32_t bodies) const;
  std::uint64_t pose_revision() const;

  /// The size of the answer. Throws QueryError.
  QuerySize size(const QueryView& query) const;
  /// The pairs that a query answers, in order. Throws QueryError (also if there are more than Options::max_rows).
  std::vector<BodyPair> pairs(const QueryView& query) const;
  /// How far joints may move: for each configuration of a query in joint space the largest s that is proved to keep all
  /// pairs beyond their margins while no joint moves by more than s times its weight (radians or metres). 0: a pair is
  /// not proved to be beyond its margin now; +inf: nothing that moves can come nearer. Limits are not looked at. The
  /// query's margins are as for Reduce::kAny, its reduction, fields and format say nothing. On the CPU, at once. Throws
  /// QueryError, also for bodies in the query, for robots that stand on links that its joints move, and for bodies with
  /// a max_speed that follow links. \param weights (J,) >= 0
  std::vector<double> free_scale(const QueryView& query, std::span<const double> weights) const;
  /// Begins a query on the newest snapshot. Copies what it needs of `query`; throws QueryError. A small one that asks
  /// the same as an earlier one of the same snapshot, in as many configurations, takes that one's job: what is made
  /// ready for it is made once (query/kept_jobs.h).
  Job start(const QueryView& query, const ReplyView& reply) const;
  /// The same in two steps, between which the caller sees how large the answer is. What `query` points to must stay
  /// until start(). Both throw QueryError.
  PreparedQuery prepare(const QueryView& query) const;
  /// The same in slices: PreparedQuery::advance() is for the caller to call.
  PreparedQuery begin_preparing(const QueryView& query) const;
  Job start(PreparedQuery query, const ReplyView& reply) const;

  /// A query that a device answers from poses and joint positions in its memory to rows in its memory, whenever it is
  /// run (docs/cuda.md): of Reduce::kNone, kMin and kAny. \param query its configurations are not read: they are given
  /// to each run. Throws QueryError, also for what a plan does not answer, which is named: other reductions, motions,
  /// depths, bodies with a max_speed, poses that may be too old, surfaces.
  std::unique_ptr<DevicePlan> plan_on_device(const QueryView& query) const;

  /// Answers rows of a query (of reduce none; by their numbers, in any order) anew on the newest snapshot, as a job on
  /// the CPU answers them, and returns with each what proves its bounds: a document (JSON) that
  /// tools/check_certificate.py checks by itself (docs/certificates.md). Takes ten times as long as the
  /// rows do. Throws QueryError, also for a row that the answer has not.
  /// \param rows none: all
  std::string certificate(const QueryView& query, std::optional<std::span<const std::uint64_t>> rows = {}) const;
  /// The same in slices. What `query` points to must outlive it, as must the engine.
  CertificateRun begin_certificate(const QueryView& query, CertificateRows rows) const;

  /// What a query asks for at most (SceneCost::of()).
  QueryCost extent(const QueryView& query) const;
  /// Whether the CPU can answer: no device was asked for by name.
  bool has_cpu() const;

  /// Bytes that the warm state of a query takes on the host while it is under way, and after that until its client asks
  /// for something else.
  static std::uint64_t warm_bytes(const QueryView& query, const QuerySize& size);
  static const std::uint64_t kMostWarmBytes;  ///< of one query; larger ones are always cold
  /// Lets go of the warm state that a client's queries left on the host, if it takes more than `room` bytes. Freeing
  /// what comes back may take milliseconds; null: nothing.
  std::shared_ptr<void> trim_warm(std::uint64_t client, std::uint64_t room) const;

  Counters stats() const;
  /// How often the bounds of two pieces contradicted each other, so that the pair was answered anew by what shares the
  /// least with what made them: 0 unless the machine, the build or a table is broken.
  std::uint64_t contradictions() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance
