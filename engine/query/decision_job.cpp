#include <algorithm>
#include <numeric>
#include <utility>

#include "engine/decision/cover_plan.h"
#include "engine/query/parallel_job.h"
#include "engine/reduce/configuration_block.h"

namespace clearance {

namespace {

// Decides states by covers as far as they have been made, and lets the exact engine evaluate the pairs that they leave open. Rows have the same bits
// as those of the exact engine alone, unless only verdicts and pairs are requested, which covers give themselves.
class DecisionJob final : public ParallelJob {
 public:
  DecisionJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply),
        near_pairs_(scene(), plan_, boxes(), *context.trees, NearBy::kBrute),
        any_hit_((plan_.size.fields & ~(kFieldVerdict | kFieldConfiguration)) == 0),
        needs_no_row_((plan_.size.fields & ~(kFieldVerdict | kFieldConfiguration | kFieldPair)) == 0) {
    columns_.assign(boxes());
    free_.answer = beyond_all_margins(plan_);
    hit_.answer.status = Status::kOk;
    const Reduction::Boxes all{boxes(), columns_, near_pairs_};
    block_ = ConfigurationBlock::most(scene(), plan_, false, !boxes().empty(), workers());
    for (int i = 0; i < workers(); ++i) shares_.emplace_back(ConfigurationBlock(scene(), plan_, options_, all, block_));
    take_covers();
  }

  bool go_on(WorkMeter& slice) override {
    const bool done = run_units(
        next_, (plan_.size.configurations + block_ - 1) / block_, slice,
        [&](std::uint64_t unit, int worker, WorkMeter& meter) { return decide(unit * block_, worker, meter); });
    if (!done) return false;
    info.rows = info.total = plan_.size.configurations;
    info.pairs_evaluated = evaluated_;
    context_.pairs_evaluated->fetch_add(info.pairs_evaluated, std::memory_order_relaxed);
    return true;
  }

  void rewind() override {
    next_ = evaluated_ = 0;
    if (covers_revision_ != CoverPlan::revision(*context_.covers, context_.tables)) take_covers();
  }

 private:
  void take_covers() {
    covers_revision_ = CoverPlan::revision(*context_.covers, context_.tables);
    covers_ = CoverPlan::make(scene(), plan_, *context_.covers, context_.tables);
  }

  /// A worker's states.
  struct Share {
    explicit Share(ConfigurationBlock&& of) : block(std::move(of)) {}

    ConfigurationBlock block;
    std::vector<std::uint8_t> usable;
    std::vector<Decision> decisions;
    std::vector<std::uint64_t> open, left;  // positions; configurations
    std::vector<std::vector<std::uint64_t>> left_open;
    std::vector<std::span<const std::uint64_t>> left_spans;
    std::vector<std::vector<Row>> rows;
  };

  // The rows of one block of configurations.
  bool decide(std::uint64_t begin, int worker, WorkMeter& meter) {
    Share& share = shares_[static_cast<std::size_t>(worker)];
    if (!share.block.has_begun()) {
      const std::uint64_t count = std::min(block_, plan_.size.configurations - begin);
      if (covers_) {
        decide_by_covers(share, worker, begin, count);
        meter.count(1 + count / kStatesPerUnit);
        if (share.left.empty()) return true;
        share.block.begin(worker_poses(worker).at(share.left), share.left, share.left_spans);
      } else {
        share.left.resize(count);
        std::iota(share.left.begin(), share.left.end(), begin);
        share.block.begin(placements(worker, begin, count), begin);
      }
    }
    if (!share.block.advance(meter)) return false;
    share.rows.resize(share.left.size());
    evaluated_.fetch_add(share.block.end(share.rows), std::memory_order_relaxed);
    for (std::size_t i = 0; i < share.left.size(); ++i) write_row(reply_, share.left[i], share.rows[i][0]);
    return true;
  }

