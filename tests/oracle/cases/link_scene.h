// Robots of balls next to a ball and a box: the distances of links with 60-digit poses are closed forms.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "tests/engine/evaluate_query.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {

using test::Real;
using test::RealFrame;
using test::RealVec;

inline constexpr double kBox[3] = {0.5, 0.25, 1};  // half of its edges

/// Of a link or of the world.
struct Ball {
  Vec3d centre;
  double radius;
};

/// Ranges of a random robot and its base.
struct Draw {
  double offset = 0.3;  // metres: of joints
  double arm = 0.1;     // ... of a link's ball
  double travel = 0;    // ... of sliding joints; 0 without any
  double far = 0;       // ... of the base
};

/// A number with few set bits, so that sums are exact.
inline double short_number(test::RobotRandom& random, double most) {
  return std::ldexp(std::round(random.uniform(-1, 1) * 64), -6) * std::exp2(std::floor(std::log2(most)));
}

inline std::string text_of(double x, double y, double z) {
  char text[100];
  std::snprintf(text, sizeof text, "%.17g %.17g %.17g", x, y, z);
  return text;
}

/// A tree of links that are balls, and joints of many kinds, some of which mimic the first.
inline std::string random_urdf(test::RobotRandom& random, const Draw& draw, int joints, std::vector<Ball>* balls) {
  std::string text = "<robot name='r'>";
  for (int l = 0; l <= joints; ++l) {
    const Vec3d c{short_number(random, draw.arm), short_number(random, draw.arm), short_number(random, draw.arm)};
    balls->push_back({c, 0x1p-7});
    text += "<link name='l" + std::to_string(l) + "'><collision><origin xyz='" + text_of(c.x, c.y, c.z) +
            "'/><geometry><sphere radius='0.0078125'/></geometry></collision></link>";
  }
  for (int j = 1; j <= joints; ++j) {
    const int parent = random.below(4) == 0 ? random.below(j) : j - 1;
    const int kind = draw.travel == 0 || j == 1 ? 0 : random.below(4);
    const auto one = [&] { return random.uniform(-draw.offset, draw.offset); };
    const Vec3d axis = random.direction();
    text += "<joint name='j" + std::to_string(j) + "' type='" +
            (kind < 2    ? "continuous"
             : kind == 2 ? "prismatic"
                         : "planar") +
            "'><parent link='l" + std::to_string(parent) + "'/><child link='l" + std::to_string(j) +
            "'/><origin xyz='" + text_of(one(), one(), one()) + "' rpy='" +
            text_of(random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3)) + "'/><axis xyz='" +
            (kind == 3 ? "0 0 1" : text_of(axis.x, axis.y, axis.z)) + "'/><limit lower='-1000' upper='1000'/>" +
            (j > 1 && kind == 0 && random.below(4) == 0 ? "<mimic joint='j1' multiplier='-0.7' offset='0.1'/>" : "") +
            "</joint>";
  }
  return text + "</robot>";
}

/// One scene: a robot, a ball that follows its last link, a ball and a box in the world.
class LinkScene {
 public:
  LinkScene(test::RobotRandom& random, const Draw& draw, bool uncertain_base = false) : random_(random), draw_(draw) {
    const TemporaryFolder folder;
    const std::string urdf = folder.write("r.urdf", random_urdf(random, draw, 3 + random.below(6), &balls_));
    engine::Scene scene;
    scene.add_box("box", {2 * kBox[0], 2 * kBox[1], 2 * kBox[2]}, {.is_static = true, .pose = box_ = pose(3)});
    ball_ = {pose(2).translation, 0.25};
    scene.add_sphere("ball", ball_.radius, {.pose = Pose{ball_.centre}});
    engine::RobotOptions options;
    options.urdf = urdf;
    options.home.emplace();
    if (draw.far > 0) options.base = base_ = random.pose(draw.far, 1);
    if (uncertain_base) {
      scene.add_sphere("cart", 0.25, {.pose = Pose{}, .uncertainty = {0.01, 0.1}});
      options.parent = "cart";
    }
    scene.add_robot("r", options);
    scene.add_sphere("cup", 0x1p-6, {.parent = "r/l" + std::to_string(balls_.size() - 1), .pose = cup_ = pose(0.5)});
    robot_ = scene.robots()[0];
    for (const SceneJoint& joint : scene.joints()) {
      const JointKind kind = robot_->model.joints[robot_->model.columns[joint.column].joint].kind;
      slides_.push_back(kind == JointKind::kPrismatic ||
                        (kind == JointKind::kPlanar && !joint.name.ends_with("/theta")));
      joints_.push_back(static_cast<std::uint32_t>(slides_.size() - 1));
    }
    engine_ = std::make_unique<engine::Engine>(std::move(scene), test::kWithoutCovers);
  }

