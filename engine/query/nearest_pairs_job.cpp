// The k nearest pairs of each configuration, in the order of the query's pairs.
#include <algorithm>

#include "engine/narrow/group.h"
#include "engine/query/parallel_job.h"

namespace clearance {

namespace {

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
          answer(k, scratch_[static_cast<std::size_t>(worker)], placement(worker, k), meter);
          return true;
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
    std::vector<BodyPair> pairs;
    std::vector<std::pair<double, std::uint64_t>> order;  // gap of the boxes, place
    std::vector<PlacedBodies> to_evaluate;
    std::vector<PairAnswer> answers;
    std::vector<Candidate> nearest;
  };
  static constexpr std::size_t kAtATime = 32;  // pairs, which fill the lanes

  // Orders all pairs by the gaps of their boxes, those without usable poses first.
  void order_pairs(Scratch& s, std::span<const BodyPair> pairs, const BodyPoses& here) {
    s.order.clear();
    const auto is_placed = [&](std::uint32_t body) {
      return body < scene().bodies().size() && here[body].status == Status::kOk;
    };
    for (std::size_t i = 0; i < pairs.size(); ++i)
      s.order.emplace_back(
          is_placed(pairs[i].a) && is_placed(pairs[i].b) ? box_gap(scene(), here, pairs[i]) : -__builtin_inf(), i);
    std::sort(s.order.begin(), s.order.end());
  }

  // Upper bound that a further pair must beat: that of the last row so far.
  double cut_off(const Scratch& s) const {
    const double most = plan_.query.max_distance;
    return s.nearest.size() < rows_ ? most : std::min(most, s.nearest.back().rank.upper);
  }

  void evaluate(Scratch& s, std::span<const std::pair<double, std::uint64_t>> some, std::span<const BodyPair> pairs,
                const BodyPoses& here) {
    s.to_evaluate.clear();
    const double most = cut_off(s);
    for (const auto& [gap, place] : some) s.to_evaluate.push_back({pairs[place], &here, most});
    s.answers.resize(some.size());
    s.evaluator.run(s.to_evaluate, s.answers);
    for (std::size_t i = 0; i < some.size(); ++i) {
      const PairAnswer& answer = s.answers[i];
      evaluated_.fetch_add(reached_narrow_phase(answer), std::memory_order_relaxed);
      if (answer.status == Status::kBeyond && most < plan_.query.max_distance) continue;
      const double upper = std::isnan(answer.distance) ? -__builtin_inf() : answer.upper;
      s.nearest.push_back({rank_of(answer.lower, upper, some[i].second), answer, pairs[some[i].second]});
    }
    std::sort(s.nearest.begin(), s.nearest.end(),
              [](const Candidate& p, const Candidate& q) { return p.rank < q.rank; });
    if (s.nearest.size() > rows_) s.nearest.resize(rows_);
  }

  void answer(std::uint64_t k, Scratch& s, const BodyPoses& here, WorkMeter& meter) {
    const std::span<const BodyPair> pairs = plan_.pairs.slice(0, plan_.size.pairs, s.pairs);
    order_pairs(s, pairs, here);
    s.nearest.clear();
    const std::span<const std::pair<double, std::uint64_t>> order = s.order;
    for (std::size_t i = 0; i < order.size() && (order[i].first <= cut_off(s) || s.nearest.size() < rows_);) {
      const std::size_t some = std::min({order.size() - i, kAtATime, std::max<std::size_t>(rows_, 8)});
      evaluate(s, order.subspan(i, some), pairs, here);
      meter.count(some);
      i += some;
    }
    std::sort(s.nearest.begin(), s.nearest.end(),
              [](const Candidate& p, const Candidate& q) { return p.rank.place < q.rank.place; });
    for (std::uint64_t r = 0; r < rows_; ++r)
      write(k * rows_ + r, static_cast<std::uint32_t>(k), {s.nearest[r].pair, &here, 0}, s.nearest[r].answer);
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
