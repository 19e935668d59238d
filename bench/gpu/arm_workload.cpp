#include "bench/gpu/arm_workload.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "tests/engine/cuda/box_mesh.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {

namespace {

constexpr std::uint32_t kArmLinks = 8, kThings = 21;

struct ArmJoint {
  const char* origin;  // in the previous link's frame
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

namespace {

// Adds the bodies on a link's frame.
using AddLink =
    std::function<void(engine::Scene&, const std::string& name, std::uint32_t link, const engine::Scene::BodyOptions&)>;

// The arm.
engine::Scene arm_alone(const AddLink& add_link) {
  engine::Scene scene;
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("clearance_arm_" + std::to_string(getpid()) + ".urdf");
  std::ofstream(file) << urdf();
  engine::RobotOptions options;
  options.urdf = file;
  options.home = {{"j4", -1.5}};
  options.is_static = true;
  scene.add_robot("arm", options);
  std::filesystem::remove(file);
  for (std::uint32_t i = 0; i < kArmLinks; ++i)
    add_link(scene, hull_name(i), i, {.parent = "arm/l" + std::to_string(i), .pose = Pose()});
  return scene;
}
// With random hulls as links.
engine::Scene arm_alone(Random& random) {
  return arm_alone(
      [&](engine::Scene& scene, const std::string& name, std::uint32_t i, const engine::Scene::BodyOptions& options) {
        scene.add_hull(name, ellipsoid(random, 48 + 6 * static_cast<int>(i), kArmShapes[i].size, kArmShapes[i].centre),
                       options);
      });
}

// An ellipsoid with grooves from pole to pole: a solid of 2 * kAround * (kRows - 1) triangles.
void add_grooved(engine::Scene& scene, const std::string& name, const LinkShape& shape,
                 const engine::Scene::BodyOptions& options) {
  constexpr std::uint32_t kAround = 24, kRows = 13;
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
  const auto add = [&](double x, double y, double z) {
    vertices.push_back(shape.centre + Vec3d{x * shape.size.x, y * shape.size.y, z * shape.size.z});
  };
  add(0, 0, -1);
  for (std::uint32_t row = 1; row < kRows; ++row)
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const double height = M_PI * row / kRows, turn = 2 * M_PI * i / kAround, out = i % 4 == 0 ? 0.75 : 1;
      add(out * std::sin(height) * std::cos(turn), out * std::sin(height) * std::sin(turn), -std::cos(height));
    }
  add(0, 0, 1);
  const auto last = static_cast<std::uint32_t>(vertices.size()) - 1;
  for (std::uint32_t i = 0; i < kAround; ++i) {
    const std::uint32_t j = (i + 1) % kAround;
    triangles.push_back({0, 1 + j, 1 + i});
    for (std::uint32_t row = 0; row + 2 < kRows; ++row) {
      const std::uint32_t here = 1 + row * kAround, above = here + kAround;
      triangles.push_back({here + i, here + j, above + j});
      triangles.push_back({here + i, above + j, above + i});
    }
    triangles.push_back({last, last - kAround + i, last - kAround + j});
  }
  scene.add_mesh(name, vertices, triangles, MeshAs::kSolid, options);
}

void add_things(engine::Scene& scene, Random& random) {
  scene.add_box(thing_name(0), {2, 2, 0.1}, {.is_static = true, .pose = Pose{{0, 0, -0.06}}});
  for (std::uint32_t i = 1; i < kThings; ++i) {
    const double turn = random.uniform(-M_PI, M_PI), far = random.uniform(0.45, 0.95), high = random.uniform(0, 1.1);
    Pose pose = random.pose(1);
    pose.translation = {far * std::cos(turn), far * std::sin(turn), high};
    const Vec3d size{random.uniform(0.03, 0.12), random.uniform(0.03, 0.12), random.uniform(0.03, 0.12)};
    scene.add_hull(thing_name(i), ellipsoid(random, 16 + 12 * static_cast<int>(i), size, {0, 0, 0}),
                   {.is_static = true, .pose = pose});
  }
}

}  // namespace

engine::Scene arm_scene_of_hulls() {
  Random random(19);
  engine::Scene scene = arm_alone(random);
  add_things(scene, random);
  return scene;
}

namespace {

engine::Scene arm_of_meshes() {
  return arm_alone([](engine::Scene& to, const std::string& name, std::uint32_t i,
                      const engine::Scene::BodyOptions& options) { add_grooved(to, name, kArmShapes[i], options); });
}

}  // namespace

engine::Scene arm_scene_of_meshes() {
  engine::Scene scene = arm_of_meshes();
  Random random(19);
  add_things(scene, random);
  return scene;
}

std::vector<CloudPoint> room_points(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  constexpr Vec3d kLow{-1.4, -1.5, -0.05}, kHigh{1.6, 1.5, 2.0};
  const auto inside = [&](double edge) {
    return Vec3d{random.uniform(kLow.x + edge, kHigh.x - edge), random.uniform(kLow.y + edge, kHigh.y - edge),
                 random.uniform(kLow.z + edge, kHigh.z - edge)};
  };
  std::vector<std::pair<Vec3d, Vec3d>> boxes;  // centres and half sizes
  while (boxes.size() < 40) {
    const Vec3d centre = inside(0.2),
                half{random.uniform(0.03, 0.12), random.uniform(0.03, 0.12), random.uniform(0.03, 0.12)};
    if (std::hypot(centre.x, centre.y) > 0.5) boxes.emplace_back(centre, half);
  }
  std::vector<CloudPoint> points;
  while (points.size() < count) {
    Vec3d p = inside(0);
    if (random.below(10) < 6) {
      const int axis = static_cast<int>(random.below(3));
      p[axis] = random.below(2) ? kLow[axis] : kHigh[axis];
    } else {
      const auto& [centre, half] = boxes[random.below(boxes.size())];
      Vec3d u{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
      u[static_cast<int>(random.below(3))] = random.below(2) ? 1 : -1;
      p = centre + Vec3d{u.x * half.x, u.y * half.y, u.z * half.z};
    }
    const auto seen = [&](double x) { return static_cast<float>(x + 0.002 * random.normal()); };
    if (std::hypot(p.x, p.y) > 0.25) points.push_back({seen(p.x), seen(p.y), seen(p.z)});
  }
  return points;
}

engine::Scene arm_scene_in_room() {
  Random random(19);
  engine::Scene scene = arm_alone(random);
  scene.add_points("room", room_points(kRoomPoints, 23), 0, {.is_static = true, .pose = Pose()});
  return scene;
}

namespace {

void add_cell(engine::Scene& scene) {
  constexpr std::uint32_t kCells = 5;
  BoxMesh cell;
  const auto board = [&](const Vec3d& low, const Vec3d& high) {
    cell.add_box(0.5 * (low + high), 0.5 * (high - low), kCells, false);
  };
  board({-1.1, -1.3, -0.06}, {1.1, 1.3, -0.01});  // floor
  board({-1.1, -1.3, -0.04}, {-1.05, 1.3, 1.6});  // walls
  for (const double y : {-1.3, 1.25}) board({-1.1, y, -0.04}, {1.1, y + 0.05, 1.6});
  board({0.8, -0.9, -0.04}, {0.83, 0.9, 1.5});                                                    // back of the shelf
  for (const double z : {0.4, 0.85, 1.3}) board({0.4, -0.9, z}, {0.82, 0.9, z + 0.02});           // its boards
  for (const double y : {-0.9, -0.3, 0.28, 0.88}) board({0.4, y, -0.03}, {0.82, y + 0.02, 1.5});  // and uprights
  scene.add_mesh("cell", cell.vertices, cell.triangles, MeshAs::kSolid, {.is_static = true, .pose = Pose()});
}

}  // namespace

engine::Scene arm_scene_in_cell() {
  Random random(19);
  engine::Scene scene = arm_alone(random);
  add_cell(scene);
  return scene;
}

engine::Scene arm_scene_of_meshes_in_cell() {
  engine::Scene scene = arm_of_meshes();
  add_cell(scene);
  return scene;
}

std::vector<BodyPair> arm_pairs(const engine::Scene& scene) {
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 1; i < kArmLinks; ++i) {
    const std::uint32_t hull = scene.find_body(hull_name(i));
    if (const std::uint32_t around = std::min(scene.find_body("room"), scene.find_body("cell")); around != kNone) {
      pairs.push_back({hull, around});
      continue;
    }
    for (std::uint32_t t = 0; t < kThings; ++t) pairs.push_back({hull, scene.find_body(thing_name(t))});
    for (std::uint32_t j = 0; j + 1 < i && !has_surface(scene.bodies()[hull]); ++j)
      pairs.push_back({scene.find_body(hull_name(j)), hull});
  }
  return pairs;
}

std::vector<double> arm_positions(const engine::Scene& scene, std::uint32_t configurations, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> positions;
  for (std::uint32_t k = 0; k < configurations; ++k)
    for (const SceneJoint& joint : scene.joints()) positions.push_back(random.uniform(joint.lower, joint.upper));
  return positions;
}

}  // namespace clearance::test
