#include <algorithm>
#include <cassert>
#include <optional>
#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/query/job_state.h"
#include "engine/query/kept_jobs.h"
#include "engine/query/parallel_job.h"
#include "engine/reduce/box_cull.h"
#include "engine/reduce/configuration_block.h"
#include "engine/reduce/reduction.h"

namespace clearance {

namespace {

constexpr std::uint64_t kBlock = 512, kHeavyBlock = 256;  // pair-configurations that are evaluated at a time
constexpr std::uint64_t kUnit = 4096, kHeavyUnit = 1024;  // ... that a thread takes at a time, if there are many
constexpr std::uint64_t kFewest = 64;                     // ... if they are few
constexpr std::uint64_t kBoxesPerUnit = 64;               // of work
constexpr std::uint64_t kSideBySide = 64;                 // configurations that a thread has placed at a time
constexpr std::uint64_t kWholeConfigurations =
    16384;  // pairs up to which a reduction is one unit for each configuration

// One row for each configuration and pair.
class DenseJob final : public ParallelJob {
 public:
  DenseJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply), rooms_(static_cast<std::size_t>(workers())) {
    // Where all boxes are made, whole blocks of pairs are compared at once; else each pair makes its own.
    EvaluateOptions left = options_;
    if (options_.cull && !boxes().empty()) {
      left.cull = false;
      columns_.assign(boxes());
      for (int i = 0; i < workers(); ++i) culls_.emplace_back(scene(), boxes(), columns_);
    }
    for (int i = 0; i < workers(); ++i) evaluators_.emplace_back(scene(), left);
    layout_ = Layout(plan_, BodyPoses::most(scene(), plan_), context.light, !culls_.empty(), workers());
    // What is too large for warm state is not looked at for it.
    const bool fits = plan_.size.rows <= WarmStore::kMostSimplices;
    if (const std::uint64_t client = plan_.query.warm_slot; client != 0 && fits && !options_.reference)
      warm_ = context_.warm->take(client, warm_question(plan_), plan_.size.configurations * plan_.size.pairs);
  }

