#include "engine/motion/motion_job.h"

#include <algorithm>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "engine/decision/motion_decider.h"
#include "engine/evaluate/still_pairs.h"
#include "engine/motion/motion_block.h"
#include "engine/query/parallel_job.h"

namespace clearance {

namespace {

constexpr std::uint64_t kMostPairs = 1u << 16;  // of a motion: a slice covers one evaluation of all of them
constexpr std::uint64_t kBlocksAtOnce = 8;      // per worker: rows wait for those before them
// Columns of reduce="any" that covers give of any motion, and those that are the same for all free motions.
constexpr std::uint32_t kOfVerdict = kFieldVerdict | kFieldConfiguration;
constexpr std::uint32_t kOfFree = kOfVerdict | kFieldUpper | kFieldStatus | kFieldFlags | kFieldPair | kFieldPairLower |
                                  kFieldTime | kFieldFirstContact;

/// The exact search of a worker's motions that covers leave open, each with its open pairs: of most pairs it needs no
/// bounds.
struct OpenMotions {
  /// The references must outlive this.
  OpenMotions(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options, std::span<const Aabb> boxes,
              int workers)
      : pairs(plan.pairs.size()),
        bounds(scene, plan, false),
        query{scene, plan, bounds},
        block(query, options, boxes, MotionBlock::most(plan, workers)) {}

  void begin(std::span<const OpenMotion> motions, WorkMeter& meter) {
    for (const OpenMotion& motion : motions) {
      for (const OpenPair& open : motion.open) bounds.take_views(open.position);
      for (std::uint64_t p = 0; motion.open.empty() && p < pairs; ++p) bounds.take_views(p);
    }
    block.begin(motions, meter);
  }

  const std::uint64_t pairs;
  MotionBounds bounds;
  const MotionQuery query;
  MotionBlock block;
};

/// The exact search of all motions of a job.
struct ExactMotions {
  /// The references must outlive this.
  ExactMotions(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options,
               std::span<const Aabb> boxes, int workers)
      : bounds(scene, plan), query{scene, plan, bounds} {
    for (int i = 0; i < workers; ++i) blocks.emplace_back(query, options, boxes, MotionBlock::most(plan, workers));
  }

  const MotionBounds bounds;
  const MotionQuery query;
  std::vector<MotionBlock> blocks;  // one per worker
};

class MotionJob final : public ParallelJob {
 public:
  MotionJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply) {
    set_motion_options(plan_, options_);
    block_ = MotionBlock::most(plan_, workers());
    left_.resize(static_cast<std::size_t>(workers()));
    has_begun_.resize(left_.size());
    open_.resize(left_.size());
    if (!covers_may_decide(context_, plan_) || (plan_.size.fields & ~kOfFree) != 0) return;
    may_use_covers_ = true;
    still_ = StillPairs::find(scene(), plan_, options_, boxes());
    if (!still_) take_covers();
  }

  bool go_on(WorkMeter& slice) override {
    if (still_ && !still_->is_done()) {
      if (!still_->advance(slice)) return false;
      evaluated_ += still_->evaluated();
      take_covers();
    }
    const std::uint64_t count = plan_.size.configurations,
                        at_once = kBlocksAtOnce * static_cast<std::uint64_t>(workers()) * block_;
    while (first_ < count) {
      const std::uint64_t motions = std::min(count - first_, at_once), parts = (motions + block_ - 1) / block_;
      rows_.resize(parts);
      const bool done = run_units(next_, parts, slice, [&](std::uint64_t unit, int worker, WorkMeter& meter) {
        return run(unit, worker, std::min(block_, motions - unit * block_), meter);
      });
      if (!done) return false;
      for (const auto& rows : rows_)
        for (const MotionRow& row : rows) write(row);
      if (!deciders_.empty()) written_ = first_ + motions;
      rows_.clear();
      next_ = 0;
      first_ += motions;
      if (first_ < count && slice.is_over()) return false;
    }
    info.rows = info.total = written_;
    info.pairs_evaluated = evaluated_;
    if (info.pairs_evaluated > 0) context_.pairs_evaluated->fetch_add(info.pairs_evaluated, std::memory_order_relaxed);
    return true;
  }

  void rewind() override {
    first_ = next_ = written_ = 0;
    evaluated_.store(0, std::memory_order_relaxed);
    if (may_use_covers_ && covers_revision_ != CoverPlan::revision(*context_.covers, context_.tables)) take_covers();
  }

 private:
  bool run(std::uint64_t unit, int worker, std::uint64_t count, WorkMeter& meter) {
    std::uint8_t& has_begun = has_begun_[static_cast<std::size_t>(worker)];
    if (!has_begun && !begin(first_ + unit * block_, count, worker, meter)) return true;
    has_begun = true;
    MotionBlock& block = takes_open_pairs() ? open_motions(worker).block : exact_block(worker);
    if (!block.advance(meter)) return false;
    has_begun = false;
    evaluated_.fetch_add(block.end(rows_[unit]), std::memory_order_relaxed);
    return true;
  }

