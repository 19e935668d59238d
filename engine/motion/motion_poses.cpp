#include "engine/motion/motion_poses.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace clearance {

namespace {

bool are_usable(const JointCurve& curve) {
  return -kMaxPosition <= curve.least() && curve.greatest() <= kMaxPosition;
}

}  // namespace

MotionPoses::MotionPoses(const Plan& plan) : plan_(plan) {
  for (const LinkMotion& motion : plan.motions) robots_.emplace_back(motion.robot().kinematics);
  const auto index_in = [](const std::vector<std::uint32_t>& bodies, std::uint32_t body) {
    const auto at = std::find(bodies.begin(), bodies.end(), body);
    return at == bodies.end() ? kNone : static_cast<std::uint32_t>(at - bodies.begin());
  };
  for (const std::uint32_t body : plan.moved) {
    place_.push_back(index_in(plan.bodies, body));
    carrier_.push_back(index_in(plan.moved, plan.snapshot->parent[body]));
  }
}

// A motion with an unusable control point has no poses.
void MotionPoses::take_row(std::size_t k) {
  const Instant& instant = instants_[k];
  const std::size_t joints = plan_.joints.size();
  double* const row = rows_.data() + k * joints;
  if (const std::span<const JointCurve> curves = instant.moving->curves; !curves.empty()) {
    for (std::size_t j = 0; j < joints; ++j)
      row[j] = are_usable(curves[j]) ? curves[j].at(instant.time) : std::numeric_limits<double>::quiet_NaN();
    curve_sides_.take(curves, instant.begin, instant.time, instant.end);
    for (int side = 0; side < 2; ++side)
      for (std::size_t c = 0; c < columns_; ++c)
        slopes_[slot(k, side) * columns_ + c] = curve_sides_.curves()[c].chord[side];
    return;
  }
  const double* const start = plan_.positions.data() + 2 * instant.moving->motion * joints;
  for (std::size_t j = 0; j < joints; ++j) {
    const double q0 = start[j], q1 = start[joints + j];
    const bool good = std::abs(q0) <= kMaxPosition && std::abs(q1) <= kMaxPosition;
    row[j] = good ? position_at(q0, q1, instant.time) : std::numeric_limits<double>::quiet_NaN();
  }
}

// After take_row().
void MotionPoses::take_given(std::size_t k) {
  const MovingBodies& moving = *instants_[k].moving;
  for (std::size_t i = 0; i < plan_.given_bodies; ++i) {
    Pose& X = poses_[k * plan_.bodies.size() + i];
    const double time = instants_[k].time;
    X = moving.given[i].at(time);
    if (moving.curves.empty() || !moving.given[i].is_good()) continue;
    const JointCurve* const by = &moving.curves[plan_.joints.size() + 3 * i];
    X.translation = {by[0].at(time), by[1].at(time), by[2].at(time)};
  }
}

// Positions with the facts of a whole motion: both ends of a straight one, or for curves the start and a position with
// the facts of all others.
void MotionPoses::take_end_rows(const MovingBodies& moving) {
  const std::size_t joints = plan_.joints.size();
  if (moving.curves.empty()) {
    const double* const start = plan_.positions.data() + 2 * moving.motion * joints;
    rows_.assign(start, start + 2 * joints);
    return;
  }
  rows_.assign(2 * joints, 0);
  for (const LinkMotion& motion : plan_.motions)
    for (const LinkMotion::Moving& m : motion.moving()) {
      const RobotColumn& column = motion.robot().model.columns[m.column];
      const JointCurve& curve = moving.curves[m.at];
      double& extreme = rows_[joints + m.at];
      rows_[m.at] = extreme = curve.begin();
      if (!are_usable(curve))
        extreme = HUGE_VAL;
      else if (!curve.stays_within(column.lower, column.upper))
        extreme =
            column.upper < HUGE_VAL ? std::nextafter(column.upper, HUGE_VAL) : std::nextafter(column.lower, -HUGE_VAL);
    }
}

void MotionPoses::find_end_facts(MovingBodies& moving) {
  moving.end_facts.clear();
  const std::size_t joints = plan_.joints.size(), links = plan_.bodies.size() - plan_.given_bodies;
  take_end_rows(moving);
  poses_.resize(2 * links);
  facts_.assign(2 * links, 0);
  std::size_t at = 0;
  bool has_facts = false;
  for (const LinkMotion& motion : plan_.motions) {
    for (const LinkMotion::Moving& m : motion.moving())
      for (const double position : {rows_[m.at], rows_[joints + m.at]})
        has_facts |= position_fact(motion.robot().model.columns[m.column], position) != 0;
    if (has_facts) motion.make(rows_, 2, poses_.data() + at, facts_.data() + at, links, scratch_);
    at += motion.links().size();
  }
  if (!has_facts) return;
  for (std::size_t i = 0; i < links; ++i) moving.end_facts.push_back(facts_[i] | facts_[links + i]);
}

