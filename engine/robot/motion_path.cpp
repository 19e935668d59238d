#include "engine/robot/motion_path.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace clearance {

namespace {

constexpr double kSlack = kMotionSlack;
constexpr double kAxisError = 0x1p-48;  // of a vector's component normal to an axis, relative to the vector's length

using Kind = KinematicStep::Kind;

double length_of(const Vec3d& v) {
  return std::hypot(v.x, v.y, v.z);
}

double across(const Vec3d& axis, const Vec3d& v) {
  return length_of(cross(axis, v)) + kAxisError * length_of(v);
}

}  // namespace

// Walks from the points to the observing frame, and accumulates the rest of the way to the points.
class MotionPathBuilder {
 public:
  MotionPathBuilder(const Kinematics& robot, std::uint32_t link, const LinkBall& points)
      : robot_(robot), next_(points.centre), beyond_(points.radius) {
    frame_ = frame_of(link);
    // A link on a fixed joint moves with its parent.
    while (const KinematicStep* step = step_of(frame_)) {
      if (step->kind != Kind::kFixed) break;
      next_ = step->at + turned(step->still, next_);
      frame_ = step->from;
    }
  }

  std::uint32_t frame_of(std::uint32_t link) const {
    const auto& roots = robot_.roots();
    if (const auto at = std::find(roots.begin(), roots.end(), link); at != roots.end())
      return static_cast<std::uint32_t>(at - roots.begin());
    const auto& steps = robot_.steps();
    const auto at = std::find_if(steps.begin(), steps.end(), [&](const KinematicStep& s) { return s.link == link; });
    return static_cast<std::uint32_t>(roots.size() + (at - steps.begin()));
  }
  // Returns null for a root.
  const KinematicStep* step_of(std::uint32_t frame) const {
    const std::size_t roots = robot_.roots().size();
    return frame < roots ? nullptr : &robot_.steps()[frame - roots];
  }
  // Frames from a root to the one that a link moves with.
  std::vector<std::uint32_t> frames_to(std::uint32_t link) const {
    std::vector<std::uint32_t> frames = {frame_of(link)};
    while (const KinematicStep* step = step_of(frames.back())) {
      if (step->kind == Kind::kFixed) frames.pop_back();
      frames.push_back(step->from);
    }
    std::reverse(frames.begin(), frames.end());
    return frames;
  }

  // Descends to a frame that carries the points: `next_` is in the frame's own axes.
  void descend(std::uint32_t to) {
    while (frame_ != to) {
      const KinematicStep& step = *step_of(frame_);
      if (turns(step)) add_turn(step, axis_of_step(step));
      pass();
      add_slides(step);
      next_ = step.at;
      next_travel_ = travel_of(step);
      frame_ = step.from;
    }
  }
  // Ascends to a frame that the current one carries, and observes the points from there.
  void ascend(std::uint32_t to) {
    const KinematicStep& step = *step_of(to);
    next_ = next_ - step.at;
    next_travel_ += travel_of(step);
    add_slides(step);
    if (turns(step)) add_turn(step, turned(step.still, axis_of_step(step)));
    pass();
    next_ = {0, 0, 0};
    next_travel_ = 0;
    frame_ = to;
  }

  std::vector<Mover> take() {
    std::reverse(movers_.begin(), movers_.end());
    return std::move(movers_);
  }

 private:
  static double travel_of(const KinematicStep& step) { return length_of(step.along[0]) + length_of(step.along[1]); }

  void add_turn(const KinematicStep& step, const Vec3d& axis) {
    Mover mover;
    mover.column = step.column + (step.kind == Kind::kPlanar ? 2 : 0);
    mover.turns = true;
    mover.scale = step.mimics ? std::abs(step.multiplier) : 1;
    mover.reach = (across(axis, next_) + beyond_) * kSlack;
    mover.reach_travel = (next_travel_ + beyond_travel_) * kSlack;
    movers_.push_back(mover);
  }
  void add_slides(const KinematicStep& step) {
    if (step.kind != Kind::kSliding && step.kind != Kind::kPlanar) return;
    Mover mover;
    mover.scale = step.mimics ? std::abs(step.multiplier) : 1;
    mover.reach = kSlack;
    mover.column = step.column + (step.kind == Kind::kPlanar ? 1 : 0);
    movers_.push_back(mover);
    if (step.kind != Kind::kPlanar) return;
    mover.column = step.column;
    movers_.push_back(mover);
  }
  void pass() {
    beyond_ += length_of(next_);
    beyond_travel_ += next_travel_;
  }

