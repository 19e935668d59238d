// Scene::save: writes a scene file (docs/models/scenes.md) and its geometry.
#include <yaml-cpp/emitter.h>

#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <system_error>
#include <tuple>

#include "engine/base/fp_environment.h"
#include "engine/geometry/geometry_file.h"
#include "engine/scene/scene.h"
#include "engine/scene_io/yaml_document.h"

namespace clearance {

namespace {

namespace fs = std::filesystem;

std::string quoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

// The shortest decimal that restores every bit.
std::string exact(double x) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), x).ptr};
}

std::string exact(const Pose& X) {
  const auto& [x, y, z] = X.translation;
  std::string text;
  for (const double number : {x, y, z, X.qw, X.qx, X.qy, X.qz}) text += (text.empty() ? "[" : ", ") + exact(number);
  return text + "]";
}

std::string exact(const Uncertainty& uncertainty) {
  return "{position: " + exact(uncertainty.position) + ", angle: " + exact(uncertainty.angle) + "}";
}

bool is_uncertain(const Body& body) {
  return body.uncertainty.position > 0 || body.uncertainty.angle > 0;
}

class SceneWriter {
 public:
  SceneWriter(const engine::Scene& scene, fs::path folder) : scene_(scene), folder_(std::move(folder)) {
    robot_of_.resize(scene.bodies().size(), kNone);
    for (std::uint32_t r = 0; r < scene.robots().size(); ++r) {
      const SceneRobot& robot = *scene.robots()[r];
      robot_of_[robot.base] = r;
      for (const std::uint32_t body : robot.bodies) robot_of_[body] = r;
    }
    for (const Body& body : scene.bodies()) names_.push_back(quoted(body.name));
  }

  void write() {
    check();
    std::error_code error;
    fs::create_directories(folder_ / "geometry", error);
    if (!error && !scene_.robots().empty()) fs::create_directories(folder_ / "robots", error);
    if (error) fail(error.message());
    add_bodies();
    add_robots();
    add_groups();
    add_ignored();
    const std::string file = (folder_ / "scene.yaml").string();
    write_file("scene.yaml", text_);
    YamlValue::load(file);  // fails if it exceeds the limits of a scene file
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw engine::SceneError("save: " + folder_.string() + ": " + why);
  }

  void check() const {
    std::error_code error;
    if (fs::exists(folder_, error) && (!fs::is_directory(folder_, error) || !fs::is_empty(folder_, error)))
      fail("expected a folder that is empty or not there yet");
    if (scene_.bodies().empty()) fail("there are no bodies to be saved");
    for (const auto& robot : scene_.robots())
      for (std::uint32_t link = 0; link < robot->bodies.size(); ++link) {
        const Body& body = scene_.bodies()[robot->bodies[link]];
        if (!robot->places(link) && (body.parent != kNone || body.requires_pose))
          fail("the link " + quoted(body.name) +
               " has a parent or requires a pose, which a scene file cannot express for a link");
      }
  }

  void add_bodies() {
    text_ += "bodies:\n";
    for (std::uint32_t id = 0; id < scene_.bodies().size(); ++id) {
      const std::uint32_t robot = robot_of_[id];
      if (robot == kNone)
        add_body(id);
      else if (scene_.robots()[robot]->base == id)  // its links come next
        text_ += "  - {robot: " + names_[id] + "}\n";
    }
  }

  void add_body(std::uint32_t id) {
    const Body& body = scene_.bodies()[id];
    text_ += "  - {name: " + names_[id];
    if (is_cloud(body) && point_count(body) == 0) {
      text_ += ", points: [], radius: " + exact(body.cloud_radius);
      if (body.voxel > 0) text_ += ", voxel: " + exact(body.voxel);
    } else {
      text_ += ", geometry: " + geometry_of(body);
    }
    if (body.pose) text_ += ", pose: " + exact(*body.pose);
    if (body.parent != kNone) text_ += ", parent: " + names_[body.parent];
    if (body.is_static) text_ += ", static: true";
    if (body.requires_pose) text_ += ", requires_pose: true";
    if (is_uncertain(body)) text_ += ", uncertainty: " + exact(body.uncertainty);
    if (body.padding > 0) text_ += ", padding: " + exact(body.padding);
    if (body.max_speed > 0) text_ += ", max_speed: " + exact(body.max_speed);
    text_ += "}\n";
  }

