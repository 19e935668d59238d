#include "tests/oracle/states/robot_scene.h"

#include <filesystem>

#include "engine/geometry/make_geometry.h"
#include "engine/hull/shapes.h"
#include "tests/oracle/states/arm.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {
namespace {

using Options = engine::Scene::BodyOptions;

/// Adds bodies, and keeps the data of each for the oracle.
class SceneMaker {
 public:
  explicit SceneMaker(RobotScene& made) : made_(made) {}

  void keep(std::uint32_t body, std::vector<PartBounds> parts) {
    if (made_.exact_parts.size() <= body) made_.exact_parts.resize(body + 1);
    made_.exact_parts[body] = std::move(parts);
  }
  void box(const std::string& name, const Vec3d& size, Options options = {}) {
    add(made_.scene.add_box(name, size, placed(options)),
        {grown(box_bounds(size), options.padding, options.uncertainty)});
  }
  void sphere(const std::string& name, double radius, Options options = {}) {
    add(made_.scene.add_sphere(name, radius, placed(options)),
        {grown(hull_bounds({{0, 0, 0}}, radius), options.padding, options.uncertainty)});
  }
  void capsule(const std::string& name, double radius, double length) {
    add(made_.scene.add_capsule(name, radius, length, placed({})), {capsule_bounds(radius, length)});
  }
  void cylinder(const std::string& name, double radius, double length, Options options = {}) {
    add(made_.scene.add_cylinder(name, radius, length, placed(options)),
        {grown(cylinder_bounds(radius, length), options.padding, options.uncertainty)});
  }
  void hull(const std::string& name, const std::vector<Vec3d>& points) {
    add(made_.scene.add_hull(name, points, placed({})), {hull_bounds(points)});
  }
  /// Two parts far from each other.
  void pair_of_hulls(const std::string& name, const std::vector<Vec3d>& points) {
    std::vector<Vec3d> others = points;
    for (Vec3d& v : others) v.x += 0.375;
    Body body;
    body.name = name;
    body.pose = placed({}).pose;
    body.parts = {make_convex_part(points), make_convex_part(others, 0.0078125)};
    add(made_.scene.add_body(std::move(body)), {hull_bounds(points), hull_bounds(others, 0.0078125)});
  }
  /// Kinds that the oracle does not solve.
  void without_oracle() {
    engine::Scene& scene = made_.scene;
    add(scene.add_cone("cone", 0.1, 0.2, placed({})), {});
    add(scene.add_ellipsoid("egg", {0.05, 0.1, 0.15}, placed({})), {});
  }
  /// Two triangles.
  void sheet(const std::string& name) {
    const std::vector<Vec3d> v = {{0, 0, 0}, {0.25, 0, 0}, {0, 0.25, 0}, {0.25, 0.25, 0.125}};
    const Triangle triangles[] = {{0, 1, 2}, {1, 3, 2}};
    add(made_.scene.add_mesh(name, v, triangles, MeshAs::kSurface, placed({})),
        {hull_bounds({v[0], v[1], v[2]}), hull_bounds({v[1], v[3], v[2]})});
  }
  /// A mesh of two boxes that overlap.
  void step(const std::string& name) {
    const Vec3d size{0.25, 0.25, 0.125}, upper{0.125, 0.25, 0.25}, at{0.0625, 0, 0.125};
    Shape both = make_box(size);
    const Shape on_top = make_box(upper);
    const auto first = static_cast<std::uint32_t>(both.vertices.size());
    for (const Vec3d& v : on_top.vertices) both.vertices.push_back(v + at);
    for (const Triangle& t : on_top.triangles) both.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    add(made_.scene.add_mesh(name, both.vertices, both.triangles, MeshAs::kSolid, placed({})),
        {box_bounds(size), moved(box_bounds(upper), at)});
  }
  /// Points in a cube of this edge.
  void cloud(const std::string& name, int count, double edge, Random& random, Options options = {}) {
    const auto coordinate = [&] { return static_cast<float>(random.uniform(-0.5, 0.5) * edge); };
    std::vector<CloudPoint> points;
    std::vector<PartBounds> parts;
    options.radius = 0.01;
    for (int i = 0; i < count; ++i) {
      const CloudPoint& p = points.emplace_back(CloudPoint{coordinate(), coordinate(), coordinate()});
      parts.push_back(hull_bounds({{p[0], p[1], p[2]}}, options.radius));
    }
    add(made_.scene.add_points(name, points, 0, placed(options)), std::move(parts));
  }

 private:
  static Options placed(Options options) {
    if (!options.pose) options.pose = Pose{{100, 0, 0}};
    return options;
  }
  void add(std::uint32_t body, std::vector<PartBounds> parts) {
    keep(body, std::move(parts));
    const Body& b = made_.scene.bodies()[body];
    if (!b.is_static && b.parent == kNone) made_.obstacles.push_back(body);
  }

