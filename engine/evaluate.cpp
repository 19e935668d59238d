#include "evaluate.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr Vec3d kNanVec{kNan, kNan, kNan};
constexpr Aabb kEmptyBox{{kInf, kInf, kInf}, {-kInf, -kInf, -kInf}};

struct PiecePair {
  double gap;
  std::uint32_t a, b;
};

// The piece pairs of two bodies, nearest boxes first.
std::vector<PiecePair> piece_pairs(const Body& a, const PlacedPose& pose_a, const Body& b, const PlacedPose& pose_b) {
  std::vector<Aabb> boxes_b;
  for (const PiecePtr& piece : b.pieces) boxes_b.push_back(certify_box(*piece, pose_b.R_wb, pose_b.t_w));
  std::vector<PiecePair> pairs;
  for (std::uint32_t i = 0; i < a.pieces.size(); ++i) {
    const Aabb box = certify_box(*a.pieces[i], pose_a.R_wb, pose_a.t_w);
    for (std::uint32_t j = 0; j < boxes_b.size(); ++j) pairs.push_back({certify_box_gap(box, boxes_b[j]), i, j});
  }
  std::sort(pairs.begin(), pairs.end(), [](const PiecePair& p, const PiecePair& q) {
    return std::tie(p.gap, p.a, p.b) < std::tie(q.gap, q.a, q.b);
  });
  return pairs;
}

}  // namespace

Aabb body_box(const Body& body, const BodyPlacement& placement) {
  Aabb box = kEmptyBox;
  if (placement.status != Status::kOk) return box;
  for (const PiecePtr& piece : body.pieces) {
    const Aabb p = certify_box(*piece, placement.pose.R_wb, placement.pose.t_w);
    for (int k = 0; k < 3; ++k) {
      box.low[k] = std::min(box.low[k], p.low[k]);
      box.high[k] = std::max(box.high[k], p.high[k]);
    }
  }
  return box;
}

Placement::Placement(const Scene& scene, const Plan& plan, std::span<const Aabb> boxes)
    : scene_(scene), plan_(plan), boxes_(boxes) {
  if (plan.query.configuration_count == 0) return;
  moved_slot_.assign(scene.bodies().size(), kNone);
  for (const std::uint32_t b : plan.moved) {
    moved_slot_[b] = static_cast<std::uint32_t>(local_.size());
    local_.push_back(plan.snapshot->local[b]);
  }
  moved_.resize(local_.size());
  moved_boxes_.resize(local_.size());
}

void Placement::configure(std::uint64_t k) {
  if (moved_slot_.empty() || k == configuration_) return;
  configuration_ = k;
  const PoseSnapshot& snapshot = *plan_.snapshot;
  const std::size_t count = plan_.bodies.size();
  for (std::size_t m = 0; m < count; ++m) local_[moved_slot_[plan_.bodies[m]]] = plan_.configurations[k * count + m];
  for (std::size_t i = 0; i < plan_.moved.size(); ++i) {
    const std::uint32_t body = plan_.moved[i], parent = snapshot.parent[body];
    moved_[i] = place(&local_[i], parent == kNone ? nullptr : &(*this)[parent]);
    if (!boxes_.empty()) moved_boxes_[i] = body_box(scene_.bodies()[body], moved_[i]);
  }
}

Aabb Placement::box(std::uint32_t body) const {
  if (boxes_.empty()) return body_box(scene_.bodies()[body], (*this)[body]);
  return moved_slot_.empty() || moved_slot_[body] == kNone ? boxes_[body] : moved_boxes_[moved_slot_[body]];
}

bool is_unusable(const Scene& scene, const Placement& placement, BodyPair pair) {
  for (const std::uint32_t body : {pair.a, pair.b})
    if (body >= scene.bodies().size() || placement[body].status != Status::kOk) return true;
  return false;
}

double box_gap(const Scene& scene, const Placement& placement, BodyPair pair) {
  const std::size_t n = scene.bodies().size();
  if (pair.a >= n || pair.b >= n) return kInf;
  return certify_box_gap(placement.box(pair.a), placement.box(pair.b));
}

PairAnswer no_answer(Status status) {
  return {kNan, -kInf, kInf, status, 0, kNone, kNone, kNanVec, kNanVec, kNanVec};
}

namespace {

PairAnswer beyond_answer(double lower) {
  return {lower, lower, kInf, Status::kBeyond, 0, kNone, kNone, kNanVec, kNanVec, kNanVec};
}

}  // namespace

