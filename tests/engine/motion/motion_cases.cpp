#include "tests/engine/motion/motion_cases.h"

#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace clearance::test {

namespace {

constexpr double kThin = 1e-4;  // thickness of plates, in metres

std::string text_of(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  return text;
}

// A tree of links, each with a ball near its origin.
// \param moves the first joint moves
std::string random_urdf(Random& random, bool is_small, bool moves, std::vector<ExactScene::Shape>* balls) {
  constexpr const char* kTypes[] = {"revolute", "continuous", "prismatic", "fixed", "planar", "revolute"};
  const auto number = [&](double low, double high) { return text_of(random.uniform(low, high)); };
  const auto triple = [&](double size) {
    return number(-size, size) + " " + number(-size, size) + " " + number(-size, size);
  };
  std::string text = "<robot name='r'>";
  const int links = 4 + static_cast<int>(random.below(4));
  int driver = -1;
  for (int i = 0; i < links; ++i) {
    const std::string name = "l" + std::to_string(i);
    ExactScene::Shape ball;
    for (int k = 0; k < 3; ++k) ball.centre[k] = random.uniform(-0.1, 0.1);
    ball.radius = is_small ? std::pow(10, random.uniform(-4, -2)) : random.uniform(0.02, 0.08);
    balls->push_back(ball);
    text += "<link name='" + name + "'><collision><origin xyz='" + text_of(ball.centre.x) + " " +
            text_of(ball.centre.y) + " " + text_of(ball.centre.z) + "'/><geometry><sphere radius='" +
            text_of(ball.radius) + "'/></geometry></collision></link>";
    if (i == 0) continue;
    const int from = random.below(4) ? i - 1 : static_cast<int>(random.below(static_cast<std::uint64_t>(i)));
    const std::string type = kTypes[moves && i == 1 ? 0 : random.below(6)];
    text += "<joint name='j" + std::to_string(i) + "' type='" + type + "'><parent link='l" + std::to_string(from) +
            "'/><child link='" + name + "'/><origin xyz='" + triple(0.4) + "' rpy='" + triple(3) + "'/><axis xyz='" +
            (type == "planar" ? "0 0 1" : triple(1)) + "'/><limit lower='-3' upper='3'/>";
    if (driver >= 0 && type == "revolute" && random.below(3) == 0)
      text += "<mimic joint='j" + std::to_string(driver) + "' multiplier='" + number(-1.5, 1.5) + "' offset='0.1'/>";
    else if (type == "revolute")
      driver = i;
    text += "</joint>";
  }
  return text + "</robot>";
}

RealVec along(const RealVec& from, const RealVec& direction, double by) {
  RealVec p = from;
  for (int i = 0; i < 3; ++i) p.x[i] += direction.x[i] * by;
  return p;
}
Vec3d rounded(const RealVec& v) {
  return {static_cast<double>(v.x[0]), static_cast<double>(v.x[1]), static_cast<double>(v.x[2])};
}

// The quaternion (w x y z) of a rotation with the columns x, y and x cross y, computed from its largest component.
Pose pose_of(const Vec3d& t, const Vec3d& x, const Vec3d& y) {
  const Vec3d z = cross(x, y);
  Pose X{t};
  const double squares[4] = {1 + x.x + y.y + z.z, 1 + x.x - y.y - z.z, 1 - x.x + y.y - z.z, 1 - x.x - y.y + z.z};
  const auto most = std::max_element(squares, squares + 4) - squares;
  const double s = 2 * std::sqrt(squares[most]), wx = (y.z - z.y) / s, wy = (z.x - x.z) / s, wz = (x.y - y.x) / s;
  const double xy = (y.x + x.y) / s, xz = (z.x + x.z) / s, yz = (z.y + y.z) / s;
  const double all[4][4] = {{s / 4, wx, wy, wz}, {wx, s / 4, xy, xz}, {wy, xy, s / 4, yz}, {wz, xz, yz, s / 4}};
  X.qw = all[most][0], X.qx = all[most][1], X.qy = all[most][2], X.qz = all[most][3];
  return X;
}

}  // namespace

const char* name_of(MotionKind kind) {
  constexpr const char* kNames[] = {"random", "plate", "graze", "swing",     "contact",   "still",
                                    "unsure", "far",   "curve", "meanwhile", "trajectory"};
  static_assert(std::size(kNames) == kAllKinds);
  return kNames[static_cast<int>(kind)];
}