  // Makes the exact search when the first motion is left to it. Thread-safe.
  MotionBlock& exact_block(int worker) {
    std::call_once(exact_made_, [&] { exact_.emplace(scene(), plan_, options_, boxes(), workers()); });
    return exact_->blocks[static_cast<std::size_t>(worker)];
  }

  // Whether the exact search gets the open pairs of a motion: a row needs all of its pairs.
  bool takes_open_pairs() const { return !deciders_.empty() && needs_no_row_; }

  // Likewise, of a worker's motions that covers leave open.
  OpenMotions& open_motions(int worker) {
    std::unique_ptr<OpenMotions>& open = open_[static_cast<std::size_t>(worker)];
    if (!open) open = std::make_unique<OpenMotions>(scene(), plan_, options_, boxes(), workers());
    return *open;
  }

  // Decides motions by covers as far as the requested columns allow. Returns false if none is left to evaluate.
  bool begin(std::uint64_t first, std::uint64_t count, int worker, WorkMeter& meter) {
    if (deciders_.empty()) {
      exact_block(worker).begin(first, count, meter);
      return true;
    }
    std::vector<OpenMotion>& left = left_[static_cast<std::size_t>(worker)];
    std::optional<MotionDecider>& decider = deciders_[static_cast<std::size_t>(worker)];
    if (!decider) decider.emplace(*covers_, plan_);
    left.clear();
    for (std::uint64_t k = first; k < first + count; ++k) {
      const Verdict verdict = decider->decide(k);
      if (verdict == Verdict::kFree)
        write_free(k);
      else if (!needs_no_row_)
        left.push_back({k, {}});
      else if (verdict == Verdict::kHit)
        write_verdict(k, Status::kOk);
      else
        left.push_back({k, {decider->open().begin(), decider->open().end()}});
    }
    meter.count(count * kUnitsPerDecision);
    if (!left.empty() && takes_open_pairs())
      open_motions(worker).begin(left, meter);
    else if (!left.empty())
      exact_block(worker).begin(left, meter);
    return !left.empty();
  }

  void write_verdict(std::uint64_t motion, Status verdict) {
    reply_.verdict[motion] = static_cast<std::uint8_t>(verdict);
    if (reply_.configuration) reply_.configuration[motion] = static_cast<std::uint32_t>(motion);
  }

  void write_free(std::uint64_t motion) {
    if (needs_no_row_) return write_verdict(motion, Status::kBeyond);
    MotionRow free;
    free.row = {{kNone, kNone}, static_cast<std::uint32_t>(motion), beyond_answer(0)};
    free.free_until = std::numeric_limits<double>::infinity();
    write_motion_row(reply_, motion, free);
  }

  void take_covers() {
    deciders_.clear();
    needs_no_row_ = (plan_.size.fields & ~kOfVerdict) == 0;
    covers_revision_ = CoverPlan::revision(*context_.covers, context_.tables);
    covers_ = CoverPlan::make(scene(), plan_, *context_.covers, context_.tables,
                              still_ ? still_->known() : std::span<const std::uint64_t>());
    if (!covers_ || !covers_->rates()) return;
    deciders_.resize(static_cast<std::size_t>(workers()));
  }

  void write(const MotionRow& row) {
    assert(written_ < plan_.size.rows);
    write_motion_row(reply_, deciders_.empty() ? written_++ : row.row.configuration, row);
  }

  static constexpr std::uint64_t kUnitsPerDecision = 8;

  std::once_flag exact_made_;
  std::optional<ExactMotions> exact_;
  std::vector<std::unique_ptr<OpenMotions>> open_;  // one per worker, once it is needed
  std::vector<std::uint8_t> has_begun_;             // by worker: whether the exact search has a unit of its own
  std::unique_ptr<StillPairs> still_;               // null if there are none, or without covers
  std::unique_ptr<const CoverPlan> covers_;
  // One per worker, made for its first motion: few workers may get one. None without covers.
  std::vector<std::optional<MotionDecider>> deciders_;
  std::vector<std::vector<OpenMotion>> left_;  // motions that they leave open; one per worker
  std::uint64_t covers_revision_ = 0;
  bool may_use_covers_ = false, needs_no_row_ = false;
  std::vector<std::vector<MotionRow>> rows_;  // of the units in progress
  std::uint64_t block_ = 1, first_ = 0, next_ = 0, written_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
};

}  // namespace

void check_motion_pairs(const Plan& plan) {
  if (plan.size.pairs > kMostPairs)
    throw engine::QueryError(QueryErrorCode::kTooLarge, "max_evaluations: motions of " +
                                                            std::to_string(plan.size.pairs) +
                                                            " pairs are more than the limit of " +
                                                            std::to_string(kMostPairs) + ": list the pairs explicitly");
}

std::unique_ptr<Job::State> make_motion_job(const JobContext& context, Plan plan, const ReplyView& reply) {
  check_motion_pairs(plan);
  plan.keep_configurations();
  return std::make_unique<MotionJob>(context, std::move(plan), reply);
}

}  // namespace clearance
