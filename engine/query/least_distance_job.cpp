#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "engine/decision/distance_view.h"
#include "engine/query/covered_job.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Tolerances from which on covers answer states themselves. Below, they only leave pairs out, and rows have the same
// bits as those of the exact engine alone.
constexpr double kWideAbsTol = 1e-4, kWideRelTol = 1e-3;
// Shares of such a tolerance that covers and the exact engine may use: the bounds of a row may come from both.
constexpr double kShareOfCovers = 0.75, kShareOfExact = 0.125;
// Width up to which the exact engine may leave open whether bodies touch: no distance becomes a contact because of a
// wide tolerance.
constexpr double kMostContact = 1e-6;

bool has_wide_tolerance(const Plan& plan) {
  return plan.query.abs_tol >= kWideAbsTol || plan.query.rel_tol >= kWideRelTol;
}

// Bounds the least distance of states by covers as far as they have been made, and lets the exact engine evaluate the
// pairs that may be the nearest.
class LeastDistanceJob final : public CoveredJob {
 public:
  LeastDistanceJob(const JobContext& context, Plan&& plan, const ReplyView& reply)
      : CoveredJob(context, std::move(plan), reply),
        wide_(has_wide_tolerance(plan_)),
        rooms_(static_cast<std::size_t>(workers())) {
    const double abs_tol = plan_.query.abs_tol, rel_tol = plan_.query.rel_tol;
    make_blocks(wide_ ? std::min(abs_tol, kMostContact) : abs_tol,
                wide_ ? std::max(kShareOfExact * rel_tol, std::min(rel_tol, 1e-6)) : rel_tol);
    constexpr std::uint32_t kOfBounds =
        kDefaultFields | kFieldBounds | kFieldFlags | kFieldPair | kFieldPairLower | kFieldConfiguration;
    needs_no_points_ = wide_ && (plan_.size.fields & ~kOfBounds) == 0;
    constexpr double kUp = 1 + 0x1p-20;  // more than the rounding of bounds by covers
    if (wide_) {
      limits_.scale[0] = kUp, limits_.shift[0] = -kShareOfCovers * abs_tol;
      limits_.scale[1] = kUp - kShareOfCovers * rel_tol;
      limits_.most = plan_.query.max_distance;
      limits_.any_overlap = true;
    } else {
      const double far = loser_beyond(1, options_.limits) - loser_beyond(0, options_.limits);
      limits_.scale[0] = limits_.scale[1] = far * kUp;
      limits_.shift[0] = limits_.shift[1] = loser_beyond(0, options_.limits) * kUp;
    }
  }

 private:
  /// A worker's bounds.
  struct Room {
    std::vector<DistanceBounds> bounds;
    std::vector<LeftPair> left;
    std::vector<float> lows, moved_inner;
    std::vector<DistanceItem> items;
    std::vector<std::pair<double, std::uint64_t>> aside;  // by state left: lower bound, position of its pair
  };

  void answer_by_covers(const States& states, int worker, LeftStates& left) override {
    Room& room = rooms_[static_cast<std::size_t>(worker)];
    bound(states, room);
    room.aside.clear();
    for (std::uint64_t k = 0; k < states.count; ++k) {
      const DistanceBounds& bounds = room.bounds[k];
      if (write_bounded(bounds, states.begin + k)) continue;
      leave(room, bounds, states.begin + k, left);
      room.aside.emplace_back(bounds.is_listed && wide_ ? bounds.lower : kInf, bounds.lower_at);
    }
  }

  void bound(const States& states, Room& room) const {
    const DecisionView& view = covers().view();
    const std::size_t moved =
        (view.moved_pair_count + BallPacket::kBalls - 1) / BallPacket::kBalls * BallPacket::kBalls;
    room.bounds.resize(states.count);
    room.left.resize(states.count * kMostLeft);
    room.lows.resize(std::size_t{view.obstacle_count} * view.columns + moved);
    room.items.resize(std::size_t{3} * kMostDistanceItems);
    room.moved_inner.assign(moved, BallPacket::kNoRadius);
    for (std::uint32_t k = 0; k < view.moved_pair_count; ++k) {
      const MovedPair& pair = view.moved_pairs[k];
      const double inner = double{view.moved_root_inner[pair.a]} + view.moved_root_inner[pair.b] + pair.shrink;
      room.moved_inner[k] = static_cast<float>(inner - std::abs(inner) * 0x1p-23);
    }
    distance_kernels()[0].run({&view, room.moved_inner.data(), limits_, states.poses, states.stride, states.count,
                               states.usable, states.positions, states.position_stride},
                              {room.bounds.data(), room.left.data(), static_cast<std::uint32_t>(room.left.size()),
                               room.lows.data(), room.items.data()});
  }