MotionCase::MotionCase(Random& random, MotionKind kind, int count, const std::string& folder)
    : random_(random), kind_(kind) {
  far_ = kind == MotionKind::kFar ? std::pow(10.0, random.uniform(1, 5)) : 0;
  const bool is_curved = kind >= MotionKind::kCurve;
  passes_plates_ = kind == MotionKind::kPlate || (is_curved && random.below(2) != 0);
  add_robot(folder);
  add_bodies();
  for (std::uint32_t j = 0; j < scene.joints().size(); ++j) motions.joints.push_back(j);
  exact.scene = &scene;
  if (kind == MotionKind::kCurve) {
    motions.points = 3 + static_cast<std::uint32_t>(random.below(6));
    for (int i = 0; i < count; ++i) add_curve();
  } else if (kind == MotionKind::kMeanwhile) {
    motions.points = 2 + static_cast<std::uint32_t>(random.below(7));
    motions.bodies.push_back(scene.find_body("flies"));
    if (random.below(2)) motions.bodies.push_back(scene.find_body("one"));
    const bool grows = random.below(2) != 0;
    for (int i = 0; i < count; ++i) {
      add_curve();
      add_bodies_meanwhile();
      for (std::size_t k = 0; grows && k < motions.points * motions.bodies.size(); ++k)
        motions.growths.push_back(random.below(4) ? random.uniform(0, 0.2) : 0);
      if (random.below(2)) let_meet();
    }
    moving_.insert(moving_.end(), motions.bodies.begin(), motions.bodies.end());
  } else if (kind == MotionKind::kTrajectory) {
    add_trajectory(count);
  } else {
    if (random.below(2) || motions.joints.empty()) motions.bodies.push_back(scene.find_body("flies"));
    if (!motions.bodies.empty()) moving_.push_back(motions.bodies[0]);
    if (random.below(3) == 0) motions.bodies.push_back(scene.find_body("r"));
    for (int i = 0; i < count; ++i) add_motion();
  }
  for (std::uint32_t i = 0; i < motions.count(); ++i) add_obstacle(i);
}

void MotionCase::add_robot(const std::string& folder) {
  std::vector<ExactScene::Shape> balls;
  const std::string path = folder + "/robot.urdf";
  std::ofstream file(path);
  file << random_urdf(random_, passes_plates_, kind_ >= MotionKind::kCurve, &balls);
  if (!file.flush()) throw std::runtime_error("cannot write " + path);
  engine::RobotOptions options;
  options.urdf = path;
  options.home.emplace();
  options.base = random_.pose(0.2);
  options.base.translation.x += far_;
  scene.add_robot("r", options);
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const std::uint32_t body = scene.find_body("r/l" + std::to_string(i));
    exact.shapes[body] = balls[i];
    if (i > 0) moving_.push_back(body);
  }
  exact.poses[scene.find_body("r")] = options.base;
  exact.origins = real_origins(scene.robots()[0]->model);
}

void MotionCase::add_bodies() {
  add_ball("one", "");
  add_ball("two", "");
  add_ball("flies", "");
  add_ball("held", "r/l" + std::to_string(moving_.size()));
  moving_.push_back(scene.find_body("held"));
}

// Its pose may be uncertain.
void MotionCase::add_ball(const std::string& name, const std::string& parent) {
  engine::Scene::BodyOptions options;
  options.pose = random_.pose(parent.empty() ? 1 : 0.2);
  if (parent.empty()) options.pose->translation.x += far_;
  options.parent = parent;
  ExactScene::Shape ball;
  ball.radius = options.radius = random_.uniform(0.02, 0.15);
  ball.centre = {random_.uniform(-0.2, 0.2), 0.1, 0};
  if (kind_ == MotionKind::kUnsure) {
    if (random_.below(2)) ball.position = options.uncertainty.position = random_.uniform(0, 0.02);
    if (random_.below(3)) ball.angle = options.uncertainty.angle = std::pow(10.0, random_.uniform(-4, -0.5));
  }
  const std::uint32_t body = scene.add_hull(name, std::span(&ball.centre, 1), options);
  exact.shapes[body] = ball;
  exact.poses[body] = *options.pose;
  if (!parent.empty()) exact.on[body] = scene.find_body(parent);
}

