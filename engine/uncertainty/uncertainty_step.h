// Uncertainty of a body, derived from that of the body that it follows (docs/trust/bounds_robots.md, "Chains"). For
// host and device.
#pragma once

#include <cstdint>

#include "engine/base/slack.h"

namespace clearance {

/// Bound on the error of a computed frame: a point fixed to it, d metres from its origin, is at most shift + turn * d
/// from its computed position.
struct FrameUncertainty {
  double shift = 0, turn = 0;
};

/// Components of the slack of a body's parts, in metres, whose sum does not exceed it. They belong to the inner slack,
/// except `placed`, which counts on both sides.
struct SlackParts {
  double age = 0;     ///< distance it may have moved since its own pose was received, `age_s` ago
  double turn = 0;    ///< from its own uncertain rotation
  double parent = 0;  ///< from the uncertainty of the body that it follows
  double placed = 0;  ///< from the rounding of joints and of chained poses
  double step = 0;    ///< share of `placed` from the rounding of this body's own pose
  double age_s = 0;   ///< seconds
};

/// Uncertainty that a body contributes itself, wherever it is placed. In metres.
struct UncertaintySource {
  double max_speed = 0, position = 0;
  double turn = 0;   ///< how far its uncertain rotation moves a point, per metre from its origin
  double reach = 0;  ///< upper bound on the distance of the true body's points from its origin
  double model_inner = 0, model_error = 0;
};

/// Uncertainty of a placed body.
struct PlacedUncertainty {
  FrameUncertainty known;   ///< of its frame, inherited by its followers: declared, and from the age of its pose
  FrameUncertainty placed;  ///< from the rounding of joints and of chained poses
  Slack slack;              ///< of its parts
  SlackParts parts;         ///< without the contribution of its shape: Body::model_inner, model_error
  Slack relative;           ///< for a link: excludes motion common to all links on its root, and the joints' rounding
};

namespace detail {

// Rounding of one step down a chain of poses, in units of rounding.
inline constexpr double kTurnUnits = 20, kShiftUnits = 8;

// Covers the rounding of a step's own sums and products, all of them positive, and of sin().
CLEARANCE_HD inline double up(double x) {
  return x == 0 ? 0 : x * (1 + 0x1p-40) + 0x1p-1000;
}

// Bound on the displacement of a body's origin, which may be `shift` from its place in its parent's frame and lies
// `along` from the parent's origin. The parent's turn acts on the shifted origin.
CLEARANCE_HD inline double shift_below(const FrameUncertainty& parent, double along, double shift) {
  return parent.shift + parent.turn * (along + shift) + shift;
}

}  // namespace detail

/// \param local translation of its pose as given
/// \param t_w its origin in the world, as computed
/// \param age_s age of that pose, in seconds
/// \param parent the body that it follows, or null
/// \param composed whether its pose was composed with the parent's, and rounded
/// \param joints uncertainty of `local` if joints made it
CLEARANCE_HD inline PlacedUncertainty uncertainty_below(const UncertaintySource& body, const Vec3d& local,
                                                        const Vec3d& t_w, double age_s, const PlacedUncertainty* parent,
                                                        bool composed, const FrameUncertainty& joints) {
  using detail::up;
  constexpr double kUnit = 0x1p-53;
  const FrameUncertainty none, above = parent ? parent->known : none, placed_above = parent ? parent->placed : none;
  const double along = up(norm(local) + joints.shift), own = up(body.max_speed * age_s);
  const double turned = composed ? detail::kTurnUnits * kUnit : 0,
               shifted = composed ? detail::kShiftUnits * kUnit * along + kUnit * norm(t_w) : 0;
  PlacedUncertainty uncertainty;
  uncertainty.known.shift = up(detail::shift_below(above, along, up(own + body.position)));
  uncertainty.known.turn = up(above.turn + body.turn);
  if (parent) {
    uncertainty.placed.shift = up(placed_above.shift + placed_above.turn * along + shifted + joints.shift);
    uncertainty.placed.turn = up(placed_above.turn + turned + joints.turn);
  }
  // The parts are already grown by the uncertainty of the body's own position.
  const double known = detail::shift_below(above, along, own) + uncertainty.known.turn * body.reach;
  const double placed = uncertainty.placed.shift + uncertainty.placed.turn * body.reach;
  uncertainty.slack = {up(known + placed + body.model_inner), up(placed + body.model_error)};
  const double step = shifted + turned * body.reach;
  uncertainty.parts = {
      own,  body.turn * body.reach, above.shift + above.turn * (along + own) + above.turn * body.reach, placed, step,
      age_s};
  uncertainty.relative = {up(own + body.turn * body.reach + step + body.model_inner), up(step + body.model_error)};
  return uncertainty;
}

/// Slack of the distance between two bodies that share a source of uncertainty. The shared source cancels and `joints`,
/// the rounding between the two, replaces it.
CLEARANCE_HD inline Slack slack_between_links(const Slack& a, const Slack& b, double joints) {
  return a + b + Slack{joints, joints};
}

}  // namespace clearance