  bool is_narrow_enough(double lower, double upper) const {
    return is_narrow(upper - lower, upper, plan_.query.abs_tol, plan_.query.rel_tol);
  }

  // Writes the row of a state whose bounds by covers suffice.
  bool write_bounded(const DistanceBounds& bounds, std::uint64_t configuration) {
    if (!needs_no_points_ || !bounds.is_listed || !covers().unknown().empty()) return false;
    PairAnswer answer = empty_answer();
    answer.lower = bounds.lower;
    answer.upper = answer.distance = bounds.upper;
    if (bounds.upper <= 0) {
      answer.lower = answer.upper = answer.distance = 0;
      answer.status = Status::kOverlap;
    } else if (bounds.left_end > bounds.left_begin || !(bounds.lower > 0)) {
      return false;
    } else if (bounds.lower > plan_.query.max_distance) {
      answer.distance = bounds.lower;
    } else if (is_narrow_enough(bounds.lower, bounds.upper)) {
      answer.status = Status::kOk;
    } else {
      return false;
    }
    const std::uint64_t lower_at = bounds.upper <= 0 ? bounds.upper_at : bounds.lower_at;
    write_row(reply_, configuration,
              Row{plan_.pairs.at(bounds.upper_at),
                  static_cast<std::uint32_t>(configuration),
                  answer,
                  {},
                  {},
                  plan_.pairs.at(lower_at),
                  {}});
    return true;
  }

  // Lists the pairs that may be the nearest, that which gives the upper bound, and the unknown ones.
  void leave(const Room& room, const DistanceBounds& bounds, std::uint64_t configuration, LeftStates& left) const {
    if (!bounds.is_listed) return left.add_all(configuration, plan_.pairs.size());
    std::vector<std::uint64_t>& pairs = left.add(configuration);
    for (std::uint32_t i = bounds.left_begin; i < bounds.left_end; ++i) pairs.push_back(room.left[i].position);
    pairs.push_back(bounds.upper_at);
    pairs.insert(pairs.end(), covers().unknown().begin(), covers().unknown().end());
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  }

  void write_exact(std::uint64_t configuration, std::size_t index, int worker, Row& row) override {
    if (wide_ && !std::isnan(row.answer.distance)) widen(row, index, worker);
    write_row(reply_, configuration, row);
  }
  // The row reaches down to what covers laid aside. Its status is that of the query's tolerance; the exact engine had a
  // narrower one, beyond which only slack may have widened its intervals.
  void widen(Row& row, std::size_t index, int worker) const {
    PairAnswer& answer = row.answer;
    if (index != kNone) {
      const auto [lower, position] = rooms_[static_cast<std::size_t>(worker)].aside[index];
      if (lower < answer.lower) {
        answer.lower = lower;
        row.pair_lower = plan_.pairs.at(position);
      }
    }
    if (answer.status == Status::kBeyond && !(answer.lower > plan_.query.max_distance)) {
      answer.status = Status::kUnconverged;
      answer.distance = answer.upper;
    }
    const bool is_narrow = is_narrow_enough(answer.lower, answer.upper);
    if (is_narrow) answer.flags &= static_cast<std::uint16_t>(~kFlagUncertaintyLimited);
    if (answer.lower > 0 && (answer.status == Status::kOk || answer.status == Status::kUnconverged))
      answer.status = is_narrow || (answer.flags & kFlagUncertaintyLimited) ? Status::kOk : Status::kUnconverged;
  }

  static constexpr std::uint64_t kMostLeft = 32;  // pairs of a state, on average; beyond it all are left

  bool wide_, needs_no_points_ = false;
  DistanceLimits limits_;
  std::vector<Room> rooms_;  // by worker
};

}  // namespace

bool covers_may_bound(const JobContext& context, const Plan& plan) {
  return context.covers && !context.reference && context.near_by != NearBy::kTree &&
         plan.query.reduce == Reduce::kMin && !plan.query.signed_distance &&
         (plan.query.max_distance == kInf || has_wide_tolerance(plan)) && CoverPlan::may_decide(plan);
}

std::unique_ptr<Job::State> make_least_distance_job(const JobContext& context, Plan&& plan, const ReplyView& reply) {
  return std::make_unique<LeastDistanceJob>(context, std::move(plan), reply);
}

}  // namespace clearance
