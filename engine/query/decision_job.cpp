#include <algorithm>
#include <utility>
#include <vector>

#include "engine/query/covered_job.h"

namespace clearance {

namespace {

// Decides states by covers as far as they have been made, and lets the exact engine evaluate the pairs that they leave
// open. Rows have the same bits as those of the exact engine alone, unless only verdicts and pairs are requested, which
// covers give themselves.
class DecisionJob final : public CoveredJob {
 public:
  DecisionJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : CoveredJob(context, std::move(plan), reply),
        any_hit_((plan_.size.fields & ~(kFieldVerdict | kFieldConfiguration)) == 0),
        needs_no_row_((plan_.size.fields & ~(kFieldVerdict | kFieldConfiguration | kFieldPair)) == 0),
        rooms_(static_cast<std::size_t>(workers())),
        free_(beyond_all_margins(plan_)) {
    make_blocks(plan_.query.abs_tol, plan_.query.rel_tol);
    hit_.status = Status::kOk;
  }

 private:
  /// A worker's decisions.
  struct Room {
    std::vector<Decision> decisions;
    std::vector<std::uint64_t> open;  // positions
  };

  void answer_by_covers(const States& states, int worker, LeftStates& left) override {
    Room& room = rooms_[static_cast<std::size_t>(worker)];
    room.decisions.resize(states.count);
    room.open.resize(states.count * kMostOpen);
    decision_kernels()[0].run({&covers().view(), states.poses, states.stride, states.count, states.usable, any_hit_,
                               states.positions, states.position_stride, states.frames, states.cells},
                              {room.decisions.data(), room.open.data(), static_cast<std::uint32_t>(room.open.size())});
    for (std::uint64_t k = 0; k < states.count; ++k)
      if (const Decision& decision = room.decisions[k]; !write_decided(decision, states.begin + k))
        leave(room, decision, states.begin + k, left);
  }

  // Writes the row of a state that needs no exact evaluation.
  bool write_decided(const Decision& decision, std::uint64_t configuration) {
    const bool is_free = decision.verdict == Verdict::kFree && covers().unknown().empty();
    const bool is_hit = decision.verdict == Verdict::kHit && needs_no_row_ &&
                        (any_hit_ || (decision.open_begin == decision.open_end && is_first(decision.hit)));
    if (!is_free && !is_hit) return false;
    const BodyPair pair = is_hit && reply_.pair ? plan_.pairs.at(decision.hit) : BodyPair{kNone, kNone};
    write_row(reply_, configuration, pair, static_cast<std::uint32_t>(configuration), is_free ? free_ : hit_, {}, {});
    return true;
  }
  // Whether no pair that covers do not know comes before a position.
  bool is_first(std::uint64_t position) const {
    return covers().unknown().empty() || position < covers().unknown().front();
  }

  // Lists the pairs that are left to the exact engine: those open before the first hit, that one, and the unknown ones.
  void leave(const Room& room, const Decision& decision, std::uint64_t configuration, LeftStates& left) const {
    if (!decision.is_listed) return left.add_all(configuration, plan_.pairs.size());
    std::vector<std::uint64_t>& open = left.add(configuration);
    open.assign(room.open.begin() + decision.open_begin, room.open.begin() + decision.open_end);
    if (decision.verdict == Verdict::kHit) open.push_back(decision.hit);
    open.insert(open.end(), covers().unknown().begin(), covers().unknown().end());
    std::sort(open.begin(), open.end());
    open.erase(std::unique(open.begin(), open.end()), open.end());
  }

  static constexpr std::uint64_t kMostOpen = 32;  // pairs of a state, on average; beyond it all are open

  bool any_hit_, needs_no_row_;
  std::vector<Room> rooms_;  // by worker
  PairAnswer free_, hit_{};
};

}  // namespace

bool covers_may_decide(const JobContext& context, const Plan& plan) {
  constexpr std::uint32_t kOfExactRows = kFieldFreeScale | kFieldGradientJoints;
  return context.covers && !context.reference && context.near_by != NearBy::kTree &&
         plan.query.reduce == Reduce::kAny && !(plan.size.fields & kOfExactRows) && CoverPlan::may_decide(plan);
}

std::unique_ptr<Job::State> make_decision_job(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<DecisionJob>(context, std::move(plan), reply);
}

}  // namespace clearance