void MotionCase::add_motion() {
  const bool swings = kind_ == MotionKind::kSwing;
  const double size = kind_ == MotionKind::kStill ? 0 : std::pow(10.0, random_.uniform(-2, 0.5));
  const double turns = kind_ == MotionKind::kRandom && random_.below(2) ? random_.uniform(-6e5, 6e5) : 0;
  const RobotModel& robot = scene.robots()[0]->model;
  const auto is_turning = [&](std::size_t j) {
    const JointKind kind = robot.joints[robot.columns[scene.joints()[motions.joints[j]].column].joint].kind;
    return kind == JointKind::kRevolute || kind == JointKind::kContinuous;
  };
  std::vector<double> start, end;
  for (std::size_t j = 0; j < motions.joints.size(); ++j) {
    start.push_back((is_turning(j) ? turns : 0) + random_.uniform(-1.5, 1.5));  // large angles: times are rounded more
    const bool half = swings && is_turning(j) && random_.below(2);
    end.push_back(start[j] +
                  (half ? (random_.below(2) ? M_PI : -M_PI) : (swings ? 0.1 : 1) * size * random_.uniform(-1, 1)));
  }
  motions.positions.insert(motions.positions.end(), start.begin(), start.end());
  motions.positions.insert(motions.positions.end(), end.begin(), end.end());
  std::vector<Pose> from, to;
  for (std::size_t b = 0; b < motions.bodies.size(); ++b) {
    from.push_back(random_.pose(0.8));
    to.push_back(random_.pose(0.8));
    for (Pose* X : {&from.back(), &to.back()}) X->translation.x += far_;
    if (swings || random_.below(4) == 0) {  // half a turn, or nearly
      const Pose& q = from.back();
      to.back().qw = -q.qx, to.back().qx = q.qw, to.back().qy = q.qz, to.back().qz = -q.qy;
      if (random_.below(2)) to.back().qw += q.qw * 1e-6;
    }
    if (kind_ == MotionKind::kStill) to.back() = from.back();
  }
  motions.poses.insert(motions.poses.end(), from.begin(), from.end());
  motions.poses.insert(motions.poses.end(), to.begin(), to.end());
  named.push_back(kind_ == MotionKind::kContact ? static_cast<double>(random_.below(2)) : random_.uniform(0, 1));
}

// Control points at random, or with both ends at rest as far as there are points: the curve overshoots in any case.
void MotionCase::add_curve() {
  const double size = std::pow(10.0, random_.uniform(-2, 0.5));
  const std::size_t joints = motions.joints.size(), first = motions.positions.size();
  const bool rests = random_.below(3) == 0;
  motions.positions.resize(first + motions.points * joints);
  for (std::size_t j = 0; j < joints; ++j) {
    const double at = random_.uniform(-1.5, 1.5), to = at + size * random_.uniform(-1, 1);
    for (std::uint32_t p = 0; p < motions.points; ++p) {
      double& q = motions.positions[first + p * joints + j];
      q = rests ? (2 * p < motions.points ? at : to) : at + size * random_.uniform(-1, 1);
    }
  }
  named.push_back(random_.uniform(0, 1));
}

// Poses of one motion at random. Along curves bodies do not turn.
void MotionCase::add_bodies_meanwhile() {
  const std::size_t first = motions.poses.size(), bodies = motions.bodies.size();
  motions.poses.resize(first + motions.points * bodies);
  for (std::size_t b = 0; b < bodies; ++b) {
    const Pose start = random_.pose(0.8);
    const double size = std::pow(10.0, random_.uniform(-1, 0.3));
    for (std::uint32_t p = 0; p < motions.points; ++p) {
      Pose& X = motions.poses[first + p * bodies + b];
      X = motions.points == 2 && p > 0 ? random_.pose(0.8) : start;
      for (int k = 0; k < 3 && p > 0; ++k) X.translation[k] = start.translation[k] + size * random_.uniform(-1, 1);
    }
  }
}

// Shifts the first body of the last motion: it passes a link, or cuts into it, at the named time.
void MotionCase::let_meet() {
  const auto motion = static_cast<std::uint32_t>(named.size() - 1);
  const std::uint32_t body = motions.bodies[0], link = moving_[random_.below(moving_.size())];
  const ExactScene::Moment moment = exact.at(motions, motion, named[motion]);
  const RealVec n = any_across(way_at(motion, body, named[motion]) - way_at(motion, link, named[motion]));
  const double graze = std::pow(10.0, random_.uniform(-6, -4)) * (random_.below(2) ? 1 : -1);
  const double apart =
      exact.shapes.at(body).radius + exact.shapes.at(link).radius + static_cast<double>(moment.at(body).growth) + graze;
  const Vec3d shift = rounded(along(moment.at(link).centre, n, apart) - moment.at(body).centre);
  for (std::uint32_t p = 0; p < motions.points; ++p) {
    Pose& X = motions.poses[(motion * motions.points + p) * motions.bodies.size()];
    X.translation = X.translation + shift;
  }
}

// Where a body's centre moves to.
RealVec MotionCase::way_at(std::uint32_t motion, std::uint32_t body, const Real& t) const {
  return exact.at(motions, motion, t + Real("1e-9")).at(body).centre - exact.at(motions, motion, t).at(body).centre;
}

