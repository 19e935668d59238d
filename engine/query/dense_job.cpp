#include <algorithm>
#include <cassert>
#include <utility>

#include "engine/query/parallel_job.h"
#include "engine/reduce/box_cull.h"

namespace clearance {

namespace {

constexpr std::uint64_t kBlock = 512, kHeavyBlock = 256;  // pair-configurations that are evaluated at a time
constexpr std::uint64_t kUnit = 4096, kHeavyUnit = 1024;  // pair-configurations of a unit, if there are many
constexpr std::uint64_t kFewest = 64;                     // pair-configurations of a unit, if there are few
constexpr std::uint64_t kBoxesPerUnit = 64;               // of work
constexpr std::uint64_t kSideBySide = 64;                 // configurations that a thread has placed at a time

// Writes one row for each configuration and pair.
class DenseJob final : public ParallelJob {
 public:
  DenseJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply), scratch_(static_cast<std::size_t>(workers())) {
    // With boxes of all bodies, whole blocks of pairs are compared at once; otherwise each pair makes its own boxes.
    EvaluateOptions left = options_;
    if (options_.cull && !boxes().empty()) {
      left.cull = false;
      columns_.assign(boxes());
      for (int i = 0; i < workers(); ++i) culls_.emplace_back(scene(), boxes(), columns_);
    }
    for (int i = 0; i < workers(); ++i) evaluators_.emplace_back(scene(), left);
    layout_ = Layout(plan_, BodyPoses::most(scene(), plan_), context.light, !culls_.empty(), workers());
  }

  bool go_on(WorkMeter& slice) override {
    const bool done =
        run_units(next_, layout_.pair_blocks * layout_.configuration_blocks, slice,
                  [&](std::uint64_t unit, int worker, WorkMeter& meter) { return run(unit, worker, meter); });
    if (done) {
      info.rows = info.total = plan_.size.rows;
      info.pairs_evaluated = evaluated_;
      context_.pairs_evaluated->fetch_add(info.pairs_evaluated, std::memory_order_relaxed);
    }
    return done;
  }

  void rewind() override {
    next_ = 0;
    evaluated_ = 0;
  }

 private:
  // Units of work: blocks of pairs in blocks of configurations, so that lanes share the same two hulls.
  struct Layout {
    std::uint64_t configurations = 1, pairs = 1;  // of one unit
    std::uint64_t configuration_blocks = 0, pair_blocks = 0;
    std::uint64_t block = 1;  // pair-configurations that are evaluated at a time

    Layout() = default;
    /// \param most configurations that are placed at a time
    /// \param cull boxes are compared for a whole unit at a time, so that the remaining pairs fill the lanes
    Layout(const Plan& plan, std::uint64_t most, bool light, bool cull, int workers)
        : block(light ? kBlock : kHeavyBlock) {
      const std::uint64_t unit = light ? kUnit : kHeavyUnit;
      const std::uint64_t all_pairs = std::max<std::uint64_t>(plan.size.pairs, 1);
      configurations = std::clamp<std::uint64_t>(std::min(std::max<std::uint64_t>(unit / all_pairs, 32), most), 1,
                                                 std::min(plan.size.configurations, kSideBySide));
      pairs = std::min(all_pairs, unit / configurations);
      if (plan.size.configurations == 1)
        pairs = std::min(pairs, cull ? std::max(block, all_pairs / (8 * static_cast<std::uint64_t>(workers)))
                                     : std::clamp(all_pairs / static_cast<std::uint64_t>(workers), kFewest, block));
      if (cull) block = unit;
      configuration_blocks = (plan.size.configurations + configurations - 1) / configurations;
      pair_blocks = (all_pairs + pairs - 1) / pairs;
    }
  };
  struct PairPlace {  // in a block
    std::uint32_t configuration, pair;
  };
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};
  struct WorkerScratch {
    std::uint64_t next = kNowhere;  // first pair of the current block, or kNowhere
    bool is_evaluating = false;     // whether that block has begun
    std::vector<BodyPair> pairs;
    std::vector<PlacedBodies> to_evaluate;
    std::vector<PairPlace> places;  // of `to_evaluate`
    std::vector<PairAnswer> answers;
    std::vector<std::uint32_t> near;  // in a configuration of a block
    std::vector<std::uint16_t> flags;
  };

