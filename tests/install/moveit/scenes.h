// Planning scenes of an arm among objects, with MoveIt's detector (FCL) and with ours, and their comparison.
#pragma once

#include <clearance_moveit/collision_env.h>
#include <geometric_shapes/shapes.h>
#include <octomap/octomap.h>
#include <srdfdom/model.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <moveit/planning_scene/planning_scene.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace try_moveit {

using namespace collision_detection;
using moveit::core::RobotState;
using planning_scene::PlanningScene;

inline constexpr double kNear = 1e-5;  // metres, within which FCL may differ

inline void check(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what.c_str());
  std::exit(1);
}

inline const std::vector<std::pair<std::string, std::string>> kAdjacent = {
    {"base", "shoulder"},   {"shoulder", "upper_arm"}, {"upper_arm", "forearm"},    {"forearm", "wrist_1"},
    {"wrist_1", "wrist_2"}, {"wrist_2", "flange"},     {"flange", "gripper"},       {"gripper", "left_finger"},
    {"wrist_1", "flange"},  {"wrist_2", "gripper"},    {"gripper", "right_finger"}, {"left_finger", "right_finger"}};

/// A robot model of a URDF, whose root is attached to the world by a joint of a type.
inline moveit::core::RobotModelPtr model(const std::string& urdf, const std::string& root) {
  std::ostringstream srdf;
  srdf << "<robot name=\"arm\"><virtual_joint name=\"root\" type=\"" << root
       << "\" parent_frame=\"world\" child_link=\"base\"/><group name=\"hand\"><joint name=\"grip\"/></group>"
       << "<group name=\"all\"><chain base_link=\"base\" tip_link=\"gripper\"/></group>";
  for (const auto& [a, b] : kAdjacent)
    srdf << "<disable_collisions link1=\"" << a << "\" link2=\"" << b << "\" reason=\"Adjacent\"/>";
  srdf << "</robot>";
  const auto parsed = urdf::parseURDF(urdf);
  const auto semantics = std::make_shared<srdf::Model>();
  check(parsed && semantics->initString(*parsed, srdf.str()), "URDF and SRDF can be read");
  return std::make_shared<moveit::core::RobotModel>(parsed, semantics);
}

inline Eigen::Isometry3d at(double x, double y, double z, double turn = 0) {
  return Eigen::Translation3d(x, y, z) * Eigen::AngleAxisd(turn, Eigen::Vector3d(1, 2, 3).normalized());
}

inline shapes::ShapeConstPtr plate(double x, double y, double z) {
  auto* mesh = new shapes::Mesh(8, 12);
  for (unsigned i = 0; i < 8; ++i)
    for (unsigned axis = 0; axis < 3; ++axis)
      mesh->vertices[3 * i + axis] = ((i >> axis & 1) ? 0.5 : -0.5) * std::array{x, y, z}[axis];
  const unsigned faces[] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                            2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};
  std::copy(std::begin(faces), std::end(faces), mesh->triangles);
  return shapes::ShapeConstPtr(mesh);
}

inline shapes::ShapeConstPtr cells(double edge) {
  auto tree = std::make_shared<octomap::OcTree>(edge);
  for (int x = 0; x < 8; ++x)  // blocks of eight cells, which prune() makes one, and single cells
    for (int y = 0; y < 4; ++y)
      for (int z = 0; z < 2; ++z)
        if (x < 4 || (x + y) % 2)
          tree->updateNode(octomap::point3d((x + 0.5) * edge, (y + 0.5) * edge, (z + 0.5) * edge), true);
  tree->updateNode(octomap::point3d(-0.5 * edge, 0.5 * edge, 0.5 * edge), false);
  tree->updateInnerOccupancy();
  tree->prune();
  return std::make_shared<shapes::OcTree>(tree);
}

inline void add_objects(PlanningScene& scene) {
  World& world = *scene.getWorldNonConst();
  world.addToObject("box", std::make_shared<shapes::Box>(0.4, 0.5, 0.3), at(0.7, 0.2, 0.5, 0.7));
  world.addToObject("ball", std::make_shared<shapes::Sphere>(0.2), at(-0.6, -0.4, 0.8));
  world.addToObject("post", std::make_shared<shapes::Cylinder>(0.1, 1.2), at(-0.3, 0.8, 0.6, 0.2));
  world.addToObject("cone", std::make_shared<shapes::Cone>(0.2, 0.5), at(0.4, -0.8, 0.9, 1.2));
  world.addToObject("plate", plate(0.6, 0.6, 0.01), at(-0.6, 0.3, 0.2, 0.4));
  world.addToObject("cells", cells(0.1), at(0.2, 0.3, 1.1, 0.3));
}

