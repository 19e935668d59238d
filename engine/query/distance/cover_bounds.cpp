#include "engine/query/distance/cover_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Tolerances from which on covers answer groups of pairs themselves. Below, they only leave pairs out, and rows have the
// same bits as those of the exact engine alone.
constexpr double kWideAbsTol = 1e-4, kWideRelTol = 1e-3;
// Most packets of balls of a group, and of a pair alone. Beyond them the exact engine is faster.
constexpr PairGroups::Packets kPacketsOfGroup{48, 768}, kPacketsOfPair{8, 64};
// DistanceLimits::pairs_divided if only the next level may follow: two moved bodies have many pairs of balls.
constexpr float kNextLevel = 3.5f;
// Tolerances below which covers only leave out pairs with meshes and clouds, since their smallest balls stand out more.
constexpr double kFineAbsTol = 2e-3, kFineRelTol = 1e-2;
// Width up to which the exact engine may leave open whether bodies touch: no distance becomes a contact because of a
// wide tolerance. Where there are surfaces, it keeps to that at any tolerance.
constexpr double kMostContact = 1e-6;
constexpr double kUp = 1 + 0x1p-20;  // more than the rounding of bounds by covers

float down(double value) {
  constexpr double kMost = -BallPacket::kNoRadius;
  const double limited = std::clamp(value, -kMost, kMost);
  const auto rounded = static_cast<float>(limited);
  return rounded > limited ? std::nextafterf(rounded, -std::numeric_limits<float>::infinity()) : rounded;
}

bool is_by_pair(const Plan& plan) {
  return plan.query.reduce == Reduce::kNone || plan.query.reduce == Reduce::kWithin;
}
// Whether bodies are single hulls whose poses are given: the exact engine answers a pair in less time than two packets of
// balls take.
bool is_fast(const Plan& plan, bool light) {
  return light && plan.motions.empty();
}
CoverBounds::Shares shares_of(const Plan& plan, bool has_surfaces) {
  if (is_by_pair(plan)) return {1, 1};
  const bool is_fine = has_surfaces && plan.query.abs_tol < kFineAbsTol && plan.query.rel_tol < kFineRelTol;
  return is_fine ? CoverBounds::Shares{0, 0.98} : CoverBounds::Shares{0.75, 0.125};
}
// Whether all columns follow from bounds.
bool needs_no_points(const Plan& plan) {
  constexpr std::uint32_t kOfBounds =
      kDefaultFields | kFieldBounds | kFieldFlags | kFieldPair | kFieldPairLower | kFieldConfiguration;
  return (plan.size.fields & ~kOfBounds) == 0;
}

}  // namespace

bool CoverBounds::is_wide(const Plan& plan, bool light) {
  double abs_tol = kWideAbsTol, rel_tol = kWideRelTol;
  // Covers leave no or few pairs out, and each row costs them some packets.
  if (is_by_pair(plan) || (plan.query.reduce == Reduce::kNearest && is_fast(plan, light))) {
    abs_tol = light ? 5e-2 : 5e-3;
    rel_tol = light ? 0.2 : 1e-2;
  }
  return plan.query.abs_tol >= abs_tol || plan.query.rel_tol >= rel_tol;
}

bool CoverBounds::may_bound(const Plan& plan, bool light) {
  if (plan.query.signed_distance || plan.query.reduce == Reduce::kAny) return false;
  if (is_by_pair(plan)) return is_wide(plan, light) && needs_no_points(plan);
  if (plan.query.reduce == Reduce::kNearest && is_fast(plan, light)) return is_wide(plan, light);
  // A state beyond max_distance needs all pairs. So does a body, and most states have one.
  return is_wide(plan, light) || plan.query.max_distance == kInf || (plan.query.reduce == Reduce::kMin && light);
}

CoverBounds::CoverBounds(const Plan& plan, const engine::Scene& scene, bool light)
    : plan_(plan),
      groups_(plan, scene, is_by_pair(plan) ? kPacketsOfPair : kPacketsOfGroup),
      has_surfaces_(scene.has_surfaces()),
      shares_(shares_of(plan, has_surfaces_)),
      wide_(is_wide(plan, light)),
      writes_rows_(wide_ && needs_no_points(plan)) {
  limits_.packets = light ? kPacketsOfGroup.light : kPacketsOfGroup.heavy;
  if (light || plan.query.reduce == Reduce::kNearest) limits_.pairs_divided[1] = kNextLevel;
  if (is_fast(plan, light)) std::ranges::fill(limits_.pairs_divided, kNextLevel);
  set_limits();
}

