// Scene::load: reads a scene file (docs/models/scenes.md) into bodies, groups and ignored pairs.
#include <algorithm>
#include <filesystem>
#include <optional>
#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/hull/shapes.h"
#include "engine/scene/body_checks.h"
#include "engine/scene/scene.h"
#include "engine/scene_io/geometry_yaml.h"
#include "engine/scene_io/robot_yaml.h"
#include "engine/scene_io/yaml_document.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

// More is a mistake in the file: the pairs alone could not be listed.
constexpr std::int64_t kMaxBodies = 1'000'000;

struct BodyPlan {
  YamlValue place;
  Body body;
  std::size_t geometry;  // index in GeometryReader
  std::optional<YamlValue> parent;
};

fs::path folder_of(const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  return folder.empty() ? "." : folder;
}

class SceneReader {
 public:
  SceneReader(const std::string& path, bool allow_outside)
      : root_(YamlValue::load(path)),
        folder_(folder_of(path)),
        allow_outside_(allow_outside),
        geometries_(folder_, allow_outside) {}

  engine::Scene read() {
    root_.map("a map with the key \"bodies\"");
    root_.check_keys({"bodies", "groups", "ignore", "random", "robots"});
    if (const auto bodies = root_.find("bodies"))
      for (const YamlValue& body : bodies->list("a list of bodies")) read_body(body);
    if (const auto random = root_.find("random")) {
      if (random->is_list())
        for (const YamlValue& one : random->list("a list")) read_random(one);
      else
        read_random(*random);
    }
    if (const auto robots = root_.find("robots"))
      for (const YamlValue& robot : robots->list("a list of robots"))
        robots_.push_back(read_robot(robot, [this](const YamlValue& path) {
          return geometries_.resolve(path, path.text("the path of a file"));
        }));
    if (bodies_.empty() && robots_.empty())
      root_.fail("expected at least one body, under \"bodies\", \"random\" or \"robots\"");
    geometries_.build();
    return assemble();
  }

 private:
  void read_body(const YamlValue& value) {
    value.map("a body, such as {name: table, box: [1, 1, 0.1]}");
    if (const auto robot = value.find("robot")) return read_place(value, *robot);
    value.check_keys({"name",      "mesh",       "box",           "sphere",    "capsule",  "cylinder",    "cone",
                      "ellipsoid", "half_space", "points",        "uv_sphere", "geometry", "scale",       "mesh_as",
                      "radius",    "static",     "requires_pose", "pose",      "parent",   "uncertainty", "padding",
                      "max_speed", "voxel",      "height_field",  "cell",      "octomap",  "unknown",     "up"});
    const auto name = value.find("name");
    if (!name) value.fail("expected the key \"name\"");
    BodyPlan plan{*name, {}, geometries_.read(value), {}};
    plan.body.name = name->text("a name");
    plan.body.is_grown = value.find("geometry") != nullptr;
    if (const auto is_static = value.find("static")) plan.body.is_static = is_static->boolean();
    if (const auto requires_pose = value.find("requires_pose")) plan.body.requires_pose = requires_pose->boolean();
    if (const auto pose = value.find("pose")) plan.body.pose = pose->pose();
    if (const auto uncertainty = value.find("uncertainty")) plan.body.uncertainty = read_uncertainty(*uncertainty);
    if (const auto padding = value.find("padding")) plan.body.padding = padding->not_negative();
    if (const auto speed = value.find("max_speed")) plan.body.max_speed = speed->not_negative();
    if (const auto parent = value.find("parent")) {
      parent->text("the name of a body");
      plan.parent = *parent;
    }
    add(std::move(plan));
  }

  // Position of a robot's links among the bodies.
  void read_place(const YamlValue& value, const YamlValue& robot) {
    value.check_keys({"robot"});
    robot.text("the name of a robot");
    places_.emplace_back(bodies_.size(), robot);
  }

  void read_random(const YamlValue& value) {
    value.map("a map with count, shape, box and seed");
    value.check_keys({"count", "shape", "box", "seed", "name", "static"});
    const auto count = value.find("count"), shape = value.find("shape"), box = value.find("box");
    if (!count) value.fail("expected the key \"count\"");
    if (!shape) value.fail("expected the key \"shape\"");
    if (!box) value.fail("expected the key \"box\"");
    const std::int64_t n = count->integer(1, kMaxBodies);
    shape->map("a shape, such as {sphere: 0.1}");
    shape->check_keys({"mesh", "box", "sphere", "capsule", "cylinder", "cone", "ellipsoid", "points", "uv_sphere",
                       "scale", "mesh_as", "radius", "up"});
    const std::size_t geometry = geometries_.read(*shape);
    const Vec3d size = read_box(*box);
    std::uint64_t seed = 0;
    if (const auto s = value.find("seed")) seed = s->unsigned_integer();
    std::string prefix = "random";
    if (const auto name = value.find("name")) prefix = name->text("a name");
    bool is_static = false;
    if (const auto s = value.find("static")) is_static = s->boolean();
    PortableRandom random(seed);
    for (std::int64_t i = 0; i < n; ++i) {
      BodyPlan plan{value, {}, geometry, {}};
      plan.body.name = prefix + "_" + std::to_string(i);
      plan.body.is_static = is_static;
      plan.body.pose = random.pose(size);
      add(std::move(plan));
    }
  }

