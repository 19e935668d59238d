// What jobs that answer on the CPU have in common: workers with their own placements, and units run side by side.
#pragma once

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "engine/base/fp_environment.h"
#include "engine/evaluate/joint_gradient.h"
#include "engine/query/job_state.h"
#include "engine/query/team_cost.h"
#include "engine/selection/columns.h"

namespace clearance {

using Clock = std::chrono::steady_clock;

/// Pair-configurations that are not worth waking threads for.
inline constexpr std::uint64_t kSerialBelow = 256;
/// How long units run on the calling thread until it is first decided whether the rest is worth a team.
inline constexpr std::chrono::nanoseconds kAlone{20'000};

/// Whether the narrow phase was asked: bodies without a pose have no distance, and pairs that boxes alone prove to be
/// beyond max_distance have no upper bound.
inline bool reached_narrow_phase(const PairAnswer& answer) {
  return !std::isnan(answer.distance) && answer.upper < std::numeric_limits<double>::infinity();
}

/// A job's common part: workers with their own placements, and units run in parallel until the slice is over.
class ParallelJob : public Job::State {
 public:
  /// \param boxes whether boxes of all bodies are worth making beforehand, if boxes will be asked for.
  ParallelJob(const JobContext& context, Plan&& plan, const ReplyView& reply, bool boxes = true)
      : context_(context), plan_(std::move(plan)), reply_(reply) {
    plan_.begun_ns = monotonic_ns();
    take_stale_for_none();
    plan_.uncertainties = uncertainties_of(scene(), *plan_.snapshot, plan_.begun_ns);
    const QueryView& q = plan_.query;
    const PoseSnapshot& snapshot = *plan_.snapshot;
    options_.limits.max_distance = q.max_distance;
    options_.limits.abs_tol = q.abs_tol;
    options_.limits.rel_tol = q.rel_tol;
    options_.limits.signed_distance = q.signed_distance;
    options_.drops_beyond = q.reduce == Reduce::kWithin && !context.reference;
    options_.reference = context.reference;
    options_.lanes = context.lanes;
    options_.contradictions = context.contradictions;
    // Reductions look at few pairs, and of many hulls: float32 lanes gain nothing there (docs/notes/performance.md).
    options_.f32 = q.precision == Precision::kF32 && q.reduce == Reduce::kNone && !q.signed_distance;
    const bool needs_boxes = q.reduce != Reduce::kNone || q.max_distance < std::numeric_limits<double>::infinity();
    options_.cull = needs_boxes && !context.reference;
    const std::uint32_t interval =
        kDefaultFields | kFieldBounds | kFieldFlags | kFieldPair | kFieldConfiguration | kFieldPairLower;
    options_.want_flags = (q.fields & (kFieldFlags | kFieldGradient)) != 0;
    if (plan_.size.fields & kFieldGradientJoints) options_.joint_gradient = &joint_gradient_.emplace(scene(), plan_);
    options_.want_points = (q.fields & ~interval) != 0 || q.format == Format::kCompact || options_.want_flags;
    if (boxes && needs_boxes && 2 * plan_.pairs.size() >= scene().bodies().size())
      for (std::uint32_t b = 0; b < scene().bodies().size(); ++b)
        boxes_.push_back(body_box(scene().bodies()[b], snapshot.placed[b],
                                  plan_.uncertainties.empty() ? Slack() : plan_.uncertainties[b].slack));
    const bool serial = plan_.size.configurations * plan_.size.pairs < kSerialBelow;
    for (int i = 0; i < (serial ? 1 : context.threads); ++i) placements_.push_back({{}, ConfigurationPoses(plan_), {}});
    open_.assign(placements_.size(), kNone64);
    begin_info();
  }

  const QuerySize& size() const override { return plan_.size; }
  bool advance(const WorkBudget& budget) final {
    WorkMeter slice(budget);
    is_whole = go_on(slice);
    units += slice.spent();
    return is_whole;
  }

  Plan* plan_to_ask_again() override { return plan_.question ? &plan_ : nullptr; }
  void begin_again(const ReplyView& reply) override {
    assert(is_whole);
    is_whole = false;
    ++plan_.round;
    plan_.keep_configurations();
    plan_.begun_ns = monotonic_ns();
    reply_ = reply;
    units = 0;
    begin_info();
    rewind();
  }

 protected:
  /// Works until the slice is over. Returns true once the answer is whole.
  virtual bool go_on(WorkMeter& slice) = 0;
  /// Back to the beginning, after an answer that is whole.
  virtual void rewind() {}
  const Scene& scene() const { return *context_.scene; }
  std::span<const Aabb> boxes() const { return boxes_; }  ///< of all bodies in the snapshot; empty: not made
  int workers() const { return static_cast<int>(placements_.size()); }

  const BodyPoses& placement(int worker, std::uint64_t configuration) {
    return placements(worker, configuration, 1)[0];
  }

  // Placements of configurations [first, first + count), the worker's own.
  std::span<const BodyPoses> placements(int worker, std::uint64_t first, std::uint64_t count) {
    assert(worker < workers() && count > 0 && first + count <= plan_.size.configurations);
    auto& [p, poses, rotations] = placements_[static_cast<std::size_t>(worker)];
    while (p.size() < count) p.emplace_back(scene(), plan_, boxes_);
    if (p[0].stands_at(first) && p[count - 1].stands_at(first + count - 1)) return {p.data(), count};
    const std::size_t moved = plan_.bodies.size();
    const ConfigurationPoses::Block given = poses.at(first, count);
    rotations.resize(count * moved);
    rotations_of(given.poses, rotations);
    for (std::uint64_t i = 0; i < count; ++i)
      p[i].configure(first + i, given.of(i, moved), std::span(rotations).subspan(i * moved, moved));
    return {p.data(), count};
  }

  // Writes the answer to a pair of one configuration into row `index`.
  void write(std::uint64_t index, std::uint32_t configuration, const PlacedBodies& asked, const PairAnswer& answer) {
    assert(index < plan_.size.rows);
    static constexpr Vec3d kNoOrigin{0, 0, 0};
    const BodyPair pair = asked.pair;
    const BodyPoses& here = *asked.placement;
    const std::size_t n = scene().bodies().size();
    write_row(reply_, index, pair, configuration, answer, pair.a < n ? here[pair.a].pose.t_w : kNoOrigin,
              pair.b < n ? here[pair.b].pose.t_w : kNoOrigin);
    if (reply_.gradient_joints)
      joint_gradient_->write(here, pair, answer, reply_.gradient_joints + index * reply_.joints);
  }

  // Runs units [next, count) until all are done (true) or the slice is over. `unit(i, worker, meter)` returns false
  // where the slice ended within it: the same worker's state then goes on with it in the next one. \param alone on the
  // calling thread only; else a team takes over what is worth one (team_cost.h).
  template <class Unit>
  bool run_units(std::uint64_t& next, std::uint64_t count, WorkMeter& slice, Unit unit, bool alone = false) {
    std::atomic<std::uint64_t> from{next}, spent{0};
    const auto finish = [&](int worker, WorkMeter& meter) {  // what is open
      std::uint64_t& open = open_[static_cast<std::size_t>(worker)];
      if (open == kNone64 || !unit(open, worker, meter)) return;
      open = kNone64;
    };
    const auto work = [&](int thread, int threads, WorkMeter meter) {
      for (int worker = thread; worker < workers(); worker += threads) finish(worker, meter);
      std::uint64_t& open = open_[static_cast<std::size_t>(thread)];
      while (open == kNone64 && !(meter.spent() > 0 && meter.is_over())) {
        open = from.fetch_add(1, std::memory_order_relaxed);
        if (open < count)
          finish(thread, meter);
        else
          break;
      }
      if (open != kNone64 && open >= count) open = kNone64;
      spent.fetch_add(meter.spent(), std::memory_order_relaxed);
    };
    const auto left = [&] { return count - std::min<std::uint64_t>(from, count) + count_open(); };
    const auto end_phase = [&] {
      slice.count(spent.exchange(0));
      next = std::min<std::uint64_t>(from, count);
      return left() == 0;
    };
    int threads = alone ? 1 : static_cast<int>(std::min(left(), static_cast<std::uint64_t>(workers())));
    if (threads <= 1) {
      work(0, 1, slice.share());
      return end_phase();
    }
    // By the clock, which is cheap; before a team starts also by the processor's, as others may have had the core.
    const auto is_worth = [&](std::chrono::nanoseconds passed, std::uint64_t before) {
      const std::uint64_t more = left();
      threads = static_cast<int>(std::min<std::uint64_t>(more, static_cast<std::uint64_t>(threads)));
      const double each = 1e-9 * static_cast<double>(passed.count()) / static_cast<double>(before - more + 1);
      return threads > 1 && team_cost().is_worth(each * static_cast<double>(more), threads, Clock::now());
    };
    const std::uint64_t all = left();
    const Clock::time_point begin = Clock::now();
    std::chrono::nanoseconds begun{0};
    std::uint64_t left_then = 0;  // 0: no team is thought of
    for (std::chrono::nanoseconds time = kAlone;; time *= 2) {
      work(0, 1, slice.share(time));
      if (end_phase()) return true;
      if (slice.is_over()) return false;
      if (left_then && is_worth(thread_time() - begun, left_then)) break;
      left_then = is_worth(Clock::now() - begin, all) ? left() : 0;
      if (left_then) begun = thread_time();
    }
    run_on(threads, [&](int thread, int of) { work(thread, of, slice.share()); });
    return end_phase();
  }

  JobContext context_;
  Plan plan_;
  ReplyView reply_;
  EvaluateOptions options_;

 private:
  static constexpr std::uint64_t kNone64 = ~std::uint64_t{0};

  void begin_info() {
    const PoseSnapshot& snapshot = *plan_.snapshot;
    const std::uint64_t asked = plan_.query.scene_revision;
    info = {};
    info.backend = context_.reference ? "reference" : "cpu";
    info.snapshot_revision = snapshot.revision;
    info.snapshot_stamp_ns = snapshot.newest_stamp_ns;
    info.snapshot_sequence = snapshot.newest_sequence;
    info.scene_revision = asked ? asked : snapshot.scene_revision;  // for both the answer is the same
    info.oldest_receipt_ns = snapshot.oldest_receipt_ns;
    if (snapshot.oldest_receipt_ns != 0) info.pose_age_ns = plan_.begun_ns - snapshot.oldest_receipt_ns;
  }

  std::uint64_t count_open() const {
    return open_.size() - static_cast<std::uint64_t>(std::count(open_.begin(), open_.end(), kNone64));
  }

  // Runs work(thread, threads) on as many threads, or on fewer where the system has no more.
  template <class Work>
  void run_on(int threads, const Work& work) {
    std::exception_ptr failure;  // an exception may not leave a parallel region
    std::atomic<std::chrono::nanoseconds::rep> worked{0};
    const Clock::time_point begin = Clock::now();
#pragma omp parallel num_threads(threads)
    {
      const std::chrono::nanoseconds begun = thread_time();
      try {
        const FpEnvironment environment;  // the worker's own
        work(omp_get_thread_num(), omp_get_num_threads());
      } catch (...) {
#pragma omp critical(clearance_job_failure)
        failure = std::current_exception();
      }
      worked.fetch_add((thread_time() - begun).count(), std::memory_order_relaxed);
    }
    const Clock::time_point end = Clock::now();
    team_cost().learn(end - begin, std::chrono::nanoseconds(worked), end);
    if (context_.teams) context_.teams->fetch_add(1, std::memory_order_relaxed);
    if (failure) std::rethrow_exception(failure);
  }

  /// Gives bodies whose poses are older than max_pose_age_ns the status kStalePose, and what follows them.
  void take_stale_for_none() {
    if (plan_.query.max_pose_age_ns == 0) return;
    const PoseSnapshot& snapshot = *plan_.snapshot;
    const std::int64_t oldest_allowed = plan_.begun_ns - plan_.query.max_pose_age_ns;
    std::vector<std::uint8_t> stale(scene().bodies().size());
    for (std::uint32_t b = 0; b < stale.size(); ++b) {
      const std::int64_t receipt = snapshot.receipt_of_chain(b);
      stale[b] = !scene().bodies()[b].is_static && (receipt == 0 || receipt < oldest_allowed);
    }
    if (plan_.query.configuration_count > 0) {
      for (const std::uint32_t b : plan_.moved) {  // the query itself says where they are, but not what is there
        const ReceivedPoints* const points = snapshot.points_of(b);
        stale[b] = points && points->receipt_ns < oldest_allowed;
      }
      for (const LinkMotion& motion : plan_.motions) find_stale_links(motion, oldest_allowed, stale);
    }
    if (std::find(stale.begin(), stale.end(), 1) == stale.end()) return;
    auto own = std::make_shared<PoseSnapshot>(snapshot);
    for (std::uint32_t b = 0; b < stale.size(); ++b)
      if (stale[b] && own->placed[b].status == Status::kOk) own->placed[b].status = Status::kStalePose;
    if (plan_.query.configuration_count > 0)
      for (const std::uint32_t b : plan_.moved)  // also where only the query gives them a pose
        if (stale[b]) own->placed[b].status = Status::kStalePose;
    plan_.snapshot = std::move(own);
  }

  /// Links stand where the query's joints put them, and also where the robot's base and its other joints are.
  void find_stale_links(const LinkMotion& motion, std::int64_t oldest_allowed, std::vector<std::uint8_t>& stale) const {
    const PoseSnapshot& snapshot = *plan_.snapshot;
    const SceneRobot& robot = motion.robot();
    std::vector<std::uint8_t> old(robot.model.columns.size());
    for (std::size_t c = 0; c < old.size(); ++c) {
      const std::int64_t receipt = snapshot.joints.receipt_ns[robot.first_joint + c];
      old[c] = receipt != 0 && receipt < oldest_allowed;
    }
    for (const LinkMotion::Moving& m : motion.moving()) old[m.column] = 0;
    const std::vector<std::uint8_t> is_old = bits_along_links(robot, old);
    for (const std::uint32_t link : motion.links()) {
      const std::uint32_t on = snapshot.parent[robot.bodies[link]];
      stale[robot.bodies[link]] = is_old[link] || stale[on];
    }
    std::vector<std::uint8_t> on_old(stale.size(), 0);
    for (const std::uint32_t b : plan_.moved) {  // those, and what follows them
      const std::uint32_t on = snapshot.parent[b];
      on_old[b] = scene().bodies()[b].robot != kNone ? stale[b] : on != kNone && on_old[on];
      stale[b] |= on_old[b];
    }
  }

  std::vector<Aabb> boxes_;
  std::optional<JointGradient> joint_gradient_;
  struct WorkerBodyPoses {
    std::vector<BodyPoses> placements;
    ConfigurationPoses poses;
    std::vector<Mat3d> rotations;  // of the configurations that are being placed
  };
  std::vector<WorkerBodyPoses> placements_;  // of each worker
  std::vector<std::uint64_t> open_;          // of each worker: the unit that a slice ended in, or kNone64
};

}  // namespace clearance
