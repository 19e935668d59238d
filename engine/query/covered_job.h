// Base class of jobs whose states covers answer as far as they can.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/decision/state_lanes.h"
#include "engine/evaluate/still_pairs.h"
#include "engine/query/parallel_job.h"
#include "engine/reduce/configuration_block.h"

namespace clearance {

/// States that covers leave to the exact engine, each with the pairs to evaluate.
class LeftStates {
 public:
  void clear() { configurations_.clear(); }
  /// Adds a state. Returns its list of positions of pairs, empty so far, which must become ascending.
  std::vector<std::uint64_t>& add(std::uint64_t configuration);
  /// Adds a state with all pairs.
  void add_all(std::uint64_t configuration, std::uint64_t pairs);
  std::span<const std::uint64_t> configurations() const { return configurations_; }
  /// (configurations().size(),)
  std::span<const std::span<const std::uint64_t>> pairs();

 private:
  std::vector<std::uint64_t> configurations_;
  std::vector<std::vector<std::uint64_t>> pairs_;  // of configurations_ and more, whose memory is reused
  std::vector<std::span<const std::uint64_t>> spans_;
};

/// Answers blocks of states by covers as far as these have been made, and lets the exact engine evaluate the pairs that
/// they leave.
class CoveredJob : public ParallelJob {
 public:
  /// The constructor of a derived class calls make_blocks().
  CoveredJob(const JobContext& context, Plan&& plan, const ReplyView& reply);

  bool go_on(WorkMeter& slice) final;
  void rewind() override;

 protected:
  /// Prepares the exact engine.
  /// \param abs_tol, rel_tol of its intervals
  void make_blocks(double abs_tol, double rel_tol);
  /// Consecutive states.
  struct States {
    std::uint64_t begin, count;
    const Pose* poses;  ///< (count, stride); null with `frames`
    std::size_t stride;
    const std::uint8_t* usable;  ///< (count,) 0 if the bounds of covers do not hold
    const double* positions;     ///< (count, position_stride)
    std::size_t position_stride;
    const double* const* frames;    ///< of up to 8 states, as in DecisionBatch; null with `poses`
    const TableCell* const* cells;  ///< as in DecisionBatch; null with given poses
    WorkMeter& meter;
  };
  /// Writes the rows of the states that covers answer, and adds the others to `left`, ascending.
  virtual void answer_by_covers(const States& states, int worker, LeftStates& left) = 0;
  /// A state that the exact engine answered.
  struct ExactState {
    std::uint64_t configuration;
    std::size_t index;                     ///< in `left`, or kNone without covers
    std::span<const std::uint64_t> pairs;  ///< positions of the pairs left; empty without covers
    std::vector<Row>& rows;                ///< of its reduction
    const BodyPoses& placement;
    WorkMeter& meter;
  };
  /// Writes its rows; by default there is one.
  virtual void write_exact(const ExactState& state, int worker);
  /// Called once consecutive states have their rows; a batch is a multiple of block() states.
  virtual void end_batch(std::uint64_t /*begin*/, std::uint64_t /*count*/) {}
  virtual void count_rows() { info.rows = info.total = plan_.size.rows; }
  virtual void covers_changed() {}
  bool has_covers() const { return covers_ != nullptr; }
  const CoverPlan& covers() const { return *covers_; }
  /// Bounds of the pairs that no configuration moves, for distances.
  std::span<const StillBounds> still_bounds() const {
    return still_ ? still_->bounds() : std::span<const StillBounds>();
  }
  std::uint64_t block() const { return block_; }
  void set_batch(std::uint64_t states) { batch_ = states; }

 private:
  struct Worker {
    explicit Worker(ConfigurationBlock&& of) : block(std::move(of)) {}

    ConfigurationBlock block;
    std::span<const BodyPoses> placed;  // that the block reduces
    std::vector<std::uint8_t> usable;
    std::vector<Pose> poses;  // of a block, if the query gives some
    LeftStates left;
    std::optional<StateLanes> lanes;  // of covers_
    bool leaves_most = false;         // of the last block's states, which need poses
    std::vector<std::uint64_t> all;   // configurations, without covers
    std::vector<std::vector<Row>> rows;
  };
  void prepare_covers();
  void take_covers();
  bool answer(std::uint64_t begin, int worker, WorkMeter& meter);
  void begin_by_covers(Worker& share, std::uint64_t begin, std::uint64_t count, int worker, WorkMeter& meter);
  bool answer_in_lanes(Worker& share, std::uint64_t begin, std::uint64_t count, int worker, WorkMeter& meter);
  void answer_by_poses(Worker& share, std::uint64_t begin, std::uint64_t count, int worker, WorkMeter& meter);

  BoxColumns columns_;
  NearPairs near_pairs_;
  bool is_prepared_ = false;           // for covers: from the second answer on, unless they pay at once
  std::unique_ptr<StillPairs> still_;  // null if there are none
  std::unique_ptr<const CoverPlan> covers_;
  std::uint64_t covers_revision_ = 0;
  std::uint64_t block_ = 1, batch_ = ~std::uint64_t{0};  // configurations
  std::vector<Worker> shares_;
  std::uint64_t first_ = 0, next_ = 0;  // configuration of the batch; block in it
  std::atomic<std::uint64_t> evaluated_{0};
};

}  // namespace clearance