  ~DenseJob() override {
    if (warm_) context_.warm->put_back(std::move(warm_));
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
  // A unit is a block of pairs in a block of configurations, so that lanes find pairs of the same two hulls.
  struct Layout {
    std::uint64_t configurations = 1, pairs = 1;  // of one unit
    std::uint64_t configuration_blocks = 0, pair_blocks = 0;
    std::uint64_t block = 1;  // pair-configurations that are evaluated at a time

    Layout() = default;
    /// \param most configurations that are placed at a time. \param cull boxes are compared for a whole unit at a time,
    /// so that what they leave fills the lanes.
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
  struct Place {  // in a block
    std::uint32_t configuration, pair;
  };
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};
  struct WorkerScratch {
    std::uint64_t next = kNowhere;  // pair of the unit whose block is answered now; kNowhere: of none
    bool is_asked = false;          // that block has begun
    std::vector<BodyPair> pairs;
    std::vector<PlacedBodies> asked;
    std::vector<Place> places;  // of those asked
    std::vector<PairAnswer> answers;
    std::vector<std::uint32_t> near;  // in a configuration of a block
    std::vector<std::uint16_t> flags;
  };

  bool run(std::uint64_t unit, int worker, WorkMeter& meter) {
    assert(unit < layout_.pair_blocks * layout_.configuration_blocks);
    WorkerScratch& room = rooms_[static_cast<std::size_t>(worker)];
    Evaluator& evaluator = evaluators_[static_cast<std::size_t>(worker)];
    const std::uint64_t first = unit / layout_.pair_blocks * layout_.configurations,
                        begin = unit % layout_.pair_blocks * layout_.pairs;
    const std::uint64_t configurations = std::min(layout_.configurations, plan_.size.configurations - first);
    const std::uint64_t end = std::min(begin + layout_.pairs, plan_.size.pairs);
    const std::span<const BodyPoses> placed = placements(worker, first, configurations);
    const std::uint64_t step = std::max<std::uint64_t>(layout_.block / configurations, 1);
    if (room.next == kNowhere) room.next = begin;
    while (room.next < end) {
      if (!std::exchange(room.is_asked, true)) {
        const auto pairs = plan_.pairs.slice(room.next, std::min(step, end - room.next), room.pairs);
        take(pairs, room.next, placed, first, worker);
        meter.count(pairs.size() * configurations / kBoxesPerUnit);
        room.answers.resize(std::max(room.answers.size(), room.asked.size()));
        evaluator.begin(room.asked, room.answers);
      }
      if (!evaluator.advance(meter)) return false;
      write_block(room, first);
      room.is_asked = false;
      room.next += step;
      if (room.next < end && meter.is_over()) return false;
    }
    room.next = kNowhere;
    return true;
  }

  // The rows of a block that is answered.
  void write_block(const WorkerScratch& room, std::uint64_t first) {
    std::uint64_t evaluated = 0;
    for (std::size_t i = 0; i < room.asked.size(); ++i) {
      const auto [k, at] = room.places[i];
      write((first + k) * plan_.size.pairs + room.next + at, static_cast<std::uint32_t>(first + k), room.asked[i],
            room.answers[i]);
      evaluated += reached_narrow_phase(room.answers[i]);
    }
    evaluated_.fetch_add(evaluated, std::memory_order_relaxed);
  }

  // Asks for a block of pairs, from `begin` on, in configurations from `first` on: all but those that boxes answer.
  void take(std::span<const BodyPair> pairs, std::uint64_t begin, std::span<const BodyPoses> placed,
            std::uint64_t first, int worker) {
    WorkerScratch& room = rooms_[static_cast<std::size_t>(worker)];
    room.asked.clear();
    room.places.clear();
    assert(begin + pairs.size() <= plan_.size.pairs && first + placed.size() <= plan_.size.configurations);
    const auto ask = [&](std::size_t i, std::size_t k) {
      room.asked.push_back({pairs[i], &placed[k], plan_.query.max_distance, warm(first + k, begin + i)});
      room.places.push_back({static_cast<std::uint32_t>(k), static_cast<std::uint32_t>(i)});
    };
    if (culls_.empty()) {
      for (std::size_t i = 0; i < pairs.size(); ++i)
        for (std::size_t k = 0; k < placed.size(); ++k) ask(i, k);
      return;
    }
    const std::span<const double> gaps = culls_[static_cast<std::size_t>(worker)].gaps(pairs, placed);
    room.near.resize(std::max(room.near.size(), pairs.size()));
    for (std::size_t k = 0; k < placed.size(); ++k) {
      const std::size_t count =
          gaps_within(gaps.data() + k * pairs.size(), pairs.size(), plan_.query.max_distance, room.near.data());
      for (std::size_t i = 0; i < count; ++i) ask(room.near[i], k);
    }
    if (room.asked.size() == gaps.size()) return;
    // Rows of the others, and under those that are still to be written.
    for (std::size_t k = 0; k < placed.size(); ++k)
      write_beyond_rows(reply_, (first + k) * plan_.size.pairs + begin, pairs, static_cast<std::uint32_t>(first + k),
                        gaps.data() + k * pairs.size(), flags(pairs, placed[k], room));
  }

  // Of all pairs in a configuration; null where nobody asks.
  const std::uint16_t* flags(std::span<const BodyPair> pairs, const BodyPoses& here, WorkerScratch& room) const {
    if (!reply_.flags) return nullptr;
    room.flags.resize(pairs.size());
    const std::size_t n = scene().bodies().size();
    for (std::size_t i = 0; i < pairs.size(); ++i)
      room.flags[i] = pairs[i].a < n && pairs[i].b < n ? pose_flags(here, pairs[i]) : 0;
    return room.flags.data();
  }

  WarmSimplex* warm(std::uint64_t configuration, std::uint64_t pair) const {
    assert(!warm_ || configuration * plan_.size.pairs + pair < warm_->simplices.size());
    return warm_ ? &warm_->simplices[configuration * plan_.size.pairs + pair] : nullptr;
  }

  Layout layout_;
  std::unique_ptr<WarmTable> warm_;
  std::uint64_t next_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
  std::vector<WorkerScratch> rooms_;
  std::vector<Evaluator> evaluators_;
  BoxColumns columns_;
  std::vector<BoxCull> culls_;  // of each worker; empty: the evaluators compare boxes
};

// Reduced rows. Few pairs: blocks of configurations side by side, one thread each. Many: one configuration at a time,
// its stages spread over all threads.
class ReducedJob final : public ParallelJob {
 public:
  ReducedJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply),
        whole_(plan_.size.pairs <= kWholeConfigurations),
        near_pairs_(scene(), plan_, boxes(), *context.trees, options_.cull ? context.near_by : NearBy::kBrute) {
    columns_.assign(boxes());
    const Reduction::Boxes all{boxes(), columns_, near_pairs_};
    if (whole_) {
      block_ = ConfigurationBlock::most(scene(), plan_, near_pairs_.by_tree(), !boxes().empty(), workers());
      for (int i = 0; i < workers(); ++i) blocks_.emplace_back(scene(), plan_, options_, all, block_);
    } else {
      reduction_.emplace(scene(), plan_, options_, all, workers());
    }
  }

