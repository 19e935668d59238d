// Base class of jobs that run on the CPU's threads.
#pragma once

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "engine/evaluate/joint_gradient.h"
#include "engine/evaluate/second_order.h"
#include "engine/query/job_options.h"
#include "engine/query/job_state.h"
#include "engine/query/run_units.h"
#include "engine/query/worker_poses.h"
#include "engine/selection/columns.h"

namespace clearance {

/// Whether an answer came from the narrow phase. Bodies without a pose have no distance, and pairs rejected by their
/// boxes have no upper bound.
inline bool reached_narrow_phase(const PairAnswer& answer) {
  return !std::isnan(answer.distance) && answer.upper < std::numeric_limits<double>::infinity();
}

/// A plan, its options and its workers, each with body poses of its own.
class ParallelJob : public Job::State {
 public:
  /// \param boxes whether boxes of all bodies are of use
  ParallelJob(const JobContext& context, Plan&& plan, const ReplyView& reply, bool boxes = true);

  const QuerySize& size() const override { return plan_.size; }
  bool advance(const WorkBudget& budget) final;
  Plan* repeatable_plan() override { return &plan_; }
  void reset(const ReplyView& reply) override;

 protected:
  /// Works until the slice is over. Returns true once the answer is complete.
  virtual bool go_on(WorkMeter& slice) = 0;
  /// Returns to the beginning, after a complete answer.
  virtual void rewind() {}
  const engine::Scene& scene() const { return *context_.scene; }
  std::span<const Aabb> boxes() const { return boxes_; }  ///< of all bodies in the snapshot, or empty
  int workers() const { return runner_.workers(); }

  WorkerPoses& worker_poses(int worker) { return worker_poses_[static_cast<std::size_t>(worker)]; }
  const BodyPoses& placement(int worker, std::uint64_t configuration) {
    return placements(worker, configuration, 1)[0];
  }
  /// The worker's body poses in configurations [first, first + count).
  std::span<const BodyPoses> placements(int worker, std::uint64_t first, std::uint64_t count) {
    return worker_poses(worker).at(first, count);
  }

  /// Writes the answer of a pair in one configuration into row `index`.
  void write(std::uint64_t index, std::uint32_t configuration, const PlacedBodies& bodies, const PairAnswer& answer,
             WorkMeter& meter) {
    assert(index < plan_.size.rows);
    static constexpr Vec3d kNoOrigin{0, 0, 0};
    const BodyPair pair = bodies.pair;
    const BodyPoses& here = *bodies.placement;
    const std::size_t n = scene().bodies().size();
    write_row(reply_, index, pair, configuration, answer, pair.a < n ? here[pair.a].pose.t_w : kNoOrigin,
              pair.b < n ? here[pair.b].pose.t_w : kNoOrigin);
    if (reply_.gradient_joints)
      joint_gradient_->write(here, pair, answer, reply_.gradient_joints + index * reply_.joints);
    if (second_order_) write_second_order(reply_, index, second_order_->row(here, pair, configuration, answer, meter));
  }

  /// UnitRunner::run().
  template <class Unit>
  bool run_units(std::uint64_t& next, std::uint64_t count, WorkMeter& slice, Unit unit, bool alone = false) {
    return runner_.run(next, count, slice, std::ref(unit), alone);
  }

  JobContext context_;
  Plan plan_;
  ReplyView reply_;
  EvaluateOptions options_;

 private:
  std::optional<JointGradient> joint_gradient_;
  std::optional<SecondOrder> second_order_;
  std::vector<Aabb> boxes_;
  UnitRunner runner_;
  std::vector<WorkerPoses> worker_poses_;
};

}  // namespace clearance