  bool run(std::uint64_t unit, int worker, WorkMeter& meter) {
    assert(unit < layout_.pair_blocks * layout_.configuration_blocks);
    WorkerScratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    Evaluator& evaluator = evaluators_[static_cast<std::size_t>(worker)];
    const std::uint64_t first = unit / layout_.pair_blocks * layout_.configurations,
                        begin = unit % layout_.pair_blocks * layout_.pairs;
    const std::uint64_t configurations = std::min(layout_.configurations, plan_.size.configurations - first);
    const std::uint64_t end = std::min(begin + layout_.pairs, plan_.size.pairs);
    const std::span<const BodyPoses> placed = placements(worker, first, configurations);
    const std::uint64_t step = std::max<std::uint64_t>(layout_.block / configurations, 1);
    if (scratch.next == kNowhere) scratch.next = begin;
    while (scratch.next < end) {
      if (!std::exchange(scratch.is_evaluating, true)) {
        const auto pairs = plan_.pairs.slice(scratch.next, std::min(step, end - scratch.next), scratch.pairs);
        take(pairs, scratch.next, placed, first, worker);
        meter.count(pairs.size() * configurations / kBoxesPerUnit);
        scratch.answers.resize(std::max(scratch.answers.size(), scratch.to_evaluate.size()));
        evaluator.begin(scratch.to_evaluate, scratch.answers);
      }
      if (!evaluator.advance(meter)) return false;
      write_block(scratch, first, meter);
      scratch.is_evaluating = false;
      scratch.next += step;
      if (scratch.next < end && meter.is_over()) return false;
    }
    scratch.next = kNowhere;
    return true;
  }

  // Writes the rows of a block.
  void write_block(const WorkerScratch& scratch, std::uint64_t first, WorkMeter& meter) {
    std::uint64_t evaluated = 0;
    for (std::size_t i = 0; i < scratch.to_evaluate.size(); ++i) {
      const auto [k, at] = scratch.places[i];
      write((first + k) * plan_.size.pairs + scratch.next + at, static_cast<std::uint32_t>(first + k),
            scratch.to_evaluate[i], scratch.answers[i], meter);
      evaluated += reached_narrow_phase(scratch.answers[i]);
    }
    evaluated_.fetch_add(evaluated, std::memory_order_relaxed);
  }

  // Prepares a block of pairs, from `begin` on, in configurations from `first` on, except pairs that boxes reject.
  void take(std::span<const BodyPair> pairs, std::uint64_t begin, std::span<const BodyPoses> placed,
            std::uint64_t first, int worker) {
    WorkerScratch& scratch = scratch_[static_cast<std::size_t>(worker)];
    scratch.to_evaluate.clear();
    scratch.places.clear();
    assert(begin + pairs.size() <= plan_.size.pairs && first + placed.size() <= plan_.size.configurations);
    const auto evaluate = [&](std::size_t i, std::size_t k) {
      scratch.to_evaluate.push_back({pairs[i], &placed[k], plan_.query.max_distance});
      scratch.places.push_back({static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(i)});
    };
    if (culls_.empty()) {
      for (std::size_t i = 0; i < pairs.size(); ++i)
        for (std::size_t k = 0; k < placed.size(); ++k) evaluate(i, k);
      return;
    }
    const std::span<const double> gaps = culls_[static_cast<std::size_t>(worker)].gaps(pairs, placed);
    scratch.near.resize(std::max(scratch.near.size(), pairs.size()));
    for (std::size_t k = 0; k < placed.size(); ++k) {
      const std::size_t count =
          gaps_within(gaps.data() + k * pairs.size(), pairs.size(), plan_.query.max_distance, scratch.near.data());
      for (std::size_t i = 0; i < count; ++i) evaluate(scratch.near[i], k);
    }
    if (scratch.to_evaluate.size() == gaps.size()) return;
    // Writes the rows of rejected pairs. Other rows of the block are overwritten later.
    for (std::size_t k = 0; k < placed.size(); ++k)
      write_beyond_rows(reply_, (first + k) * plan_.size.pairs + begin, pairs, static_cast<std::uint32_t>(first + k),
                        gaps.data() + k * pairs.size(), flags(pairs, placed[k], scratch));
  }

  // Flags of all pairs in a configuration, or null if not requested.
  const std::uint16_t* flags(std::span<const BodyPair> pairs, const BodyPoses& here, WorkerScratch& scratch) const {
    if (!reply_.flags) return nullptr;
    scratch.flags.resize(pairs.size());
    const std::size_t n = scene().bodies().size();
    for (std::size_t i = 0; i < pairs.size(); ++i)
      scratch.flags[i] = pairs[i].a < n && pairs[i].b < n ? pose_flags(here, pairs[i]) : 0;
    return scratch.flags.data();
  }

  Layout layout_;
  std::uint64_t next_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
  std::vector<WorkerScratch> scratch_;
  std::vector<Evaluator> evaluators_;
  BoxColumns columns_;
  std::vector<BoxCull> culls_;  // by worker; empty if the evaluators compare boxes
};

}  // namespace

std::unique_ptr<Job::State> make_dense_job(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<DenseJob>(context, std::move(plan), reply);
}

}  // namespace clearance