inline CollisionResult collide(const PlanningScene& scene, const RobotState& state, bool contacts = false) {
  CollisionRequest request;
  request.contacts = contacts;
  request.max_contacts = contacts ? 100 : 1;
  CollisionResult result;
  scene.checkCollision(request, result, state);
  return result;
}

inline double distance(const PlanningScene& scene, const RobotState& state) {
  DistanceRequest request;
  request.enable_signed_distance = true;
  request.acm = &scene.getAllowedCollisionMatrix();
  DistanceResult self, world;
  scene.getCollisionEnv()->distanceSelf(request, self, state);
  scene.getCollisionEnv()->distanceRobot(request, world, state);
  return std::min(self.minimum_distance.distance, world.minimum_distance.distance);
}

inline bool motion_hits(const PlanningScene& scene, const RobotState& from, const RobotState& to) {
  CollisionRequest request;
  CollisionResult result;
  scene.getCollisionEnv()->checkRobotCollision(request, result, from, to, scene.getAllowedCollisionMatrix());
  return result.collision;
}

struct Scenes {
  explicit Scenes(const moveit::core::RobotModelPtr& model)
      : fcl(std::make_shared<PlanningScene>(model)), ours(std::make_shared<PlanningScene>(model)) {
    ours->allocateCollisionDetector(clearance_moveit::CollisionDetectorAllocator::create());
    check(ours->getCollisionDetectorName() == "Clearance" && fcl->getCollisionDetectorName() == "FCL", "detectors");
  }
  void both(const std::function<void(PlanningScene&)>& change) const {
    change(*fcl);
    change(*ours);
  }
  std::shared_ptr<PlanningScene> fcl, ours;
};

/// States and motions of both detectors. `prepare` changes each random state.
inline void compare(const Scenes& scenes, const std::string& name, int states,
                    const std::function<void(RobotState&)>& prepare = {}) {
  random_numbers::RandomNumberGenerator rng(7);
  RobotState state(scenes.fcl->getRobotModel()), next(state), between(state);
  const auto draw = [&](RobotState& drawn) {
    for (const auto* joint : drawn.getRobotModel()->getActiveJointModels()) {
      std::vector<double> values(joint->getVariableCount());
      joint->getVariableRandomPositions(rng, values.data());
      drawn.setJointPositions(joint, values.data());
    }
    if (prepare) prepare(drawn);
    drawn.update();
  };
  int free = 0, hit = 0, near = 0, motions_free = 0, motions_hit = 0, contacts = 0;
  for (int i = 0; i < states; ++i) {
    draw(state);
    const bool fcl = collide(*scenes.fcl, state).collision, ours = collide(*scenes.ours, state).collision;
    const double d = distance(*scenes.ours, state);
    check(ours == !(d > 0), name + ": the check and the sign of the distance, " + std::to_string(d));
    if (fcl != ours) check(std::abs(d) < kNear, name + ": FCL differs at a distance of " + std::to_string(d));
    ++(fcl != ours ? near : ours ? hit : free);
    if (ours) contacts += collide(*scenes.ours, state, true).contact_count > 0;
    draw(next);
    between = state;
    between.interpolate(next, 0.2, between);
    next = between;
    next.update();
    const bool hits = motion_hits(*scenes.ours, state, next);
    ++(hits ? motions_hit : motions_free);
    for (int k = 0; k <= 20 && !hits; ++k) {
      state.interpolate(next, k / 20.0, between);
      between.update();
      CollisionRequest request;
      CollisionResult result;
      scenes.fcl->getCollisionEnv()->checkRobotCollision(request, result, between,
                                                         scenes.fcl->getAllowedCollisionMatrix());
      check(!result.collision, name + ": a sample of a free motion hits");
    }
  }
  std::printf("%s: %d free, %d hit, %d near; motions: %d free, %d not\n", name.c_str(), free, hit, near, motions_free,
              motions_hit);
  check(free > states / 20 && hit > states / 20 && motions_free > states / 20 && motions_hit > states / 20,
        name + ": the cases are met");
  check(contacts == hit + near || contacts >= hit, name + ": each hit has a contact");
}

}  // namespace try_moveit