void CoverBounds::set_limits() {
  const double abs_tol = plan_.query.abs_tol, rel_tol = plan_.query.rel_tol;
  if (wide_) {
    limits_.scale[0] = kUp, limits_.shift[0] = -shares_.covers * abs_tol;
    limits_.scale[1] = kUp - shares_.covers * rel_tol;
    limits_.most = plan_.query.max_distance;
    limits_.any_overlap = true;
  } else {
    NarrowLimits exact;
    exact.abs_tol = abs_tol, exact.rel_tol = rel_tol;
    const double far = loser_beyond(1, exact) - loser_beyond(0, exact);
    limits_.scale[0] = limits_.scale[1] = far * kUp;
    limits_.shift[0] = limits_.shift[1] = loser_beyond(0, exact) * kUp;
  }
}

CoverBounds::Tolerance CoverBounds::exact_tolerance() const {
  const double abs_tol = plan_.query.abs_tol, rel_tol = plan_.query.rel_tol;
  if (!wide_) return {abs_tol, rel_tol};
  return {std::max(std::min(abs_tol, kMostContact), has_surfaces_ ? shares_.exact * abs_tol : 0),
          std::max(shares_.exact * rel_tol, std::min(rel_tol, 1e-6))};
}

void CoverBounds::take(const CoverPlan& covers, std::span<const StillBounds> still) {
  still_.clear();
  for (const StillBounds& pair : still) still_.push_back({down(pair.lower), -down(-pair.upper), pair.position});
  groups_.take(covers, still_);
  const DecisionView& view = covers.view();
  moved_inner_.assign((view.moved_pair_count + BallPacket::kBalls - 1) / BallPacket::kBalls * BallPacket::kBalls,
                      BallPacket::kNoRadius);
  tabled_.clear();
  const std::uint32_t of_obstacles = view.obstacle_count * view.columns;
  for (std::uint32_t cell = 0; cell < of_obstacles; ++cell)
    if (view.table[cell] != kNoTable) tabled_.push_back({cell, view.table[cell]});
  for (std::uint32_t k = 0; k < view.moved_pair_count; ++k) {
    const MovedPair& pair = view.moved_pairs[k];
    if (pair.table != kNoTable) tabled_.push_back({of_obstacles + k, pair.table});
    const double inner = double{view.moved_root_inner[pair.a]} + view.moved_root_inner[pair.b] + pair.shrink;
    moved_inner_[k] = static_cast<float>(inner - std::abs(inner) * 0x1p-23);
  }
}

std::span<const DistanceBounds> CoverBounds::bound(DistanceBatch batch, Room& room) const {
  constexpr std::uint64_t kMostLeft = 32;  // pairs of a state, on average; beyond it all are left
  const DecisionView& view = *batch.view;
  batch.moved_inner = moved_inner_.data();
  batch.limits = limits_;
  batch.groups = groups_.is_one() ? nullptr : &groups_.view();
  batch.still = still_;
  batch.tabled = tabled_;
  room.bounds.resize(batch.states * groups_.count());
  // A pair is in two groups or fewer.
  room.left.resize(batch.states * (groups_.is_one() ? kMostLeft : 2 * plan_.pairs.size()));
  room.lows.resize(std::size_t{view.obstacle_count} * view.columns + moved_inner_.size() + still_.size());
  room.highs.resize(room.lows.size());
  room.items.resize(std::size_t{3} * kMostDistanceItems);
  distance_kernels()[0].run(batch, {room.bounds.data(), room.left.data(), static_cast<std::uint32_t>(room.left.size()),
                                    room.lows.data(), room.items.data(), room.highs.data()});
  return room.bounds;
}

bool CoverBounds::answers(const DistanceBounds& bounds, PairAnswer& answer) const {
  if (!writes_rows_) return false;
  answer = empty_answer();
  answer.lower = bounds.lower;
  answer.upper = answer.distance = bounds.upper;
  if (bounds.upper <= 0) {
    answer.lower = answer.upper = answer.distance = 0;
    answer.status = Status::kOverlap;
    return true;
  }
  if (bounds.left_end > bounds.left_begin || !(bounds.lower > 0)) return false;
  if (bounds.lower > plan_.query.max_distance) {
    answer.distance = bounds.lower;
    return true;
  }
  answer.status = Status::kOk;
  return is_narrow_enough(bounds.lower, bounds.upper);
}

void CoverBounds::to_tolerance(PairAnswer& answer) const {
  if (std::isnan(answer.distance)) return;
  if (answer.status == Status::kBeyond && answer.lower < kInf && !(answer.lower > plan_.query.max_distance)) {
    answer.status = Status::kUnconverged;
    answer.distance = answer.upper;
  }
  const bool is_narrow = is_narrow_enough(answer.lower, answer.upper);
  if (is_narrow) answer.flags &= static_cast<std::uint16_t>(~kFlagUncertaintyLimited);
  if (answer.lower > 0 && (answer.status == Status::kOk || answer.status == Status::kUnconverged))
    answer.status = is_narrow || (answer.flags & kFlagUncertaintyLimited) ? Status::kOk : Status::kUnconverged;
}

}  // namespace clearance