  const Kinematics& robot_;
  std::uint32_t frame_ = 0;  // roots, then steps, as in KinematicStep::from
  Vec3d next_;               // from the frame's origin to the next one towards the points; constant in the frame
  double next_travel_ = 0;   // increase of its length per metre of travel
  double beyond_;            // metres: the longest way from there to a point
  double beyond_travel_ = 0;
  std::vector<Mover> movers_;  // the nearest to the points first
};

MotionPath::MotionPath(const Kinematics& robot, std::uint32_t link, const LinkBall& points) {
  MotionPathBuilder path(robot, link, points);
  path.descend(path.frames_to(link).front());
  movers_ = path.take();
}

MotionPath::MotionPath(const Kinematics& robot, std::uint32_t seen_from, std::uint32_t link, const LinkBall& points) {
  MotionPathBuilder path(robot, link, points);
  const std::vector<std::uint32_t> to = path.frames_to(link), eye = path.frames_to(seen_from);
  const auto fork = std::mismatch(to.begin(), to.end(), eye.begin(), eye.end()).second;
  path.descend(*std::prev(fork));
  for (auto frame = fork; frame != eye.end(); ++frame) path.ascend(*frame);
  movers_ = path.take();
}

double MotionPath::way_of(const Mover& mover, double travel) {
  return way_of_mover(mover, travel);
}

double MotionPath::way(std::span<const double> change, double travel) const {
  double sum = 0;
  for (const Mover& mover : movers_) sum += way_of(mover, travel) * change[mover.column];
  return sum * kSlack;
}

MotionRates MotionRates::within(const MotionRates& outer) const {
  return {(speed + outer.speed) * kSlack, (acceleration + outer.acceleration + 2 * outer.turn * speed) * kSlack,
          (turn + outer.turn) * kSlack};
}

MotionRates MotionPath::rates(std::span<const double> change, double travel, double beyond) const {
  return rates_of_path(
      movers_.data(), movers_.size(), [&](std::uint32_t column) { return change[column]; }, travel, beyond);
}

std::uint32_t fork_of(const Kinematics& robot, std::uint32_t a, std::uint32_t b) {
  const MotionPathBuilder path(robot, a, {});
  const std::vector<std::uint32_t> to_a = path.frames_to(a), to_b = path.frames_to(b);
  const auto fork = std::mismatch(to_a.begin(), to_a.end(), to_b.begin(), to_b.end()).first;
  const std::uint32_t frame = fork == to_a.begin() ? to_a.front() : *std::prev(fork);
  return frame < robot.roots().size() ? robot.roots()[frame] : path.step_of(frame)->link;
}

std::array<MotionPath, 2> paths_from_fork(const Kinematics& robot, std::uint32_t a, const LinkBall& points_a,
                                          std::uint32_t b, const LinkBall& points_b) {
  MotionPathBuilder to_a(robot, a, points_a), to_b(robot, b, points_b);
  const std::vector<std::uint32_t> frames_a = to_a.frames_to(a), frames_b = to_b.frames_to(b);
  const auto [fork_a, fork_b] = std::mismatch(frames_a.begin(), frames_a.end(), frames_b.begin(), frames_b.end());
  const bool one_root = fork_a != frames_a.begin();
  to_a.descend(one_root ? *std::prev(fork_a) : frames_a.front());
  to_b.descend(one_root ? *std::prev(fork_b) : frames_b.front());
  std::array<MotionPath, 2> paths;
  paths[0].movers_ = to_a.take();
  paths[1].movers_ = to_b.take();
  return paths;
}

std::vector<MotionPath> paths_between(const Kinematics& robot, std::uint32_t a, const LinkBall& points_a,
                                      std::uint32_t b, const LinkBall& points_b) {
  std::vector<MotionPath> paths;
  if (robot.root_of(a) == robot.root_of(b)) {
    paths.emplace_back(robot, a, b, points_b);
    paths.emplace_back(robot, b, a, points_a);
  }
  auto [both, of_b] = paths_from_fork(robot, a, points_a, b, points_b);
  both.movers_.insert(both.movers_.end(), of_b.movers_.begin(), of_b.movers_.end());
  paths.push_back(std::move(both));
  return paths;
}

}  // namespace clearance
