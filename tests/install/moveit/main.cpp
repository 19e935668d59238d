// try_moveit URDF: the collision detector in MoveIt's planning scenes, compared with MoveIt's own detector (FCL), with
// sampled motions, and with a scene that Clearance reads from the same URDF. Exit code 0 if all is correct.
#include <clearance/eigen.h>
#include <clearance/engine.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <limits>
#include <memory>
#include <rclcpp/contexts/default_context.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/install/moveit/scenes.h"

// MoveIt's logger makes a node, and clocks that sleep wait for a context: both need all of rclcpp, and neither is used.
namespace moveit {
rclcpp::Logger getLogger(const std::string& name) {
  return rclcpp::get_logger(name);
}
}  // namespace moveit
namespace rclcpp {
bool Context::is_valid() const {
  return false;
}
namespace contexts {
DefaultContext::SharedPtr get_global_default_context() {
  return nullptr;
}
}  // namespace contexts
}  // namespace rclcpp

namespace {

using namespace try_moveit;
using namespace collision_detection;

/// The state in a scene that Clearance reads from the URDF itself: its robot among the same primitives.
void compare_with_urdf(const Scenes& scenes, const std::string& urdf) {
  clearance::Scene scene;
  scene.add_robot("arm", {.urdf = urdf, .is_static = true});
  const auto pose = [](const Eigen::Isometry3d& X) { return clearance::eigen::pose(X); };
  scene.add_box("box", {0.4, 0.5, 0.3}, {.X_parent_body = pose(at(0.7, 0.2, 0.5, 0.7))});
  scene.add_sphere("ball", 0.2, {.X_parent_body = pose(at(-0.6, -0.4, 0.8))});
  scene.add_cylinder("post", 0.1, 1.2, {.X_parent_body = pose(at(-0.3, 0.8, 0.6, 0.2))});
  scene.add_cone("cone", 0.2, 0.5, {.X_parent_body = pose(at(0.4, -0.8, 0.9, 1.2))});
  const clearance::Engine engine(std::move(scene), {.covers = "off"});
  const clearance::Joints joints = engine.joints("arm");
  std::vector<clearance::IdPair> pairs;
  for (const char* object : {"box", "ball", "post", "cone"})
    for (const auto& group : engine.scene().bodies)
      if (group.name.starts_with("arm/")) pairs.push_back({engine.body(group.name), engine.body(object)});
  PlanningScene& ours = *scenes.ours;
  AllowedCollisionMatrix matrix = ours.getAllowedCollisionMatrix();
  for (const char* object : {"plate", "cells"})
    matrix.setEntry(object, ours.getRobotModel()->getLinkModelNames(), true);
  RobotState state(ours.getRobotModel());
  int apart = 0;
  for (int i = 0; i < 100; ++i) {
    state.setToRandomPositions();
    state.update();
    std::vector<double> q;
    for (const std::string& name : joints.names)
      q.push_back(state.getVariablePosition(name.substr(name.find('/') + 1)));
    const clearance::Result expected =
        engine.distances({.pairs = pairs, .joints = joints.ids, .positions = q, .reduce = clearance::Reduce::kMin});
    DistanceRequest request;
    request.acm = &matrix;
    DistanceResult result;
    ours.getCollisionEnv()->distanceRobot(request, result, state);
    if (expected.status()[0] != clearance::Status::kOk) continue;
    ++apart;
    const double d = result.minimum_distance.distance;
    check(d <= expected.upper()[0] + 1e-12 && d >= expected.lower()[0] - 1e-6, "the distance of the URDF's own scene");
  }
  check(apart > 20, "states of the URDF's own scene apart");
}

void try_changes(const Scenes& scenes) {
  PlanningScene& scene = *scenes.ours;
  World& world = *scene.getWorldNonConst();
  RobotState state(scene.getRobotModel());
  state.setToDefaultValues();
  state.update();
  check(!collide(scene, state).collision, "upright, the arm is free");
  const Eigen::Isometry3d X_wg = state.getGlobalLinkTransform("gripper");
  const auto ball = std::make_shared<shapes::Sphere>(0.05);

  // An octree that changes in place, as an octomap monitor changes it.
  const auto tree = std::make_shared<octomap::OcTree>(0.05);
  const Eigen::Vector3f p = X_wg.translation().cast<float>();
  tree->updateNode(octomap::point3d(3, 0, 0), true);
  world.addToObject("map", std::make_shared<shapes::OcTree>(tree), Eigen::Isometry3d::Identity());
  check(!collide(scene, state).collision, "a cell far away");
  tree->updateNode(octomap::point3d(p.x(), p.y(), p.z()), true);
  check(collide(scene, state).collision, "a cell that became occupied");
  tree->setNodeValue(octomap::point3d(p.x(), p.y(), p.z()), -1.0F);
  check(!collide(scene, state).collision, "and free again");
  world.removeObject("map");

  // Objects and their moves, also without a notification; a child scene has its own.
  const auto child = scene.diff();
  child->getWorldNonConst()->addToObject("new", ball, X_wg);
  check(collide(*child, state).collision && !collide(scene, state).collision, "an object of a child scene");
  world.addToObject("new", ball, X_wg);
  check(collide(scene, state).collision, "a new object");
  const CollisionResult contacts = collide(scene, state, true);
  check(contacts.contacts.contains({"gripper", "new"}) && contacts.contacts.at({"gripper", "new"})[0].depth > 0.02,
        "its contact");
  world.moveShapesInObject("new", {at(2, 0, 0)});
  check(!collide(scene, state).collision, "an object that moved away");
  world.setObjectPose("new", at(-2, 0, 0) * X_wg);
  check(collide(scene, state).collision, "and back");

  // Matrices that change after a plan was kept.
  AllowedCollisionMatrix& matrix = scene.getAllowedCollisionMatrixNonConst();
  matrix.setDefaultEntry("new", true);
  check(!collide(scene, state).collision, "an allowed object");
  matrix.setDefaultEntry("new", false);
  check(collide(scene, state).collision, "no longer allowed");
  DecideContactFn accept = [](Contact&) { return true; };
  matrix.setDefaultEntry("new", accept);
  check(collide(scene, state).collision, "conditional entries do not allow");
  world.removeObject("new");
  check(!collide(scene, state).collision, "a removed object");

  // Padding is a distance.
  const double d = distance(scene, state);
  const auto env = scene.getCollisionEnvNonConst();
  env->setPadding(0.01);
  check(std::abs(distance(scene, state) - (d - 0.02)) < 1e-6, "self-distance of padded links");
  env->setPadding(0.0);
  check(distance(scene, state) == d, "and without padding again");

  // Shapes that are not taken, and values that are no numbers, are never free.
  world.addToObject("floor", std::make_shared<shapes::Plane>(0, 0, 1, 5), Eigen::Isometry3d::Identity());
  check(collide(scene, state).collision && distance(scene, state) == -std::numeric_limits<double>::infinity(),
        "a plane is not taken");
  matrix.setEntry("floor", scene.getRobotModel()->getLinkModelNames(), true);
  check(!collide(scene, state).collision, "an allowed plane does not matter");
  world.removeObject("floor");
  RobotState bad(state);
  bad.setVariablePosition("elbow", std::nan(""));
  check(collide(scene, bad).collision && !(distance(scene, bad) > 0), "a position that is no number");
  check(motion_hits(scene, state, bad), "and a motion to it");
}

/// An edge whose samples are free, past a thin sheet.
void try_motion(const Scenes& scenes) {
  PlanningScene& scene = *scenes.ours;
  RobotState from(scene.getRobotModel()), to(from), between(from);
  from.setToDefaultValues();
  from.setVariablePosition("lift", 1.2);
  to = from;
  to.setVariablePosition("turn", 1.0);
  from.setVariablePosition("turn", -1.0);
  from.update();
  to.update();
  scene.getWorldNonConst()->clearObjects();
  check(!motion_hits(scene, from, to), "a free motion");
  scene.getWorldNonConst()->addToObject("sheet", std::make_shared<shapes::Box>(2.0, 0.001, 0.001), at(0.75, 0.06, 0.4));
  check(!collide(scene, from).collision && !collide(scene, to).collision, "free ends");
  check(motion_hits(scene, from, to), "a sheet between two free ends");
  CollisionRequest request;
  request.contacts = true;
  CollisionResult result;
  scene.getCollisionEnv()->checkRobotCollision(request, result, from, to);
  const Contact& contact = result.contacts.begin()->second.at(0);
  from.interpolate(to, contact.percent_interpolation, between);
  between.update();
  check(contact.percent_interpolation > 0 && collide(scene, between).collision, "the contact's time");
}

/// A joint without limits from 3 to -3 rad, through a half turn.
void try_shorter_way(const Scenes& scenes) {
  PlanningScene& scene = *scenes.ours;
  RobotState from(scene.getRobotModel()), to(from), between(from);
  from.setToDefaultValues();
  from.setVariablePosition("lift", 1.2);
  from.setVariablePosition("turn", 3.0);
  to = from;
  to.setVariablePosition("turn", -3.0);
  const auto hits_at = [&](double turn) {
    between = from;
    between.setVariablePosition("turn", turn);
    between.update();
    scene.getWorldNonConst()->clearObjects();
    scene.getWorldNonConst()->addToObject("ball", std::make_shared<shapes::Sphere>(0.01),
                                          between.getGlobalLinkTransform("gripper"));
    return motion_hits(scene, from, to);
  };
  check(hits_at(3.1), "a ball on the shorter way");
  check(!hits_at(0), "a ball on the longer way");
}

/// Threads with and without an attached body, which share an environment.
void try_threads(const Scenes& scenes) {
  const auto held = [](RobotState& state) {
    state.attachBody("held", at(0, 0.2, 0), {std::make_shared<shapes::Box>(0.1, 0.3, 0.1)}, {at(0, 0, 0)},
                     std::vector<std::string>{"gripper", "left_finger", "right_finger"}, "gripper");
  };
  compare(scenes, "attached", 200, held);
  std::vector<RobotState> states;
  std::vector<char> serial;
  for (int i = 0; i < 60; ++i) {
    RobotState& state = states.emplace_back(scenes.ours->getRobotModel());
    state.setToRandomPositions();
    if (i % 20 < 10) held(state);
    state.update();
    serial.push_back(collide(*scenes.ours, state).collision);
  }
  std::vector<std::thread> threads;
  std::atomic<int> wrong = 0;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (std::size_t i = 0; i < states.size(); ++i) {
        const std::size_t k = (i + 15 * t) % states.size();
        wrong += collide(*scenes.ours, states[k]).collision != static_cast<bool>(serial[k]);
      }
    });
  for (std::thread& thread : threads) thread.join();
  check(wrong == 0, "threads have the answers of one");
}