  bool go_on(WorkMeter& slice) override {
    const bool done = whole_ ? advance_side_by_side(slice) : advance_one_by_one(slice);
    if (done) {
      info.rows = written_;
      context_.pairs_evaluated->fetch_add(info.pairs_evaluated, std::memory_order_relaxed);
    }
    return done;
  }

  void rewind() override {
    first_ = next_ = written_ = 0;
    evaluated_ = 0;
  }

 private:
  bool advance_side_by_side(WorkMeter& slice) {
    // A batch of blocks at a time, so that rows come in order and wait in bounded memory.
    const std::uint64_t count = plan_.size.configurations;
    const std::uint64_t most = std::max<std::uint64_t>(block_, 64) / block_ * block_ * blocks_.size();
    while (true) {
      if (batch_rows_.empty()) batch_rows_.resize(std::min<std::uint64_t>(count - first_, most));
      const bool batch_done =
          run_units(next_, (batch_rows_.size() + block_ - 1) / block_, slice,
                    [&](std::uint64_t i, int worker, WorkMeter& meter) { return reduce(i, worker, meter); });
      if (!batch_done) return false;
      for (const auto& rows : batch_rows_) write(rows);
      first_ += batch_rows_.size();
      batch_rows_.clear();
      next_ = 0;
      info.pairs_evaluated = evaluated_;
      if (first_ == count) return true;
      if (slice.is_over()) return false;
    }
  }

  // The rows of one block of the batch.
  bool reduce(std::uint64_t i, int worker, WorkMeter& meter) {
    ConfigurationBlock& block = blocks_[static_cast<std::size_t>(worker)];
    const std::uint64_t begin = i * block_, count = std::min<std::uint64_t>(block_, batch_rows_.size() - begin);
    if (!block.has_begun()) block.begin(placements(worker, first_ + begin, count), first_ + begin);
    if (!block.advance(meter)) return false;
    evaluated_.fetch_add(block.end(std::span(batch_rows_).subspan(begin, count)), std::memory_order_relaxed);
    return true;
  }

  bool advance_one_by_one(WorkMeter& slice) {
    Reduction& r = *reduction_;
    while (first_ < plan_.size.configurations) {
      if (!begun_) r.begin();
      begun_ = true;
      for (; r.stage() != Reduction::kDone; r.end_stage(), next_ = 0) {
        const bool stage_done = run_units(
            next_, r.units(), slice,
            [&](std::uint64_t unit, int worker, WorkMeter& meter) {
              return r.run(unit, worker, placement(worker, first_), meter);
            },
            !r.worth_threads(context_.light));
        if (!stage_done) return false;
      }
      write(r.rows(static_cast<std::uint32_t>(first_), placement(0, first_)));
      info.pairs_evaluated += r.evaluated();
      begun_ = false;
      if (++first_ < plan_.size.configurations && slice.is_over()) return false;
    }
    return true;
  }

