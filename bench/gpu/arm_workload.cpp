#include "bench/gpu/arm_workload.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/engine/engine_test_util.h"

namespace clearance::test {

namespace {

constexpr std::uint32_t kArmLinks = 8, kThings = 21;

struct ArmJoint {
  const char* origin;  // in the frame of the link before it
  double lower, upper;
};
constexpr ArmJoint kArmJoints[] = {{R"(xyz="0 0 0.333")", -2.9, 2.9},
                                   {R"(rpy="-1.57079632679 0 0")", -1.76, 1.76},
                                   {R"(xyz="0 -0.316 0" rpy="1.57079632679 0 0")", -2.9, 2.9},
                                   {R"(xyz="0.0825 0 0" rpy="1.57079632679 0 0")", -3.07, -0.07},
                                   {R"(xyz="-0.0825 0.384 0" rpy="-1.57079632679 0 0")", -2.9, 2.9},
                                   {R"(rpy="1.57079632679 0 0")", -0.0175, 3.75},
                                   {R"(xyz="0.088 0 0" rpy="1.57079632679 0 0")", -2.9, 2.9}};
struct LinkShape {
  Vec3d size, centre;  // half axes of an ellipsoid, metres
};
constexpr LinkShape kArmShapes[kArmLinks] = {{{0.1, 0.1, 0.15}, {0, 0, 0.15}},      {{0.07, 0.1, 0.07}, {0, 0, 0}},
                                             {{0.06, 0.2, 0.06}, {0, -0.16, 0}},    {{0.08, 0.06, 0.07}, {0, 0, 0}},
                                             {{0.06, 0.2, 0.06}, {-0.05, 0.18, 0}}, {{0.05, 0.06, 0.08}, {0, 0, 0}},
                                             {{0.06, 0.05, 0.05}, {0.06, 0, 0}},    {{0.1, 0.04, 0.05}, {0, 0, 0.12}}};

std::string urdf() {
  std::string text = "<robot name=\"arm\"><link name=\"l0\"/>";
  for (std::uint32_t i = 1; i < kArmLinks; ++i) {
    const ArmJoint& joint = kArmJoints[i - 1];
    const std::string number = std::to_string(i);
    text += "<link name=\"l" + number + "\"/><joint name=\"j" + number + "\" type=\"revolute\"><parent link=\"l" +
            std::to_string(i - 1) + "\"/><child link=\"l" + number + "\"/><origin " + joint.origin +
            "/><axis xyz=\"0 0 1\"/><limit lower=\"" + std::to_string(joint.lower) + "\" upper=\"" +
            std::to_string(joint.upper) + "\"/></joint>";
  }
  return text + "</robot>";
}

std::vector<Vec3d> ellipsoid(Random& random, int vertices, const Vec3d& size, const Vec3d& centre) {
  std::vector<Vec3d> points = random.cloud(vertices, {1, 1, 1});
  for (Vec3d& p : points) {
    p = p * (1 / norm(p));
    p = Vec3d{p.x * size.x, p.y * size.y, p.z * size.z} + centre;
  }
  return points;
}

std::string hull_name(std::uint32_t link) {
  return "hull" + std::to_string(link);
}
std::string thing_name(std::uint32_t i) {
  return "thing" + std::to_string(i);
}

}  // namespace

Scene arm_scene_of_hulls() {
  Random random(19);
  Scene scene;
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("clearance_arm_" + std::to_string(getpid()) + ".urdf");
  std::ofstream(file) << urdf();
  RobotOptions options;
  options.urdf = file;
  options.home = {{"j4", -1.5}};
  options.is_static = true;
  scene.add_robot("arm", options);
  std::filesystem::remove(file);
  for (std::uint32_t i = 0; i < kArmLinks; ++i)
    scene.add_hull(hull_name(i),
                   ellipsoid(random, 48 + 6 * static_cast<int>(i), kArmShapes[i].size, kArmShapes[i].centre),
                   {.parent = "arm/l" + std::to_string(i), .pose = Pose()});
  scene.add_box(thing_name(0), {2, 2, 0.1}, {.is_static = true, .pose = Pose{{0, 0, -0.06}}});
  for (std::uint32_t i = 1; i < kThings; ++i) {
    const double turn = random.uniform(-M_PI, M_PI), far = random.uniform(0.45, 0.95), high = random.uniform(0, 1.1);
    Pose pose = random.pose(1);
    pose.translation = {far * std::cos(turn), far * std::sin(turn), high};
    const Vec3d size{random.uniform(0.03, 0.12), random.uniform(0.03, 0.12), random.uniform(0.03, 0.12)};
    scene.add_hull(thing_name(i), ellipsoid(random, 16 + 12 * static_cast<int>(i), size, {0, 0, 0}),
                   {.is_static = true, .pose = pose});
  }
  return scene;
}

std::vector<BodyPair> arm_pairs(const Scene& scene) {
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 1; i < kArmLinks; ++i) {
    const std::uint32_t hull = scene.find_body(hull_name(i));
    for (std::uint32_t t = 0; t < kThings; ++t) pairs.push_back({hull, scene.find_body(thing_name(t))});
    for (std::uint32_t j = 0; j + 1 < i; ++j) pairs.push_back({scene.find_body(hull_name(j)), hull});
  }
  return pairs;
}

std::vector<double> arm_positions(const Scene& scene, std::uint32_t configurations, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> positions;
  for (std::uint32_t k = 0; k < configurations; ++k)
    for (const SceneJoint& joint : scene.joints()) positions.push_back(random.uniform(joint.lower, joint.upper));
  return positions;
}

}  // namespace clearance::test
