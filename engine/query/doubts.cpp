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
                   bool composed, const PlacedLink& link) {
  const FrameDoubt none,
      joints =
          link.errors ? FrameDoubt{link.errors->shift(link.link, link.travel), link.errors->turn(link.link)} : none;
  const FrameDoubt &above = parent ? parent->known : none, &placed_above = parent ? parent->placed : none;
  const double along = up(norm(local.translation) + joints.shift), own = up(body.max_speed * age_s),
               turn = chord(body.uncertainty.angle);
  const double turned = composed ? kTurnUnits * kUnit : 0,
               shifted = composed ? kShiftUnits * kUnit * along + kUnit * norm(t_w) : 0;
  BodyDoubt doubt;
  doubt.link = link;
  doubt.known.shift = up(shift_below(above, along, up(own + body.uncertainty.position)));
  doubt.known.turn = up(above.turn + turn);
  if (parent) {
    doubt.placed.shift = up(placed_above.shift + placed_above.turn * along + shifted + joints.shift);
    doubt.placed.turn = up(placed_above.turn + turned + joints.turn);
  }
  // The pieces are grown by the uncertainty of the body's own position already.
  const double reach = up(body.reach + body.model_inner);
  const double known = shift_below(above, along, own) + doubt.known.turn * reach;
  const double placed = doubt.placed.shift + doubt.placed.turn * reach;
  doubt.slack = {up(known + placed + body.model_inner), up(placed + body.model_error)};
  const double step = shifted + turned * reach;
  doubt.parts = {own, turn * reach, above.shift + above.turn * (along + own) + above.turn * reach, placed, step, age_s};
  doubt.beside = {up(own + turn * reach + step + body.model_inner), up(step + body.model_error)};
  return doubt;
}

namespace {

// Of each robot, where its joints stand.
std::vector<double> travels_of(const Scene& scene, const PoseSnapshot& snapshot) {
  std::vector<double> travels;
  for (const auto& robot : scene.robots())
    travels.push_back(robot->kinematics.travel(
        std::span(snapshot.joints.position).subspan(robot->first_joint, robot->model.columns.size())));
  return travels;
}

}  // namespace

double points_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns) {
  const ReceivedPoints* const points = snapshot.points_of(body);
  return points ? 1e-9 * static_cast<double>(std::max<std::int64_t>(now_ns - points->receipt_ns, 0)) : 0;
}

double pose_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns) {
  const std::int64_t receipt = snapshot.receipt_ns[body];
  const std::int64_t age_ns = now_ns - (receipt ? receipt : snapshot.loaded_ns);
  return std::max(1e-9 * static_cast<double>(std::max<std::int64_t>(age_ns, 0)), points_age_s(snapshot, body, now_ns));
}

std::vector<BodyDoubt> doubts_of(const Scene& scene, const PoseSnapshot& snapshot, std::int64_t now_ns) {
  if (!scene.has_doubts() && !snapshot.has_followers) return {};
  std::vector<BodyDoubt> doubts(scene.bodies().size());
  const std::vector<double> travels = travels_of(scene, snapshot);
  for (const std::uint32_t b : *snapshot.order) {
    const Body& body = scene.bodies()[b];
    PlacedLink& link = doubts[b].link;  // also of one that only a query gives a pose
    if (body.robot != kNone) link = {&scene.robots()[body.robot]->errors, body.link, travels[body.robot]};
    if (snapshot.placed[b].status != Status::kOk) continue;
    const double age_s = body.is_static ? 0 : pose_age_s(snapshot, b, now_ns);
    const std::uint32_t on = snapshot.parent[b];
    doubts[b] = doubt_of(body, snapshot.local[b], snapshot.placed[b].pose.t_w, age_s,
                         on == kNone ? nullptr : &doubts[on], on != kNone && is_composed(snapshot.placed[on]), link);
  }
  return doubts;
}

}  // namespace clearance