// A unit vector perpendicular to another.
RealVec MotionCase::any_across(const RealVec& way) {
  RealVec n{{random_.normal(), random_.normal(), random_.normal()}};
  const Real by = real_dot(n, way) / real_dot(way, way);
  for (int i = 0; i < 3; ++i) n.x[i] -= by * way.x[i];
  const Real length = real_length(n);
  for (Real& x : n.x) x /= length;
  return n;
}

// Places an obstacle where a ball passes at the motion's named time.
void MotionCase::add_obstacle(std::uint32_t motion) {
  std::uint32_t body = moving_[random_.below(moving_.size())];
  const double t = named[motion];
  ExactScene::Moment at = exact.at(motions, motion, t), after = exact.at(motions, motion, Real(t) + Real("1e-9"));
  const bool turns = kind_ == MotionKind::kTrajectory && turns_[motion];
  for (const std::uint32_t other : moving_)  // not all are moved by a joint alone
    if (turns && real_length(after.at(body).centre - at.at(body).centre) == 0) body = other;
  const ExactScene::Placed there = at.at(body);
  const double radius = exact.shapes.at(body).radius + static_cast<double>(there.growth);
  const RealVec centre = there.centre;
  RealVec way = after.at(body).centre - centre;
  const Real length = real_length(way);
  if (length == 0)
    way = {{1, 0, 0}};
  else
    for (Real& x : way.x) x /= length;
  const RealVec n = any_across(way);
  const double graze = std::pow(10.0, random_.uniform(-6, -4)) * (random_.below(2) ? 1 : -1);
  const std::string name = "obstacle" + std::to_string(motion);
  ExactScene::Shape shape;
  if (turns && random_.below(4) != 0) {  // beyond its turn: the farthest that it gets
    ++beyond_turns;
    shape = {.half = {0.05, 0.05, 0.5 * kThin}, .is_box = true};
    const Vec3d z = rounded(way), x = rounded(n);
    return put(name, shape, pose_of(rounded(along(centre, way, -(0.5 * kThin + radius + graze))), x, cross(z, x)));
  }
  if (passes_plates_) {
    const double wide = random_.uniform(0.01, 0.1);
    shape = {.half = {wide, wide, 0.5 * kThin}, .is_box = true};
    const double beside = random_.below(2) ? wide + radius + graze : random_.uniform(-0.5, 0.5) * wide;
    const Vec3d x = rounded(n), z = rounded(way);
    return put(name, shape, pose_of(rounded(along(centre, n, beside)), x, cross(z, x)));
  }
  if (kind_ == MotionKind::kContact) {  // before the start, or after the end
    constexpr double kGaps[] = {0, 1e-9, -1e-9, 1e-6, -1e-6};
    shape.radius = random_.uniform(0.01, 0.1);
    const double far = (radius + shape.radius + kGaps[random_.below(5)]) * (t > 0.5 ? 1 : -1);
    return put(name, shape, Pose{rounded(along(centre, way, far))});
  }
  if (random_.below(2)) {
    shape.radius = random_.uniform(0.01, 0.1);
    return put(name, shape, Pose{rounded(along(centre, n, radius + shape.radius + graze))});
  }
  shape = {.half = {0.05, 0.05, 0.5 * kThin}, .is_box = true};  // its face
  const Vec3d z = rounded(n), x = rounded(way);
  put(name, shape, pose_of(rounded(along(centre, n, 0.5 * kThin + radius + graze)), x, cross(z, x)));
}

void MotionCase::put(const std::string& name, const ExactScene::Shape& shape, const Pose& X) {
  engine::Scene::BodyOptions options;
  options.pose = X;
  const std::uint32_t body =
      shape.is_box ? scene.add_box(name, shape.half * 2, options) : scene.add_sphere(name, shape.radius, options);
  exact.shapes[body] = shape;
  exact.poses[body] = X;
}

Motions MotionCase::one(std::uint32_t motion) const {
  Motions one = motions;
  const auto joints = static_cast<std::ptrdiff_t>(one.points * one.joints.size()),
             bodies = static_cast<std::ptrdiff_t>(one.points * one.bodies.size());
  one.positions.assign(motions.positions.begin() + motion * joints, motions.positions.begin() + (motion + 1) * joints);
  one.poses.assign(motions.poses.begin() + motion * bodies, motions.poses.begin() + (motion + 1) * bodies);
  if (!motions.growths.empty())
    one.growths.assign(motions.growths.begin() + motion * bodies, motions.growths.begin() + (motion + 1) * bodies);
  return one;
}

}  // namespace clearance::test