  void decide_by_covers(Share& share, int worker, std::uint64_t begin, std::uint64_t count) {
    const std::size_t stride = plan_.bodies.size(), joints = plan_.joints.size();
    const ConfigurationPoses::PoseBlock given = worker_poses(worker).given(begin, count);
    share.usable.resize(count);
    for (std::uint64_t k = 0; k < count; ++k) {
      const auto facts = given.facts.subspan(k * stride, stride);
      share.usable[k] =
          covers_->holds_for(plan_.positions.subspan((begin + k) * joints, joints)) &&
          std::none_of(facts.begin(), facts.end(), [](std::uint8_t f) { return f & (kLinkUnplaced | kLinkBad); });
    }
    share.decisions.resize(count);
    share.open.resize(count * kMostOpen);
    decision_kernels()[0].run(
        {&covers_->view(), given.poses.data(), stride, count, share.usable.data(), any_hit_,
         plan_.positions.data() + begin * joints, joints},
        {share.decisions.data(), share.open.data(), static_cast<std::uint32_t>(share.open.size())});
    share.left.clear();
    for (std::uint64_t k = 0; k < count; ++k)
      if (!write_decided(share.decisions[k], begin + k)) leave(share, share.decisions[k], begin + k);
    share.left_spans.assign(share.left_open.begin(),
                            share.left_open.begin() + static_cast<std::ptrdiff_t>(share.left.size()));
  }

  // Writes the row of a state that needs no exact evaluation.
  bool write_decided(const Decision& decision, std::uint64_t configuration) {
    const bool is_free = decision.verdict == Verdict::kFree && covers_->unknown().empty();
    const bool is_hit = decision.verdict == Verdict::kHit && needs_no_row_ &&
                        (any_hit_ || (decision.open_begin == decision.open_end && is_first(decision.hit)));
    if (!is_free && !is_hit) return false;
    Row row = is_free ? free_ : hit_;
    row.configuration = static_cast<std::uint32_t>(configuration);
    if (is_hit) row.pair = row.pair_lower = plan_.pairs.at(decision.hit);
    write_row(reply_, configuration, row);
    return true;
  }
  // Whether no pair that covers do not know comes before a position.
  bool is_first(std::uint64_t position) const {
    return covers_->unknown().empty() || position < covers_->unknown().front();
  }

  // Lists the pairs that are left to the exact engine: those open before the first hit, that one, and the unknown ones.
  void leave(Share& share, const Decision& decision, std::uint64_t configuration) {
    const std::size_t i = share.left.size();
    share.left.push_back(configuration);
    if (share.left_open.size() <= i) share.left_open.emplace_back();
    std::vector<std::uint64_t>& open = share.left_open[i];
    open.clear();
    if (!decision.is_listed) {
      for (std::uint64_t p = 0; p < plan_.pairs.size(); ++p) open.push_back(p);
      return;
    }
    open.assign(share.open.begin() + decision.open_begin, share.open.begin() + decision.open_end);
    if (decision.verdict == Verdict::kHit) open.push_back(decision.hit);
    open.insert(open.end(), covers_->unknown().begin(), covers_->unknown().end());
    std::sort(open.begin(), open.end());
    open.erase(std::unique(open.begin(), open.end()), open.end());
  }

  static constexpr std::uint64_t kStatesPerUnit = 2;
  static constexpr std::uint64_t kMostOpen = 32;  // pairs of a state, on average; beyond it all are open

  BoxColumns columns_;
  NearPairs near_pairs_;
  bool any_hit_, needs_no_row_;
  std::unique_ptr<const CoverPlan> covers_;
  std::uint64_t covers_revision_ = 0;
  std::uint64_t block_ = 1;    // configurations
  std::vector<Share> shares_;  // by worker
  Row free_{{kNone, kNone}, 0, {}, {}, {}, {kNone, kNone}, {}}, hit_ = free_;
  std::uint64_t next_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
};

}  // namespace

bool covers_may_decide(const JobContext& context, const Plan& plan) {
  constexpr std::uint32_t kOfExactRows = kFieldFreeScale | kFieldGradientJoints;
  return context.covers && !context.reference && context.near_by != NearBy::kTree && !context.scene->has_proxies() &&
         plan.query.reduce == Reduce::kAny && !(plan.size.fields & kOfExactRows) && CoverPlan::may_decide(plan);
}

std::unique_ptr<Job::State> make_decision_job(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<DecisionJob>(context, std::move(plan), reply);
}

}  // namespace clearance
