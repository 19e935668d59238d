// What is not known of a body, from what is not known of the one that it follows (docs/bounds.md, "Slack", "Chains").
// For host and device.
#pragma once

#include <cstdint>

#include "engine/base/slack.h"

namespace clearance {

/// How far a frame may be from where it was computed to be: no point that belongs to it, d metres from its origin, is
/// farther than shift + turn * d from its place.
struct FrameUncertainty {
  double shift = 0, turn = 0;
};

/// What the slack of a body's pieces is made of, metres: lengths that add up to no more than it. Inner ones, but for
/// `placed`, which counts on both sides.
struct SlackParts {
  double age = 0;     ///< how far it may have got since its own pose was received, `age_s` ago
  double turn = 0;    ///< by its own uncertain turn
  double parent = 0;  ///< by what is doubted of that which it follows
  double placed = 0;  ///< by the rounding of joints and of poses that follow one another
  double step = 0;    ///< of `placed`: by the rounding of this body's own pose
  double age_s = 0;   ///< seconds
};

/// What a body adds of its own, wherever it stands. Metres.
struct UncertaintySource {
  double max_speed = 0, position = 0;
  double turn = 0;   ///< how far its uncertain turn moves a point, for each metre from its origin
  double reach = 0;  ///< no point of the true body is farther from its origin
  double model_inner = 0, model_error = 0;
};

/// What is not known of a placed body.
struct PlacedUncertainty {
  FrameUncertainty known;   ///< its frame, and all that follow it: by what the user knows and by the age of its pose
  FrameUncertainty placed;  ///< by the rounding of joints and of poses that follow one another
  Slack slack;              ///< of its pieces
  SlackParts parts;         ///< beside what its shape adds: Body::model_inner, model_error
  Slack beside;  ///< of a link: without what moves all links on its root alike, and without the joints' rounding
};

namespace detail {

// Of one step down a chain of poses, in units of rounding.
inline constexpr double kTurnUnits = 20, kShiftUnits = 8;

// What a step's own sums and products round, all of them positive, and sin() with them.
CLEARANCE_HD inline double up(double x) {
  return x == 0 ? 0 : x * (1 + 0x1p-40) + 0x1p-1000;
}

// How far a body's origin may be from its place, if it may be `shift` from it in its parent's frame, `along` from that
// one's origin: the parent's turn takes along what has moved already.
CLEARANCE_HD inline double shift_below(const FrameUncertainty& parent, double along, double shift) {
  return parent.shift + parent.turn * (along + shift) + shift;
}

}  // namespace detail

/// \param local translation of its pose as given. \param t_w its origin in the world, as computed. \param age_s of that
/// pose, seconds. \param parent of the body that it follows; null: none. \param composed its pose was composed with
/// that body's, and rounded. \param joints what is doubted of `local`, where joints made it
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
  // The pieces are grown by the uncertainty of the body's own position already.
  const double known = detail::shift_below(above, along, own) + uncertainty.known.turn * body.reach;
  const double placed = uncertainty.placed.shift + uncertainty.placed.turn * body.reach;
  uncertainty.slack = {up(known + placed + body.model_inner), up(placed + body.model_error)};
  const double step = shifted + turned * body.reach;
  uncertainty.parts = {
      own,  body.turn * body.reach, above.shift + above.turn * (along + own) + above.turn * body.reach, placed, step,
      age_s};
  uncertainty.beside = {up(own + body.turn * body.reach + step + body.model_inner), up(step + body.model_error)};
  return uncertainty;
}

/// How far the distance of two bodies may be off in all, whose doubts have a part in common: they count without it, and
/// `joints` between them instead.
CLEARANCE_HD inline Slack slack_beside(const Slack& a, const Slack& b, double joints) {
  return a + b + Slack{joints, joints};
}

}  // namespace clearance
