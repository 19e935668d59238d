#include "evaluate.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
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
  rotation_of_.resize(local_.size(), nullptr);
  moved_boxes_.resize(local_.size());
}

void Placement::configure(std::uint64_t k, std::span<const Mat3d> rotations) {
  if (moved_slot_.empty() || k == configuration_) return;
  configuration_ = k;
  const PoseSnapshot& snapshot = *plan_.snapshot;
  const std::size_t count = plan_.bodies.size();
  for (std::size_t m = 0; m < count; ++m) {
    const std::uint32_t slot = moved_slot_[plan_.bodies[m]];
    local_[slot] = plan_.configurations[k * count + m];
    rotation_of_[slot] = &rotations[m];
  }
  for (std::size_t i = 0; i < plan_.moved.size(); ++i) {
    const std::uint32_t body = plan_.moved[i], parent = snapshot.parent[body];
    moved_[i] = place(&local_[i], parent == kNone ? nullptr : &(*this)[parent], rotation_of_[i]);
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

std::uint16_t pose_flags(const Placement& placement, BodyPair pair, std::span<const std::uint8_t> stale) {
  std::uint16_t flags = placement[pair.a].renormalised || placement[pair.b].renormalised ? kFlagRenormalised : 0;
  if (!stale.empty() && (stale[pair.a] || stale[pair.b])) flags |= kFlagStale;
  return flags;
}

double box_gap(const Scene& scene, const Placement& placement, BodyPair pair) {
  const std::size_t n = scene.bodies().size();
  if (pair.a >= n || pair.b >= n) return kInf;
  const Aabb *a = placement.known_box(pair.a), *b = placement.known_box(pair.b);
  if (a && b) return certify_box_gap(*a, *b);
  return certify_box_gap(placement.box(pair.a), placement.box(pair.b));
}

namespace {

// The flags of a pair's bodies, and its answer if that needs no look at the pieces.
bool answer_without_pieces(const Scene& scene, const Placement& placement, BodyPair pair, const EvaluateOptions& options,
                           PairAnswer& answer) {
  if (pair.a >= scene.bodies().size() || pair.b >= scene.bodies().size()) {
    answer = no_answer(Status::kUnknownBody);
    return true;
  }
  const std::uint16_t flags = pose_flags(placement, pair, options.stale);
  answer.flags = flags;
  if (const Status status = pair_status(placement[pair.a].status, placement[pair.b].status); status != Status::kOk) {
    answer = no_answer(status);
    answer.flags = flags;
    return true;
  }
  if (!options.cull) return false;
  const double gap = box_gap(scene, placement, pair);
  if (!(gap > options.limits.max_distance)) return false;
  answer = beyond_answer(gap);
  answer.flags = flags;
  return true;
}

// The narrowest intervals of two bodies' piece pairs, put together.
struct BodiesAnswer {
  NarrowAnswer best;
  double lower = kInf;
  std::uint32_t piece_a = 0, piece_b = 0;
};

BodiesAnswer narrow_bodies(const Body& a, const PlacedPose& pose_a, const Body& b, const PlacedPose& pose_b,
                           const EvaluateOptions& options, const Gjk<double>* done, WarmSimplex* warm) {
  const NarrowLimits& limits = options.limits;
  const bool single = a.pieces.size() == 1 && b.pieces.size() == 1;
  const auto narrow = [&](const Piece& p, const Piece& q) {
    return options.reference ? narrow_phase_reference(p, pose_a, q, pose_b, limits)
                             : narrow_phase(p, pose_a, q, pose_b, limits, single ? warm : nullptr, done);
  };
  BodiesAnswer r;
  if (single) {
    r.best = narrow(*a.pieces[0], *b.pieces[0]);
    r.lower = r.best.bounds.lower;
    return r;
  }
  // The distance of bodies is the least over their piece pairs; a pair whose boxes are farther than a proved upper bound
  // cannot be that one.
  for (const PiecePair& p : piece_pairs(a, pose_a, b, pose_b)) {
    if (!options.reference && p.gap > 0 && p.gap > r.best.bounds.upper) {
      r.lower = std::min(r.lower, p.gap);
      break;
    }
    const NarrowAnswer next = narrow(*a.pieces[p.a], *b.pieces[p.b]);
    r.lower = std::min(r.lower, next.bounds.lower);
    if (next.bounds.upper < r.best.bounds.upper || p.gap == kInf) {
      r.best = next;
      r.piece_a = p.a;
      r.piece_b = p.b;
    }
    if (!limits.signed_distance && r.best.bounds.upper <= 0) break;  // overlapping: the rest cannot change that
  }
  return r;
}

// \param answer holds the flags of the bodies; the rest is written here. \param done GJK's run on single pieces, or null.
void answer_from_pieces(const Scene& scene, const Placement& placement, BodyPair pair, const EvaluateOptions& options,
                        const Gjk<double>* done, WarmSimplex* warm, PairAnswer& answer) {
  const NarrowLimits& limits = options.limits;
  const Body &a = scene.bodies()[pair.a], &b = scene.bodies()[pair.b];
  const PlacedPose &pose_a = placement[pair.a].pose, &pose_b = placement[pair.b].pose;
  const auto [best, lower, piece_a, piece_b] = narrow_bodies(a, pose_a, b, pose_b, options, done, warm);
  std::uint16_t flags = answer.flags;

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
    answer.point_a = answer.point_b = no_point();
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
      (answer.lower <= 0 || witness_is_ambiguous(*a.pieces[piece_a], pose_a.R_wb, *b.pieces[piece_b], pose_b.R_wb, best.normal)))
    flags |= kFlagNonsmooth;
  answer.flags = flags;
}

}  // namespace

void Evaluator::run(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers) {
  waiting_.clear();
  for (std::uint32_t i = 0; i < pairs.size(); ++i) {
    const auto& [pair, placement, warm] = pairs[i];
    if (answer_without_pieces(scene_, *placement, pair, options_, answers[i])) continue;
    const std::vector<PiecePtr>&a = scene_.bodies()[pair.a].pieces, &b = scene_.bodies()[pair.b].pieces;
    if (options_.lanes && !options_.reference && a.size() == 1 && b.size() == 1)
      waiting_.push_back({a[0].get(), b[0].get(), i});
    else
      answer_from_pieces(scene_, *placement, pair, options_, nullptr, nullptr, answers[i]);
  }
  if (!waiting_.empty()) run_in_lanes(pairs, answers);
}

// Pairs of the same two pieces go side by side. A few that have no company are faster alone.
void Evaluator::run_in_lanes(std::span<const PlacedBodies> pairs, std::span<PairAnswer> answers) {
  const auto by_pieces = [](const Waiting& p, const Waiting& q) {
    return std::tie(p.a, p.b, p.index) < std::tie(q.a, q.b, q.index);
  };
  if (!std::is_sorted(waiting_.begin(), waiting_.end(), by_pieces)) std::sort(waiting_.begin(), waiting_.end(), by_pieces);
  for (std::size_t begin = 0, end; begin < waiting_.size(); begin = end) {
    const Piece *a = waiting_[begin].a, *b = waiting_[begin].b;
    for (end = begin; end < waiting_.size() && waiting_[end].a == a && waiting_[end].b == b;) ++end;
    const std::size_t count = end - begin;
    const bool try_f32 = options_.f32 && fits_f32(*a, *b);
    // In float32 also the few: an answer's bits must not depend on how many are asked for.
    const bool side_by_side = try_f32 || count > static_cast<std::size_t>(options_.lanes->lanes) / 4;
    if (side_by_side) {
      lane_pairs_.clear();
      for (std::size_t i = begin; i < end; ++i) {
        const auto& [pair, placement, warm] = pairs[waiting_[i].index];
        const PlacedPose &pose_a = (*placement)[pair.a].pose, &pose_b = (*placement)[pair.b].pose;
        lane_pairs_.push_back({&pose_a.R_wb, &pose_b.R_wb, &pose_a.t_w, &pose_b.t_w, warm});
      }
      if (lane_answers_.size() < count) {
        lane_answers_.resize(count);
        lane_witnesses_.resize(count);
        lane_unsettled_.resize(count);
      }
      const NarrowLimits& limits = options_.limits;
      LaneBatch batch{LaneHull(*a), LaneHull(*b), lane_pairs_.data(), count, limits.abs_tol, limits.rel_tol, limits.max_distance,
                      limits.max_iterations, lane_answers_.data(), options_.want_points ? lane_witnesses_.data() : nullptr,
                      lane_unsettled_.data()};
      if (try_f32) {
        options_.lanes->run_f32(batch);
        settle_in_f64(batch);
      } else {
        options_.lanes->run(batch);
      }
    }
    for (std::size_t i = begin; i < end; ++i) {
      const auto& [pair, placement, warm] = pairs[waiting_[i].index];
      PairAnswer& answer = answers[waiting_[i].index];
      if (side_by_side && lane_answers_[i - begin].settled)
        take_lane(lane_answers_[i - begin], lane_witnesses_[i - begin], *a, lane_pairs_[i - begin], *b, answer);
      else
        answer_from_pieces(scene_, *placement, pair, options_, side_by_side ? &lane_unsettled_[i - begin] : nullptr, warm, answer);
    }
  }
}

// Float64 lanes for those that float32 left open.
void Evaluator::settle_in_f64(const LaneBatch& all) {
  again_.clear();
  again_pairs_.clear();
  for (std::size_t i = 0; i < all.count; ++i)
    if (!all.answers[i].settled) {
      again_.push_back(i);
      again_pairs_.push_back(all.pairs[i]);
    }
  if (again_.empty()) return;
  if (again_answers_.size() < again_.size()) {
    again_answers_.resize(again_.size());
    again_witnesses_.resize(again_.size());
    again_unsettled_.resize(again_.size());
  }
  LaneBatch batch = all;
  batch.pairs = again_pairs_.data();
  batch.count = again_.size();
  batch.answers = again_answers_.data();
  if (all.witnesses) batch.witnesses = again_witnesses_.data();
  batch.unsettled = again_unsettled_.data();
  options_.lanes->run(batch);
  for (std::size_t k = 0; k < again_.size(); ++k) {
    all.answers[again_[k]] = again_answers_[k];
    if (!again_answers_[k].settled)
      all.unsettled[again_[k]] = again_unsettled_[k];
    else if (all.witnesses)
      all.witnesses[again_[k]] = again_witnesses_[k];
  }
}

// What answer_from_pieces() would make of a settled pair.
void Evaluator::take_lane(const LaneAnswer& lane, const LaneWitness& witness, const Piece& a, const LanePair& placed,
                          const Piece& b, PairAnswer& answer) const {
  const bool beyond = lane.lower > options_.limits.max_distance;
  answer.status = beyond ? Status::kBeyond : Status::kOk;
  answer.lower = lane.lower;
  answer.upper = lane.upper;
  answer.distance = beyond ? lane.lower : lane.upper;
  if (!options_.want_points) return;
  answer.piece_a = answer.piece_b = 0;
  take_lane_witness(a, *placed.R_wa, b, *placed.R_wb, witness, answer.point_a, answer.point_b, answer.normal);
  if (beyond)
    answer.point_a = answer.point_b = no_point();
  else if (options_.want_nonsmooth && witness_is_ambiguous(a, *placed.R_wa, b, *placed.R_wb, answer.normal))
    answer.flags |= kFlagNonsmooth;
}

}  // namespace clearance
