#include "engine/query/doubts.h"

#include <algorithm>
#include <cmath>

namespace clearance {

namespace {

constexpr double kUnit = 0x1p-53;
// Of one step down a chain of poses, in units of rounding (docs/bounds.md, "Slack").
constexpr double kTurnUnits = 20, kShiftUnits = 8;
// What a step's own sums and products round, all of them positive, and sin() with them.
constexpr double kUp = 1 + 0x1p-40, kUnderflow = 0x1p-1000;

double up(double x) {
  return x == 0 ? 0 : x * kUp + kUnderflow;
}

// How far a turn by at most `angle` about the origin moves a point, for each metre from the origin.
double chord(double angle) {
  return angle >= M_PI ? 2 : up(2 * std::sin(0.5 * angle));
}

// How far a body's origin may be from its place, if it may be `shift` from it in its parent's frame, `along` from that
// one's origin: the parent's turn takes along what has moved already.
double shift_below(const FrameDoubt& parent, double along, double shift) {
  return parent.shift + parent.turn * (along + shift) + shift;
}

}  // namespace

BodyDoubt doubt_of(const Body& body, const Pose& local, const Vec3d& t_w, double age_s, const BodyDoubt* parent,
                   bool composed) {
  const FrameDoubt none;
  const FrameDoubt &above = parent ? parent->known : none, &placed_above = parent ? parent->placed : none;
  const double along = up(norm(local.translation)), own = up(body.max_speed * age_s),
               turn = chord(body.uncertainty.angle);
  BodyDoubt doubt;
  doubt.known.shift = up(shift_below(above, along, up(own + body.uncertainty.position)));
  doubt.known.turn = up(above.turn + turn);
  if (parent) {
    const double turned = composed ? kTurnUnits * kUnit : 0,
                 shifted = composed ? kShiftUnits * kUnit * along + kUnit * norm(t_w) : 0;
    doubt.placed.shift = up(placed_above.shift + placed_above.turn * along + shifted);
    doubt.placed.turn = up(placed_above.turn + turned);
  }
  // The pieces are grown by the uncertainty of the body's own position already.
  const double reach = up(body.reach + body.model_inner);
  const double known = shift_below(above, along, own) + doubt.known.turn * reach;
  const double placed = doubt.placed.shift + doubt.placed.turn * reach;
  doubt.slack = {up(known + placed + body.model_inner), up(placed + body.model_error)};
  return doubt;
}

double pose_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns) {
  const std::int64_t receipt = snapshot.receipt_ns[body];
  return 1e-9 * static_cast<double>(std::max<std::int64_t>(now_ns - (receipt ? receipt : snapshot.loaded_ns), 0));
}

std::vector<BodyDoubt> doubts_of(const Scene& scene, const PoseSnapshot& snapshot, std::int64_t now_ns) {
  if (!scene.has_doubts() && !snapshot.has_followers) return {};
  std::vector<BodyDoubt> doubts(scene.bodies().size());
  for (const std::uint32_t b : *snapshot.order) {
    if (snapshot.placed[b].status != Status::kOk) continue;
    const Body& body = scene.bodies()[b];
    const double age_s = body.is_static ? 0 : pose_age_s(snapshot, b, now_ns);
    const std::uint32_t on = snapshot.parent[b];
    doubts[b] = doubt_of(body, snapshot.local[b], snapshot.placed[b].pose.t_w, age_s,
                         on == kNone ? nullptr : &doubts[on], on != kNone && is_composed(snapshot.placed[on]));
  }
  return doubts;
}

}  // namespace clearance