  const engine::Engine& engine() const { return *engine_; }
  std::uint32_t body(const std::string& name) const { return engine_->scene().find_body(name); }
  std::span<const std::uint32_t> joints() const { return joints_; }
  std::vector<double> row() const {
    std::vector<double> q;
    for (const bool slides : slides_) q.push_back(random_.uniform(-1, 1) * (slides ? draw_.travel : 4));
    return q;
  }
  void set(std::span<const double> row) {
    std::vector<JointPosition> positions;
    for (std::size_t j = 0; j < row.size(); ++j) positions.push_back({joints_[j], row[j]});
    engine_->set_joints(positions);
  }

  /// The exact distance of each pair at these positions.
  std::vector<Real> exact_values(std::span<const BodyPair> pairs, std::span<const double> row) const {
    const std::vector<Pose> roots = {base_};
    const auto links = test::real_links(robot_->model, row.data(), robot_->kinematics.roots(), roots);
    std::vector<RealVec> centres(engine_->scene().bodies().size());
    std::vector<double> radii(centres.size(), ball_.radius);
    const auto at = [](const RealFrame& X, const Vec3d& v) { return (X * test::real_shift(v.x, v.y, v.z)).t; };
    centres[body("ball")] = {{ball_.centre.x, ball_.centre.y, ball_.centre.z}};
    for (std::size_t l = 0; l < links.size(); ++l) {
      centres[robot_->bodies[l]] = at(links[l], balls_[l].centre);
      radii[robot_->bodies[l]] = balls_[l].radius;
    }
    centres[body("cup")] = at(links.back() * test::real_frame(cup_), {0, 0, 0});
    radii[body("cup")] = 0x1p-6;
    std::vector<Real> exact_values;
    for (const auto [a, b] : pairs)
      exact_values.push_back(a == 0 ? to_box(centres[b]) - radii[b]
                                    : between(centres[a], centres[b]) - radii[a] - radii[b]);
    return exact_values;
  }
  /// Exceeds the sum of all claimed errors of rounding, metres.
  double claim() const {
    double reach = 1;
    for (std::uint32_t l = 0; l < balls_.size(); ++l) reach += robot_->kinematics.reach(l, 2 * draw_.arm);
    return 4e-14 * (reach + 3 * draw_.travel * static_cast<double>(slides_.size())) + 8e-15 * draw_.far;
  }

 private:
  Pose pose(double far) const { return random_.pose(far, 1); }
  static Real between(const RealVec& a, const RealVec& b) {
    Real sum = 0;
    for (int k = 0; k < 3; ++k) sum += (a.x[k] - b.x[k]) * (a.x[k] - b.x[k]);
    return sqrt(sum);
  }
  Real to_box(const RealVec& point) const {
    RealFrame X;
    X.t = point;
    RealVec in = (test::real_inverse(test::real_frame(box_)) * X).t, nearest = in;
    for (int k = 0; k < 3; ++k) nearest.x[k] = std::clamp(in.x[k], Real(-kBox[k]), Real(kBox[k]));
    return between(in, nearest);
  }

  test::RobotRandom& random_;
  Draw draw_;
  std::vector<Ball> balls_;  // by link
  Ball ball_{};
  Pose base_, box_, cup_;
  std::shared_ptr<const SceneRobot> robot_;
  std::vector<std::uint32_t> joints_;
  std::vector<bool> slides_;
  std::unique_ptr<engine::Engine> engine_;
};

}  // namespace clearance::exact