PairAnswer evaluate(const Scene& scene, const Placement& placement, BodyPair pair, const EvaluateOptions& options) {
  if (pair.a >= scene.bodies().size() || pair.b >= scene.bodies().size()) return no_answer(Status::kUnknownBody);
  const BodyPlacement &at_a = placement[pair.a], &at_b = placement[pair.b];
  std::uint16_t flags = at_a.renormalised || at_b.renormalised ? kFlagRenormalised : 0;
  if (!options.stale.empty() && (options.stale[pair.a] || options.stale[pair.b])) flags |= kFlagStale;
  for (const Status unusable : {Status::kBadPose, Status::kNoPose})
    if (at_a.status == unusable || at_b.status == unusable) {
      PairAnswer answer = no_answer(unusable);
      answer.flags = flags;
      return answer;
    }
  const NarrowLimits& limits = options.limits;
  if (options.cull) {
    const double gap = box_gap(scene, placement, pair);
    if (gap > limits.max_distance) {
      PairAnswer answer = beyond_answer(gap);
      answer.flags = flags;
      return answer;
    }
  }

  const Body &a = scene.bodies()[pair.a], &b = scene.bodies()[pair.b];
  const PlacedPose &pose_a = at_a.pose, &pose_b = at_b.pose;
  const auto narrow = options.reference
                          ? narrow_phase_reference
                          : +[](const Piece& p, const PlacedPose& Xp, const Piece& q, const PlacedPose& Xq,
                                const NarrowLimits& l) { return narrow_phase(p, Xp, q, Xq, l); };
  NarrowAnswer best;
  double lower = kInf;
  std::uint32_t piece_a = 0, piece_b = 0;
  if (a.pieces.size() == 1 && b.pieces.size() == 1) {
    best = narrow(*a.pieces[0], pose_a, *b.pieces[0], pose_b, limits);
    lower = best.bounds.lower;
  } else {
    // The distance of bodies is the least over their piece pairs; a pair whose boxes are farther than a proved upper bound
    // cannot be that one.
    for (const PiecePair& p : piece_pairs(a, pose_a, b, pose_b)) {
      if (!options.reference && p.gap > 0 && p.gap > best.bounds.upper) {
        lower = std::min(lower, p.gap);
        break;
      }
      const NarrowAnswer next = narrow(*a.pieces[p.a], pose_a, *b.pieces[p.b], pose_b, limits);
      lower = std::min(lower, next.bounds.lower);
      if (next.bounds.upper < best.bounds.upper || p.gap == kInf) {
        best = next;
        piece_a = p.a;
        piece_b = p.b;
      }
      if (!limits.signed_distance && best.bounds.upper <= 0) break;  // overlapping: the rest cannot change that
    }
  }

  PairAnswer answer;
  answer.lower = lower;
  answer.upper = best.bounds.upper;
  if (!limits.signed_distance) {
    answer.lower = std::max(answer.lower, 0.0);
    answer.upper = std::max(answer.upper, 0.0);
  }
  answer.piece_a = piece_a;
  answer.piece_b = piece_b;
  answer.point_a = best.point_a;
  answer.point_b = best.point_b;
  answer.normal = best.normal;

  const double width = answer.upper - answer.lower;
  const auto narrow_enough = [&](double d) { return width <= std::max(limits.abs_tol, limits.rel_tol * std::abs(d)); };
  const bool at_rounding = width <= 4 * best.rounding;
  bool settled = true;
  if (answer.lower > limits.max_distance) {
    answer.status = Status::kBeyond;
    answer.distance = answer.lower;
    answer.point_a = answer.point_b = kNanVec;
  } else if (best.bounds.upper <= 0) {
    settled = !limits.signed_distance || narrow_enough(answer.lower);
    answer.status = settled ? Status::kOverlap : Status::kUnconverged;
    answer.distance = answer.lower;
    if (limits.signed_distance && (a.pieces.size() > 1 || b.pieces.size() > 1)) flags |= kFlagPieces;
  } else if (answer.lower > 0) {
    settled = narrow_enough(answer.upper);
    answer.status = settled ? Status::kOk : Status::kUnconverged;
    answer.distance = answer.upper;
  } else {
    settled = narrow_enough(0);
    answer.status = settled || at_rounding ? Status::kContact : Status::kUnconverged;
    answer.distance = limits.signed_distance ? 0.5 * answer.lower + 0.5 * answer.upper : answer.upper;
  }
  if (!settled && at_rounding) flags |= kFlagRoundingLimited;
  if (options.want_nonsmooth && answer.status != Status::kBeyond &&
      (answer.lower <= 0 || witness_is_ambiguous(*a.pieces[piece_a], pose_a, *b.pieces[piece_b], pose_b, best.normal)))
    flags |= kFlagNonsmooth;
  answer.flags = flags;
  return answer;
}

}  // namespace clearance