void time_checks(const Scenes& scenes) {
  std::vector<RobotState> states;
  for (int i = 0; i < 500; ++i) {
    RobotState& state = states.emplace_back(scenes.ours->getRobotModel());
    state.setToRandomPositions();
    state.update();
  }
  // By turns; the first half lets the engine make its covers.
  std::vector<double> fcl, ours, ratios;
  for (int turn = 0; turn < 200; ++turn) {
    const auto time = [&](const PlanningScene& scene) {
      const auto begin = std::chrono::steady_clock::now();
      for (const RobotState& state : states) collide(scene, state);
      const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
      return took.count() / static_cast<double>(states.size());
    };
    fcl.push_back(time(*scenes.fcl));
    ours.push_back(time(*scenes.ours));
    ratios.push_back(ours.back() / fcl.back());
  }
  const auto median = [](std::vector<double>& values) {
    values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
    std::ranges::sort(values);
    return values[values.size() / 2];
  };
  std::printf("a state: FCL %.1f us, Clearance %.1f us, ratio %.2f\n", median(fcl), median(ours), median(ratios));
}

}  // namespace

int main(int, char** argv) {
  std::ostringstream text;
  text << std::ifstream(argv[1]).rdbuf();
  std::string urdf = text.str();  // MoveIt's parser wants two numbers more
  const std::string limit = "<limit ";
  for (std::size_t i = 0; (i = urdf.find(limit, i)) != std::string::npos; i += limit.size())
    urdf.insert(i + limit.size(), "effort=\"1\" velocity=\"1\" ");
  const Scenes fixed(model(urdf, "fixed"));
  fixed.both(add_objects);
  compare(fixed, "fixed", 400);
  compare_with_urdf(fixed, argv[1]);
  try_threads(fixed);
  time_checks(fixed);
  try_changes(fixed);
  try_motion(fixed);

  // A floating root, and a joint that takes the shorter way round.
  std::string continuous = urdf;
  const std::string turn = "name=\"turn\" type=\"revolute\"";
  continuous.replace(continuous.find(turn), turn.size(), "name=\"turn\" type=\"continuous\"");
  try_shorter_way(Scenes(model(continuous, "fixed")));
  const Scenes floating(model(continuous, "floating"));
  floating.both(add_objects);
  random_numbers::RandomNumberGenerator rng(3);
  compare(floating, "floating", 200, [&](RobotState& state) {
    double q[4];
    rng.quaternion(q);
    state.setJointPositions("root", std::vector<double>{rng.uniformReal(-0.5, 0.5), rng.uniformReal(-0.5, 0.5),
                                                        rng.uniformReal(0, 0.5), q[0], q[1], q[2], q[3]});
  });
  const Scenes planar(model(urdf, "planar"));
  planar.both(add_objects);
  compare(planar, "planar", 200, [&](RobotState& state) {
    state.setJointPositions(
        "root", std::vector<double>{rng.uniformReal(-0.3, 0.3), rng.uniformReal(-0.3, 0.3), rng.uniformReal(-3, 3)});
  });
  std::puts("the collision detector agrees with FCL, sampled motions and the URDF's own scene");
}