ConfigurationPoses::PoseBlock MotionPoses::at(std::span<const Instant> instants) {
  const std::size_t bodies = plan_.bodies.size(), given = plan_.given_bodies, joints = plan_.joints.size();
  columns_ = instants.empty() ? 0 : instants[0].moving->curves.size();
  poses_.resize(instants.size() * bodies);
  facts_.assign(instants.size() * bodies, 0);
  rows_.resize(instants.size() * joints);
  sides_ = columns_ > 0 ? 2 : 1;
  slopes_.resize(slot(instants.size(), 0) * columns_);
  travels_.assign(instants.size() * bodies, 0);
  instants_.assign(instants.begin(), instants.end());
  twists_.assign(slot(instants.size(), 0) * bodies, {});
  for (std::size_t k = 0; k < instants.size(); ++k) {
    take_row(k);
    take_given(k);
  }
  std::size_t at = given;
  for (std::size_t m = 0; m < plan_.motions.size(); ++m) {
    const LinkMotion& motion = plan_.motions[m];
    motion.make(rows_, instants.size(), poses_.data() + at, facts_.data() + at, bodies, scratch_);
    for (std::size_t k = 0; k < instants.size(); ++k) motion.travels(k, travels_.data() + k * bodies + at, scratch_);
    take_twists(m, at);
    at += motion.links().size();
  }
  for (std::size_t k = 0; k < instants.size(); ++k)
    for (std::size_t i = 0; i < instants[k].moving->end_facts.size(); ++i)
      facts_[k * bodies + given + i] |= instants[k].moving->end_facts[i];
  return {poses_, facts_, travels_, {}};
}

// For a robot's links, after they have been placed.
void MotionPoses::take_twists(std::size_t motion, std::size_t at) {
  const LinkMotion& made = plan_.motions[motion];
  const std::size_t links = made.robot().kinematics.links();
  links_.resize(links);
  for (std::size_t s = 0; s < slot(instants_.size(), 0); ++s) {
    const std::size_t k = s / static_cast<std::size_t>(sides_);
    const MovingBodies& moving = *instants_[k].moving;
    const std::vector<double>* along = &moving.along[motion];
    if (columns_ > 0) {
      slopes_of_robot_.assign(along->size(), 0);
      for (const LinkMotion::Moving& m : made.moving()) slopes_of_robot_[m.column] = slopes_[s * columns_ + m.at];
      along = &slopes_of_robot_;
    }
    robots_[motion].at(std::span(scratch_.poses).subspan(k * links, links), *along, links_);
    for (std::size_t i = 0; i < made.links().size(); ++i)
      twists_[s * plan_.bodies.size() + at + i] = links_[made.links()[i]];
  }
}

void MotionPoses::twists(std::size_t k, int side, const BodyPoses& placed, std::span<Twist> twists) const {
  assert(twists.size() == plan_.moved.size());
  for (std::size_t i = 0; i < twists.size(); ++i) {
    const std::uint32_t place = place_[i], carrier = carrier_[i];
    const BodyPlacement& body = placed[plan_.moved[i]];
    Twist own;
    if (place < plan_.given_bodies) {
      const BodyMotion& motion = instants_[k].moving->given[place];
      own = {motion.axis() * motion.angle(), motion.along()};
      if (columns_ > 0) {
        const double* const s = &slopes_[slot(k, side) * columns_ + plan_.joints.size() + 3 * std::size_t{place}];
        own.shift = {s[0], s[1], s[2]};
      }
    } else if (place != kNone) {
      own = twists_[slot(k, side) * plan_.bodies.size() + place];
    }
    const std::uint32_t parent = plan_.snapshot->parent[plan_.moved[i]];
    const Mat3d* const R_wp = parent == kNone ? nullptr : &placed[parent].pose.R_wb;
    const Vec3d shift = R_wp ? *R_wp * own.shift : own.shift;
    // A free body rotates about an axis fixed to itself; a link's twist is in its parent's axes.
    const Vec3d turn = place < plan_.given_bodies ? body.pose.R_wb * own.turn : R_wp ? *R_wp * own.turn : own.turn;
    twists[i] = {turn, shift};
    if (carrier == kNone) continue;
    const Twist& above = twists[carrier];
    twists[i].turn += above.turn;
    twists[i].shift += above.shift + cross(above.turn, body.pose.t_w - placed[parent].pose.t_w);
  }
}

}  // namespace clearance
