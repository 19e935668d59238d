#include "engine/query/pair_answer.h"

#include <cassert>
#include <cmath>
#include <limits>

#include "engine/narrow/witness.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

}  // namespace

void finish(const Scene& scene, const PlacedBodies& bodies, const EvaluateOptions& options, const BodiesAnswer& found,
            Piece (&rooms)[2], PairAnswer& answer) {
  NarrowLimits limits = options.limits;
  limits.max_distance = bodies.max_distance;
  const NarrowAnswer& best = found.best;
  const double lower = found.lower;
  const Body &a = scene.bodies()[bodies.pair.a], &b = scene.bodies()[bodies.pair.b];
  const PlacedPose &pose_a = (*bodies.placement)[bodies.pair.a].pose, &pose_b = (*bodies.placement)[bodies.pair.b].pose;

  if (best.bounds.upper == kInf && lower == -kInf) {
    const std::uint16_t flags = answer.flags;
    answer = unproved_answer();
    answer.flags = flags;
    return;
  }
  if (options.want_points) {
    answer.piece_a = found.a.piece;
    answer.piece_b = found.b.piece;
    answer.point_a = best.point_a;
    answer.point_b = best.point_b;
    answer.normal = best.normal;
  }
  const auto rounding = [&] {
    if (found.best.rounding > 0) return found.best.rounding;
    return rounding_of(*a.pieces[found.a.piece], pose_a, *b.pieces[found.b.piece], pose_b);
  };
  const Slack slack = pair_slack(*bodies.placement, bodies.pair);
  assert(lower <= best.bounds.upper);
  assert(found.a.piece < a.pieces.size() && found.b.piece < b.pieces.size());
  decide(limits, lower, best.bounds.upper, rounding, answer, slack);
  if (limits.signed_distance && best.bounds.upper <= 0 && (a.pieces.size() > 1 || b.pieces.size() > 1))
    answer.flags |= kFlagPieces;
  if (options.want_flags && answer.status != Status::kBeyond &&
      (answer.lower <= 0 || witness_is_ambiguous(piece_of(a, found.a, rooms[0]), pose_a.R_wb,
                                                 piece_of(b, found.b, rooms[1]), pose_b.R_wb, best.normal)))
    answer.flags |= kFlagNonsmooth;
}

void decide_settled(const PlacedBodies& bodies, const EvaluateOptions& options, double lower, double upper,
                    PairAnswer& answer) {
  const Slack slack = pair_slack(*bodies.placement, bodies.pair);
  NarrowLimits limits = options.limits;
  limits.max_distance = bodies.max_distance;
  if (slack.any())
    decide(limits, lower, upper, [] { return 0.0; }, answer, slack);
  else
    decide_apart(limits.max_distance, lower, upper, true, answer);
}

void finish_settled(const Piece& a, const Mat3d& R_wa, const Piece& b, const Mat3d& R_wb,
                    const EvaluateOptions& options, PairAnswer& answer) {
  answer.piece_a = answer.piece_b = 0;
  if (answer.status == Status::kBeyond)
    answer.point_a = answer.point_b = no_point();
  else if (options.want_flags && witness_is_ambiguous(a, R_wa, b, R_wb, answer.normal))
    answer.flags |= kFlagNonsmooth;
}

}  // namespace clearance