  void add(BodyPlan plan) {
    if (static_cast<std::int64_t>(bodies_.size()) >= kMaxBodies)
      plan.place.fail("more than " + std::to_string(kMaxBodies) + " bodies in one scene");
    bodies_.push_back(std::move(plan));
  }

  // Calls a function of Scene, and reports its error at the place in the file that caused it.
  template <class F>
  static void placed(const YamlValue& place, F&& f) {
    try {
      f();
    } catch (const engine::SceneError& e) {
      place.fail(e.what());
    }
  }

  // A list of bodies, or a map with the key "bodies".
  static void read_group(engine::Scene& scene, const std::string& name, const YamlValue& group) {
    std::unique_ptr<YamlValue> members;
    bool requires_pose = false;
    if (group.is_map()) {
      group.check_keys({"bodies", "requires_pose"});
      members = group.find("bodies");
      if (!members) group.fail("expected the key \"bodies\"");
      if (const auto value = group.find("requires_pose")) requires_pose = value->boolean();
    }
    std::vector<std::string> names;
    for (const YamlValue& member : (members ? *members : group).list("a list of bodies")) {
      names.push_back(member.text("the name of a body"));
      if (scene.find_body(names.back()) == kNone) member.fail(no_body(scene, names.back()));
    }
    placed(group, [&] {
      scene.add_group(name, names);
      if (requires_pose)
        for (const std::string& body : names) scene.set_requires_pose(body);
    });
  }

  // Robots come after the bodies, except those placed among them by name.
  engine::Scene assemble() {
    engine::Scene scene;
    std::vector<bool> added(robots_.size());
    auto place = places_.begin();
    for (std::size_t i = 0; i <= bodies_.size(); ++i) {
      for (; place != places_.end() && place->first == i; ++place) add_named_robot(scene, place->second, added);
      if (i < bodies_.size()) add_body(scene, bodies_[i]);
    }
    for (std::size_t r = 0; r < robots_.size(); ++r)
      if (!added[r]) add_robot(scene, robots_[r]);
    for (const BodyPlan& plan : bodies_)
      if (plan.parent) placed(*plan.parent, [&] { scene.set_parent(plan.body.name, plan.parent->text("")); });
    for (const RobotPlan& plan : robots_)
      if (plan.parent) placed(*plan.parent, [&] { scene.set_parent(plan.name, plan.parent->text("")); });
    add_pairs_and_groups(scene);
    for (const std::string& warning : root_.warnings()) scene.add_warning(warning);
    return scene;
  }

  void add_body(engine::Scene& scene, BodyPlan& plan) const {
    static_cast<Geometry&>(plan.body) = geometries_.at(plan.geometry);
    placed(plan.place, [&] { scene.add_body(plan.body); });
  }

  void add_robot(engine::Scene& scene, RobotPlan& plan) const {
    plan.options.allow_outside = allow_outside_;
    plan.options.folder = folder_.string();
    placed(plan.place, [&] {
      scene.add_robot(plan.name, plan.options);
      if (plan.requires_pose) scene.set_requires_pose(plan.name);
    });
  }

  void add_named_robot(engine::Scene& scene, const YamlValue& name, std::vector<bool>& added) {
    const std::string wanted = name.text("");
    const auto found =
        std::find_if(robots_.begin(), robots_.end(), [&](const RobotPlan& plan) { return plan.name == wanted; });
    if (found == robots_.end()) name.fail("there is no robot \"" + wanted + "\" under \"robots\"");
    const auto r = static_cast<std::size_t>(found - robots_.begin());
    if (added[r]) name.fail("the robot \"" + wanted + "\" is listed already");
    added[r] = true;
    add_robot(scene, *found);
  }

  void add_pairs_and_groups(engine::Scene& scene) const {
    if (const auto groups = root_.find("groups"))
      for (const auto& [name, group] : groups->map("a map of names to lists of bodies")) read_group(scene, name, group);
    if (const auto ignore = root_.find("ignore"))
      for (const YamlValue& pair : ignore->list("a list of pairs [body or group, body or group]")) {
        if (!pair.is_list() || pair.size() != 2) pair.fail_expected("a pair [body or group, body or group]");
        const std::vector<YamlValue> two = pair.list("");
        const std::string a = two[0].text("the name of a body or group"),
                          b = two[1].text("the name of a body or group");
        placed(pair, [&] { scene.ignore(a, b); });
      }
  }

  YamlValue root_;
  fs::path folder_;
  bool allow_outside_;
  GeometryReader geometries_;
  std::vector<BodyPlan> bodies_;
  std::vector<RobotPlan> robots_;
  std::vector<std::pair<std::size_t, YamlValue>> places_;  // of robots: index of the next body, and name
};

}  // namespace

engine::Scene engine::Scene::load(const std::string& path, bool allow_outside) {
  const FpEnvironment environment;
  return is_robot_file(path) ? scene_of_robot(path, allow_outside) : SceneReader(path, allow_outside).read();
}

}  // namespace clearance