  void add_robots() {
    if (!scene_.robots().empty()) text_ += "robots:\n";
    for (std::uint32_t r = 0; r < scene_.robots().size(); ++r) {
      const SceneRobot& robot = *scene_.robots()[r];
      const Body& base = scene_.bodies()[robot.base];
      const std::string file = "robots/" + std::to_string(r);
      write_file(file + ".urdf", robot.urdf);
      text_ += "  - {name: " + names_[robot.base] + ", urdf: " + file + ".urdf";
      if (!robot.srdf.empty()) {
        write_file(file + ".srdf", robot.srdf);
        text_ += ", srdf: " + file + ".srdf";
      }
      if (base.pose) text_ += ", base: " + exact(*base.pose);
      if (base.parent != kNone) text_ += ", parent: " + names_[base.parent];
      if (base.is_static) text_ += ", static: true";
      if (base.requires_pose) text_ += ", requires_pose: true";
      add_home(robot);
      add_links(robot);
      text_ += "}\n";
    }
  }

  // Either all of a robot's joints have a position at load, or none has.
  void add_home(const SceneRobot& robot) {
    std::string home;
    for (std::uint32_t c = 0; c < robot.model.columns.size(); ++c)
      if (const auto& position = scene_.joints()[robot.first_joint + c].home)
        home += (home.empty() ? "" : ", ") + quoted(robot.model.columns[c].name) + ": " + exact(*position);
    if (!home.empty()) text_ += ", home: {" + home + "}";
  }

  void add_links(const SceneRobot& robot) {
    std::string files, padding, uncertainty;
    const auto add = [](std::string& map, const std::string& link, const std::string& value, const char* between) {
      map += (map.empty() ? "" : between) + link + ": " + value;
    };
    for (std::uint32_t link = 0; link < robot.bodies.size(); ++link) {
      const Body& body = scene_.bodies()[robot.bodies[link]];
      const std::string name = quoted(robot.model.links[link].name);
      if (!body.parts.empty()) add(files, name, geometry_of(body), ",\n       ");
      if (body.padding > 0) add(padding, name, exact(body.padding), ", ");
      if (is_uncertain(body)) add(uncertainty, name, exact(body.uncertainty), ", ");
    }
    if (!padding.empty()) text_ += ",\n     padding: {" + padding + "}";
    if (!uncertainty.empty()) text_ += ",\n     uncertainty: {" + uncertainty + "}";
    text_ += ",\n     geometry: {" + files + "}";
  }

  // Groups of robots come from their files.
  void add_groups() {
    std::set<std::string> of_robots;
    for (const auto& robot : scene_.robots()) {
      of_robots.insert(robot->name);
      for (const RobotGroup& group : robot->model.groups) of_robots.insert(robot->name + "/" + group.name);
    }
    const char* title = "groups:\n";
    for (const Group& group : scene_.groups()) {
      if (of_robots.contains(group.name)) continue;
      text_ += title + ("  " + quoted(group.name) + ": [");
      for (const std::uint32_t id : group.bodies) text_ += (id == group.bodies[0] ? "" : ", ") + names_[id];
      text_ += "]\n";
      title = "";
    }
  }

  void add_ignored() {
    const char* title = "ignore:\n";
    for (const auto& [a, b] : scene_.ignored()) {
      if (scene_.bodies()[a].parts.empty() || scene_.bodies()[b].parts.empty()) continue;  // frames are in no pair
      text_ += title + ("  - [" + names_[a] + ", " + names_[b] + "]\n");
      title = "";
    }
  }

  // Path of a body's geometry file in the scene's folder.
  std::string geometry_of(const Body& body) {
    std::string& file = files_[{body.parts, body.display, body.source, body.model_error, body.model_inner}];
    if (file.empty()) file = "geometry/" + write_geometry_file((folder_ / "geometry").string(), body);
    return file;
  }

  void write_file(const std::string& name, const std::string& text) const {
    std::ofstream file(folder_ / name, std::ios::binary);
    file << text;
    file.close();
    if (!file) fail(name + " cannot be written");
  }

  using Key = std::tuple<std::vector<ConvexPartPtr>, std::shared_ptr<const DisplayMesh>, std::string, double, double>;
  const engine::Scene& scene_;
  const fs::path folder_;
  std::vector<std::uint32_t> robot_of_;  // by body, or kNone
  std::vector<std::string> names_;       // by body, quoted
  std::map<Key, std::string> files_;     // of the geometries written
  std::string text_;
};

}  // namespace

void engine::Scene::save(const std::string& folder) const {
  const FpEnvironment environment;
  SceneWriter(*this, folder).write();
}

}  // namespace clearance