  RobotScene& made_;
};

void add_obstacles(RobotScene& made, Random& random) {
  SceneMaker maker(made);
  made.scene.add_half_space("floor", {.is_static = true, .pose = Pose{{0, 0, -0.3}}});
  maker.keep(made.scene.find_body("floor"), {});
  maker.box("post", {0.0625, 0.0625, 2}, {.is_static = true, .pose = random.rotation({0.6, 0.4, 0.3})});
  maker.cylinder("column", 0.05, 1.5,
                 {.is_static = true, .pose = random.rotation({-0.5, 0.5, 0.4}), .padding = 0.015625});
  for (const double size : {1.0, 0.0078125}) {  // also so tiny that a link holds them
    const std::string is = size < 1 ? "tiny_" : "";
    maker.box(is + "box", Vec3d{0.25, 0.375, 0.125} * size);
    maker.sphere(is + "ball", 0.09375 * size);
    maker.capsule(is + "capsule", 0.0625 * size, 0.25 * size);
    maker.cylinder(is + "cylinder", 0.0625 * size, 0.375 * size);
    std::vector<Vec3d> points = random_points(random, 16, {0.25, 0.125, 0.1875});
    for (Vec3d& v : points) v = v * size;
    maker.hull(is + "hull", points);
  }
  maker.box("room", {3, 3, 3});  // holds whole links
  maker.box("padded", {0.125, 0.125, 0.25}, {.padding = 0.015625});
  maker.sphere("somewhere", 0.0625, {.uncertainty = {0.005, 0}});
  maker.box("turned", {0.25, 0.125, 0.125}, {.uncertainty = {0.002, 0.02}});
  maker.pair_of_hulls("two", random_points(random, 12, {0.125, 0.0625, 0.125}));
  maker.without_oracle();
  maker.sheet("sheet");
  maker.cloud("cloud", 50, 0.2, random);
  maker.step("step");
}

void finish(RobotScene& made, Random& random) {
  for (std::uint32_t body = 0; body < made.scene.bodies().size(); ++body) {
    const Body& b = made.scene.bodies()[body];
    if (b.robot != kNone && !b.parts.empty() && made.scene.robots()[b.robot]->kinematics.step_of(b.link))
      made.links.push_back(body);
  }
  made.robot = made.scene;
  add_obstacles(made, random);
  made.exact_parts.resize(made.scene.bodies().size());
}

}  // namespace

RobotScene made_robot(std::uint64_t seed) {
  Random random(seed);
  const Arm arm = make_arm(random);
  const TemporaryFolder folder;
  folder.write("hull.obj", arm.obj);

  RobotScene made{.name = "made_" + std::to_string(seed)};
  engine::RobotOptions options;
  options.urdf = folder.write("arm.urdf", arm.urdf);
  options.base = random.rotation({0.1, -0.2, 0.3});
  options.home.emplace();
  options.is_static = true;
  options.mesh_as = MeshAs::kHull;
  const std::map<std::string, double> padding = {{"l4", 0.0078125}};
  const std::map<std::string, Uncertainty> uncertainty = {{"l6", {0.001, 0.002}}};
  options.link_padding = padding;
  options.link_uncertainty = uncertainty;
  made.scene.add_robot("r", options);
  SceneMaker maker(made);
  for (std::size_t l = 0; l < arm.links.size(); ++l) {
    const std::string name = "l" + std::to_string(l);
    std::vector<PartBounds> parts = arm.links[l];
    for (PartBounds& part : parts)
      part = grown(part, padding.contains(name) ? padding.at(name) : 0,
                   uncertainty.contains(name) ? uncertainty.at(name) : Uncertainty{});
    maker.keep(made.scene.find_body("r/" + name), std::move(parts));
  }
  maker.box("tool", {0.0625, 0.125, 0.0625}, {.parent = "r/l6", .pose = random.rotation({0, 0.125, 0.125})});
  // On the tool, or on its link: covers decide no motions of a chain.
  maker.sphere("bead", 0.03125, {.parent = seed % 2 == 1 ? "tool" : "r/l6", .pose = Pose{{0, 0.125, 0}}});
  maker.cloud("carried", 30, 0.125, random, {.parent = "r/l5", .pose = random.rotation({0, 0.125, 0.0625})});
  for (const char* other : {"r/l6", "bead", "carried"}) made.scene.ignore("tool", other);
  for (const char* other : {"bead", "carried"}) made.scene.ignore(other, "r/l6");
  for (const char* other : {"bead", "r/l5"}) made.scene.ignore("carried", other);
  finish(made, random);
  return made;
}

RobotScene robot_of(const std::string& urdf, MeshAs mesh_as) {
  const std::filesystem::path path(urdf);
  const std::string name = path.stem(), folder = path.parent_path();
  const std::filesystem::path srdf = std::filesystem::path(path).replace_extension(".srdf");
  RobotScene made{.name = name};
  engine::RobotOptions options;
  options.urdf = urdf;
  if (std::filesystem::exists(srdf)) options.srdf = srdf;
  options.packages = {{name, folder}, {"meshes", folder + "/meshes"}};
  options.home.emplace();
  options.is_static = true;
  options.mesh_as = mesh_as;
  made.scene.add_robot(name, options);
  Random random(made.scene.revision());
  finish(made, random);
  return made;
}

}  // namespace clearance::exact