  void write(const std::vector<Row>& rows) {
    for (const Row& row : rows) {
      ++info.total;
      if (written_ < plan_.size.rows) write_row(reply_, written_++, row);
    }
  }

  bool whole_;
  NearPairs near_pairs_;
  BoxColumns columns_;
  std::uint64_t block_ = 1;                 // configurations of a block
  std::vector<ConfigurationBlock> blocks_;  // of each worker, if whole_
  std::optional<Reduction> reduction_;      // if not
  std::vector<std::vector<Row>> batch_rows_;
  std::uint64_t first_ = 0, next_ = 0, written_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
  bool begun_ = false;
};

}  // namespace

std::unique_ptr<Job::State> make_cpu_job(const JobContext& context, Plan plan, const ReplyView& reply) {
  plan.keep_configurations();
  const bool may_be_kept = plan.question && KeptJobs::keeps(plan.size);
  std::unique_ptr<Job::State> job;
  if (plan.query.reduce == Reduce::kNone)
    job = std::make_unique<DenseJob>(context, std::move(plan), reply);
  else
    job = std::make_unique<ReducedJob>(context, std::move(plan), reply);
  if (may_be_kept) job->keeper = context.kept;
  return job;
}

PreparedQuery::PreparedQuery(std::unique_ptr<Planner> planner) : planner_(std::move(planner)) {}
PreparedQuery::PreparedQuery(Job::StatePtr again) : again_(std::move(again)) {}
PreparedQuery::PreparedQuery(PreparedQuery&&) noexcept = default;
PreparedQuery& PreparedQuery::operator=(PreparedQuery&&) noexcept = default;
PreparedQuery::~PreparedQuery() = default;
const Plan& PreparedQuery::plan() const {
  return again_ ? *again_->plan_to_ask_again() : planner_->plan();
}
bool PreparedQuery::advance(const WorkBudget& budget) {
  if (again_) return true;
  const FpEnvironment environment;
  WorkMeter slice(budget);
  const bool is_ready = planner_->advance(slice);
  units_of_this_thread += slice.spent();
  return is_ready;
}
const QuerySize& PreparedQuery::size() const {
  return plan().size;
}
void PreparedQuery::copy_pairs(std::uint64_t begin, std::uint64_t count, BodyPair* out) const {
  plan().pairs.copy(begin, count, out);
}
std::uint64_t PreparedQuery::bytes() const {
  const Plan& p = plan();
  return p.pairs.list().size_bytes() + p.configurations.size_bytes() + p.positions.size_bytes();
}
void PreparedQuery::begin_cold() {
  if (planner_) planner_->plan().query.warm_slot = 0;
}
void PreparedQuery::keep_on_cpu() {
  keep_on_cpu_ = true;
}

Job::Job(StatePtr state) : state_(std::move(state)) {}
Job::Job(Job&&) noexcept = default;
Job& Job::operator=(Job&&) noexcept = default;
Job::~Job() = default;
bool Job::advance(const WorkBudget& budget) {
  const FpEnvironment environment;
  const std::uint64_t before = state_->units;
  const bool timed = state_->when_done != nullptr;
  const Clock::time_point begin = timed ? Clock::now() : Clock::time_point();
  const bool done = state_->advance(budget);
  units_of_this_thread += state_->units - before;
  if (!timed) return done;
  state_->took += Clock::now() - begin;
  if (done) std::exchange(state_->when_done, nullptr)(state_->info, state_->took);
  return done;
}
std::uint64_t Job::units() const {
  return state_->units;
}
const QuerySize& Job::size() const {
  return state_->size();
}
const ReplyInfo& Job::info() const {
  return state_->info;
}

}  // namespace clearance
