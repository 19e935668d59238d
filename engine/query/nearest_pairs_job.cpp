// The k nearest pairs of each configuration, in the order of the query's pairs.
#include <algorithm>
#include <functional>

#include "engine/narrow/group.h"
#include "engine/query/parallel_job.h"

namespace clearance {

namespace {

/// Gap of the boxes, place.
using OrderedPair = std::pair<double, std::uint64_t>;
static_assert(sizeof(OrderedPair) + sizeof(BodyPair) == kBytesOfNearest);

class NearestPairsJob final : public ParallelJob {
 public:
  NearestPairsJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : ParallelJob(context, std::move(plan), reply), rows_(plan_.size.rows / plan_.size.configurations) {
    EvaluateOptions left = options_;
    left.cull = false;
    for (int i = 0; i < workers(); ++i) scratch_.emplace_back(scene(), left);
  }

  bool go_on(WorkMeter& slice) override {
    const bool done =
        run_units(next_, plan_.size.configurations, slice, [&](std::uint64_t k, int worker, WorkMeter& meter) {
          return answer(k, scratch_[static_cast<std::size_t>(worker)], placement(worker, k), meter);
        });
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
  struct Candidate {
    CandidateRank rank;
    PairAnswer answer;
    BodyPair pair;
  };
  struct Scratch {
    Scratch(const engine::Scene& scene, const EvaluateOptions& options) : evaluator(scene, options) {}

    Evaluator evaluator;
    bool has_begun = false, is_ordered = false, is_evaluating = false;
    std::uint64_t written = 0;  // rows
    std::vector<BodyPair> storage;
    std::span<const BodyPair> pairs;    // all
    std::vector<OrderedPair> order;     // a heap of those not evaluated yet, the nearest first
    std::vector<std::uint64_t> places;  // of those that are evaluated now
    std::vector<PlacedBodies> to_evaluate;
    std::vector<PairAnswer> answers;
    std::vector<Candidate> nearest;
  };
  static constexpr std::size_t kAtATime = 32;                                // pairs, which fill the lanes
  static constexpr std::size_t kOrderedAtATime = 1024, kSortedPerUnit = 16;  // of work

  // Adds pairs to the heap by the gaps of their boxes, those without usable poses first. Returns false if the slice
  // ended before all were added.
  bool order_pairs(Scratch& s, const BodyPoses& here, WorkMeter& meter) {
    const auto is_placed = [&](std::uint32_t body) {
      return body < scene().bodies().size() && here[body].status == Status::kOk;
    };
    while (s.order.size() < s.pairs.size()) {
      const std::size_t begin = s.order.size(), end = std::min(begin + kOrderedAtATime, s.pairs.size());
      for (std::size_t i = begin; i < end; ++i) {
        const BodyPair pair = s.pairs[i];
        const double gap = is_placed(pair.a) && is_placed(pair.b) ? box_gap(scene(), here, pair) : -__builtin_inf();
        s.order.emplace_back(gap, i);
        std::push_heap(s.order.begin(), s.order.end(), std::greater<>());
      }
      meter.count((end - begin) / kSortedPerUnit);
      if (end < s.pairs.size() && meter.is_over()) return false;
    }
    return s.is_ordered = true;
  }

  // Upper bound that a further pair must beat: that of the last row so far.
  double cut_off(const Scratch& s) const {
    const double most = plan_.query.max_distance;
    return s.nearest.size() < rows_ ? most : std::min(most, s.nearest.back().rank.upper);
  }

  bool is_left(const Scratch& s) const {
    return !s.order.empty() && (s.order.front().first <= cut_off(s) || s.nearest.size() < rows_);
  }

  // Begins to evaluate the next pairs.
  void begin_some(Scratch& s, const BodyPoses& here) {
    const std::size_t some = std::min({s.order.size(), kAtATime, std::max<std::size_t>(rows_, 8)});
    const double most = cut_off(s);
    s.to_evaluate.clear();
    s.places.clear();
    for (std::size_t i = 0; i < some; ++i) {
      std::pop_heap(s.order.begin(), s.order.end(), std::greater<>());
      s.places.push_back(s.order.back().second);
      s.order.pop_back();
      s.to_evaluate.push_back({s.pairs[s.places.back()], &here, most});
    }
    s.answers.resize(some);
    s.evaluator.begin(s.to_evaluate, s.answers);
    s.is_evaluating = true;
  }

  // Takes in their answers.
  void take_some(Scratch& s, WorkMeter& meter) {
    const double most = cut_off(s);
    for (std::size_t i = 0; i < s.answers.size(); ++i) {
      const PairAnswer& answer = s.answers[i];
      const std::uint64_t place = s.places[i];
      evaluated_.fetch_add(reached_narrow_phase(answer), std::memory_order_relaxed);
      if (answer.status == Status::kBeyond && most < plan_.query.max_distance) continue;
      const double upper = std::isnan(answer.distance) ? -__builtin_inf() : answer.upper;
      s.nearest.push_back({rank_of(answer.lower, upper, place), answer, s.pairs[place]});
    }
    std::sort(s.nearest.begin(), s.nearest.end(),
              [](const Candidate& p, const Candidate& q) { return p.rank < q.rank; });
    meter.count(s.nearest.size() / kSortedPerUnit);
    if (s.nearest.size() > rows_) s.nearest.resize(rows_);
    s.is_evaluating = false;
  }

  // Returns false if the slice ended before the rows of configuration k were written.
  bool answer(std::uint64_t k, Scratch& s, const BodyPoses& here, WorkMeter& meter) {
    if (!s.has_begun) {
      s.has_begun = true;
      s.is_ordered = false;
      s.written = 0;
      s.nearest.clear();
      s.order.clear();
      s.pairs = plan_.pairs.slice(0, plan_.size.pairs, s.storage);
      s.order.reserve(s.pairs.size());  // no more than Engine::list_bytes()
    }
    if (!s.is_ordered && !order_pairs(s, here, meter)) return false;
    while (s.is_evaluating || is_left(s)) {
      if (!s.is_evaluating) begin_some(s, here);
      if (!s.evaluator.advance(meter)) return false;
      take_some(s, meter);
      if (meter.is_over()) return false;
    }
    if (s.written == 0)
      std::sort(s.nearest.begin(), s.nearest.end(),
                [](const Candidate& p, const Candidate& q) { return p.rank.place < q.rank.place; });
    while (s.written < rows_) {
      const Candidate& row = s.nearest[s.written];
      write(k * rows_ + s.written, static_cast<std::uint32_t>(k), {row.pair, &here, 0}, row.answer, meter);
      if (++s.written < rows_ && meter.is_over()) return false;
    }
    s.has_begun = false;
    return true;
  }

  std::uint64_t rows_;            // of a configuration
  std::vector<Scratch> scratch_;  // by worker
  std::uint64_t next_ = 0;
  std::atomic<std::uint64_t> evaluated_{0};
};

}  // namespace

std::unique_ptr<Job::State> make_nearest_pairs_job(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<NearestPairsJob>(context, std::move(plan), reply);
}

}  // namespace clearance
