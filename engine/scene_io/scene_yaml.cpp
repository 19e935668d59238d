// Scene::load: the scene file (docs/scenes.md) to bodies, groups and ignored pairs.
#include <algorithm>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/hull/shapes.h"
#include "engine/mesh/mesh.h"
#include "engine/scene/geometry.h"
#include "engine/scene/geometry_file.h"
#include "engine/scene/mesh_geometry.h"
#include "engine/scene/scene.h"
#include "engine/scene_io/points_yaml.h"
#include "engine/scene_io/robot_yaml.h"
#include "engine/scene_io/yaml_document.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

// A scene of more is a mistake in the file: its pairs alone could not be listed.
constexpr std::int64_t kMaxBodies = 1'000'000;
// Vertices that a few words of the file may ask for (uv_sphere): about 3 GB of pieces.
constexpr std::uint64_t kMaxMadeVertices = 20'000'000;

// A geometry to be built, once for all bodies that ask for the same.
struct GeometryPlan {
  YamlValue place;  // where it is first asked for
  std::function<Geometry()> build;
  std::shared_ptr<const Geometry> built;
  std::string error;
};

struct BodyPlan {
  YamlValue place;
  Body body;
  std::size_t geometry;  // index of a GeometryPlan
  std::optional<YamlValue> parent;
};

class SceneReader {
 public:
  SceneReader(const std::string& path, bool allow_outside)
      : root_(YamlValue::load(path)), folder_(fs::path(path).parent_path()), allow_outside_(allow_outside) {
    if (folder_.empty()) folder_ = ".";
  }

  Scene read() {
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
        robots_.push_back(read_robot(
            robot, [this](const YamlValue& path) { return resolve(path, path.text("the path of a file")); }));
    if (bodies_.empty() && robots_.empty())
      root_.fail("expected at least one body, under \"bodies\", \"random\" or \"robots\"");
    build_geometries();
    return assemble();
  }

 private:
  void read_body(const YamlValue& value) {
    value.map("a body, such as {name: table, box: [1, 1, 0.1]}");
    if (const auto robot = value.find("robot")) return read_place(value, *robot);
    value.check_keys({"name",      "mesh",       "box",          "sphere",    "capsule",  "cylinder",    "cone",
                      "ellipsoid", "half_space", "points",       "uv_sphere", "geometry", "scale",       "convexify",
                      "radius",    "static",     "live",         "pose",      "parent",   "uncertainty", "padding",
                      "max_speed", "voxel",      "height_field", "cell",      "octomap",  "unknown",     "up"});
    const auto name = value.find("name");
    if (!name) value.fail("expected the key \"name\"");
    BodyPlan plan{*name, {}, read_geometry(value), {}};
    plan.body.name = name->text("a name");
    plan.body.is_grown = value.find("geometry") != nullptr;
    read_no_points(value, plan.body);
    if (const auto is_static = value.find("static")) plan.body.is_static = is_static->boolean();
    if (const auto is_live = value.find("live")) plan.body.is_live = is_live->boolean();
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

  // Where the links of one of the robots stand among the bodies.
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
                       "scale", "convexify", "radius", "up"});
    const std::size_t geometry = read_geometry(*shape);
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

  static Vec3d read_box(const YamlValue& value) {
    if (!value.is_list()) {
      if (!value.is_text()) value.fail_expected("an edge length, or 3 of them [x, y, z]");
      const double edge = value.positive();
      return {edge, edge, edge};
    }
    const std::vector<YamlValue> edges = value.list("");
    if (edges.size() != 3) value.fail_expected("an edge length, or 3 of them [x, y, z]");
    return {edges[0].positive(), edges[1].positive(), edges[2].positive()};
  }

  // [r, length], as of capsules and cylinders.
  static std::pair<double, double> read_round(const YamlValue& value, bool zero_length) {
    if (!value.is_list() || value.size() != 2) value.fail_expected("2 numbers [radius, length]");
    const std::vector<YamlValue> x = value.list("");
    return {x[0].positive(), zero_length ? x[1].not_negative() : x[1].positive()};
  }

  // None: the key stands for something else.
  static std::optional<Primitive> read_primitive(const std::string& kind, const YamlValue& value) {
    if (kind == "cone" || kind == "cylinder") {
      const auto [r, length] = read_round(value, false);
      return kind == "cone" ? cone_of(r, length) : cylinder_of(r, length);
    }
    if (kind == "ellipsoid") {
      if (!value.is_list() || value.size() != 3) value.fail_expected("3 half axes [x, y, z]");
      const std::vector<YamlValue> x = value.list("");
      return Primitive{Primitive::Kind::kEllipsoid, {x[0].positive(), x[1].positive(), x[2].positive()}};
    }
    if (kind != "half_space") return {};
    if (!value.boolean()) value.fail_expected("true");
    return Primitive{Primitive::Kind::kHalfSpace, {0, 0, 0}};
  }

  // The one geometry that a body or a random shape names. Returns the index of its plan.
  std::size_t read_geometry(const YamlValue& value) {
    constexpr const char* kKinds[] = {"mesh",     "box",          "sphere",     "capsule", "cylinder",
                                      "cone",     "ellipsoid",    "half_space", "points",  "uv_sphere",
                                      "geometry", "height_field", "octomap"};
    std::unique_ptr<YamlValue> found;
    std::string kind;
    for (const char* k : kKinds)
      if (auto here = value.find(k)) {
        if (found) here->fail("a body has one geometry, and \"" + kind + "\" is there already");
        found = std::move(here);
        kind = k;
      }
    if (!found)
      value.fail(
          "expected one of the keys mesh, box, sphere, capsule, cylinder, cone, ellipsoid, half_space, points, "
          "uv_sphere, height_field, octomap");
    double radius = 0;
    if (const auto r = value.find("radius")) {
      if (kind == "geometry") r->fail("a geometry's pieces have their radius already");
      radius = r->not_negative();
    }
    if (kind != "mesh")
      for (const char* key : {"scale", "convexify", "up"})
        if (const auto extra = value.find(key)) extra->fail("only a mesh has this key");
    if (const auto extra = value.find("voxel"); extra && (kind != "points" || !is_cloud_value(*found)))
      extra->fail("only points of a file, or points: [], have this key");
    if (const auto extra = value.find("cell"); extra && kind != "height_field")
      extra->fail("only a height_field has this key");
    if (const auto extra = value.find("unknown"); extra && kind != "octomap")
      extra->fail("only an octomap has this key");

    const auto shape = [&](const std::string& numbers, auto&& make) {
      return plan(kind + " " + numbers + " +" + exact(radius), *found,
                  [make, radius, kind] { return geometry_of_shape(make(), radius, kind); });
    };
    if (kind == "mesh") return read_mesh(value, *found, radius);
    if (kind == "geometry") {
      const std::string path = resolve(*found, found->text("the path of a geometry file"));
      return plan("geometry " + path, *found, [path] { return read_geometry_file(path); });
    }
    if (kind == "box") {
      const Vec3d size = read_box(*found);
      return shape(exact(size.x) + exact(size.y) + exact(size.z), [size] { return make_box(size); });
    }
    if (kind == "sphere") {
      const double r = found->positive();
      return shape(exact(r), [r] { return make_sphere(r); });
    }
    if (kind == "capsule") {
      const auto [r, length] = read_round(*found, true);
      return shape(exact(r) + exact(length), [=, r = r, length = length] { return make_capsule(r, length); });
    }
    if (const auto p = read_primitive(kind, *found))
      return plan(kind + " " + exact(p->size.x) + exact(p->size.y) + exact(p->size.z) + " +" + exact(radius), *found,
                  [p = *p, radius, kind] { return geometry_of_primitive(p, radius, kind); });
    if (kind == "uv_sphere") {
      found->map("{radius: ..., resolution: ...}");
      found->check_keys({"radius", "resolution"});
      const auto r = found->find("radius"), resolution = found->find("resolution");
      if (!r) found->fail("expected the key \"radius\"");
      if (!resolution) found->fail("expected the key \"resolution\"");
      const double size = r->positive();
      const int n = static_cast<int>(resolution->integer(2, kMaxUvSphereResolution));
      const std::size_t before = geometries_.size();
      const std::size_t index = shape(exact(size) + std::to_string(n), [size, n] { return make_uv_sphere(size, n); });
      if (geometries_.size() > before) made_vertices_ += 2 * std::uint64_t(n) * (n - 1) + 2;
      if (made_vertices_ > kMaxMadeVertices)
        found->fail("the uv_spheres of this scene have more than " + std::to_string(kMaxMadeVertices) + " vertices");
      return index;
    }
    const auto path_of = [this](const YamlValue& file) { return resolve(file, file.text("the path of a file")); };
    if (kind == "octomap")
      return plan("octomap " + std::to_string(geometries_.size()), *found,
                  read_octomap(value, *found, radius, path_of));
    if (kind == "height_field")
      return plan("height_field " + std::to_string(geometries_.size()), *found,
                  read_height_field(value, *found, radius, path_of));
    if (is_cloud_value(*found))
      return plan("cloud " + std::to_string(geometries_.size()), *found, read_cloud(value, *found, radius, path_of));
    // Points are as large as the file: no two are looked at for being the same.
    return plan("points " + std::to_string(geometries_.size()), *found,
                [points = found->vectors(), radius] { return geometry_of_points(points, radius); });
  }

  std::size_t read_mesh(const YamlValue& value, const YamlValue& mesh, double radius) {
    const std::string named = mesh.text("the path of a mesh file");
    Vec3d scale{1, 1, 1};
    if (const auto s = value.find("scale")) {
      if (s->is_list()) {
        const std::vector<double> x = s->numbers(3, "a number, or 3 of them [sx, sy, sz]");
        scale = {x[0], x[1], x[2]};
      } else {
        const double x = s->number("a number, or 3 of them [sx, sy, sz]");
        scale = {x, x, x};
      }
      if (scale.x == 0 || scale.y == 0 || scale.z == 0) s->fail("expected factors other than 0");
    }
    const auto how = value.find("convexify");
    const Convexify convexify = how ? read_convexify(*how) : Convexify::kAuto;
    UpAxis up = UpAxis::kZ;
    if (const auto axis = value.find("up")) {
      const std::string letter = axis->text("y or z");
      if (letter != "y" && letter != "z") axis->fail_expected("y or z");
      if (letter == "y") up = UpAxis::kY;
    }
    const std::string path = resolve(mesh, named);
    std::shared_ptr<MeshFile>& file = files_[path];
    if (!file) file = std::make_shared<MeshFile>(path);
    const std::string key = "mesh " + path + " " + exact(scale.x) + exact(scale.y) + exact(scale.z) +
                            std::to_string(static_cast<int>(convexify)) + std::to_string(static_cast<int>(up)) + " +" +
                            exact(radius);
    return plan(key, mesh, [this, file = file, recipe = MeshRecipe{scale, convexify, radius, up}, named] {
      const auto in_file = [&](const std::exception& e) { return named + ": " + e.what(); };
      try {
        return meshes_.make(*file, recipe, named);
      } catch (const MeshError& e) {
        throw MeshError(in_file(e));
      } catch (const std::invalid_argument& e) {
        throw std::invalid_argument(in_file(e));
      }
    });
  }

  // The file that a scene names, which must lie inside the scene's folder unless that is allowed.
  std::string resolve(const YamlValue& value, const std::string& named) const {
    if (named.empty() || named.find('\0') != std::string::npos) value.fail_expected("the path of a mesh file");
    const fs::path path = folder_ / named;  // an absolute path replaces the folder
    const auto outside = [&](const std::string& how) {
      value.fail("\"" + named + "\" " + how + "; " + kOutsideIsRefused);
    };
    if (!allow_outside_) {
      if (fs::path(named).is_absolute()) outside("is an absolute path, not one inside the scene's folder");
      const fs::path normal = fs::path(named).lexically_normal();
      if (*normal.begin() == "..") outside("leaves the scene's folder");
    }
    std::error_code error;
    const fs::path real = fs::canonical(path, error);
    if (error) value.fail("\"" + named + "\": " + error.message());
    if (!allow_outside_) {
      const fs::path home = fs::canonical(folder_, error);
      const auto [end, rest] = std::mismatch(home.begin(), home.end(), real.begin(), real.end());
      if (error || end != home.end()) outside("leaves the scene's folder through a symbolic link");
    }
    return fs::absolute(path).lexically_normal().string();  // by the name it was given, which says its format
  }

  std::size_t plan(const std::string& key, const YamlValue& place, std::function<Geometry()> build) {
    const auto [at, fresh] = plan_of_.try_emplace(key, geometries_.size());
    if (fresh) geometries_.push_back({place, std::move(build), nullptr, ""});
    return at->second;
  }

  // A number as a part of a key: all of its bits, and nothing that runs into the next.
  static std::string exact(double x) {
    char text[40];
    std::snprintf(text, sizeof text, "%a,", x);
    return text;
  }

  void build_geometries() {
    const int n = static_cast<int>(geometries_.size());
    files_.clear();  // each is kept by the plans that need it
                     // With a single geometry this is no parallel region, and its own loops may use every core.
#pragma omp parallel for schedule(dynamic) if (n > 1)
    for (int i = 0; i < n; ++i) {
      GeometryPlan& plan = geometries_[i];
      const FpEnvironment environment;
      try {
        plan.built = std::make_shared<const Geometry>(plan.build());
      } catch (const std::exception& e) {
        plan.error = e.what();
      }
      plan.build = nullptr;  // lets go of the mesh
    }
    for (const GeometryPlan& plan : geometries_)
      if (!plan.built) plan.place.fail(plan.error.empty() ? "cannot be built" : plan.error);
  }

  // Runs what may find fault with the scene, at the place in the file that is to blame.
  template <class F>
  static void placed(const YamlValue& place, F&& f) {
    try {
      f();
    } catch (const SceneError& e) {
      place.fail(e.what());
    }
  }

  // A list of bodies, or a map that says more of them.
  static void read_group(Scene& scene, const std::string& name, const YamlValue& group) {
    std::unique_ptr<YamlValue> members;
    bool is_live = false;
    if (group.is_map()) {
      group.check_keys({"bodies", "live"});
      members = group.find("bodies");
      if (!members) group.fail("expected the key \"bodies\"");
      if (const auto live = group.find("live")) is_live = live->boolean();
    }
    std::vector<std::string> names;
    for (const YamlValue& member : (members ? *members : group).list("a list of bodies")) {
      names.push_back(member.text("the name of a body"));
      if (scene.find_body(names.back()) == kNone) member.fail("there is no body \"" + names.back() + "\"");
    }
    placed(group, [&] {
      scene.add_group(name, names);
      if (is_live)
        for (const std::string& body : names) scene.set_live(body);
    });
  }

  // Robots come after the bodies, but for those whose place is named among them.
  Scene assemble() {
    Scene scene;
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

  void add_body(Scene& scene, BodyPlan& plan) const {
    const Geometry& geometry = *geometries_[plan.geometry].built;
    plan.body.pieces = geometry.pieces;
    plan.body.display = geometry.display;
    plan.body.model_error = geometry.model_error;
    plan.body.model_inner = geometry.model_inner;
    plan.body.hull_excess = geometry.hull_excess;
    plan.body.empty_share = geometry.empty_share;
    plan.body.source = geometry.source;
    if (geometry.empty_voxel > 0) {
      plan.body.cloud = CloudState::kEmpty;
      plan.body.voxel = geometry.empty_voxel;
    }
    placed(plan.place, [&] { scene.add_body(plan.body); });
  }

  void add_robot(Scene& scene, RobotPlan& plan) const {
    plan.options.allow_outside = allow_outside_;
    plan.options.folder = folder_.string();
    placed(plan.place, [&] {
      scene.add_robot(plan.name, plan.options);
      if (plan.is_live) scene.set_live(plan.name);
    });
  }

  void add_named_robot(Scene& scene, const YamlValue& name, std::vector<bool>& added) {
    const std::string wanted = name.text("");
    const auto found =
        std::find_if(robots_.begin(), robots_.end(), [&](const RobotPlan& plan) { return plan.name == wanted; });
    if (found == robots_.end()) name.fail("there is no robot \"" + wanted + "\" under \"robots\"");
    const auto r = static_cast<std::size_t>(found - robots_.begin());
    if (added[r]) name.fail("the robot \"" + wanted + "\" stands there already");
    added[r] = true;
    add_robot(scene, *found);
  }

  void add_pairs_and_groups(Scene& scene) const {
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
  std::vector<BodyPlan> bodies_;
  std::vector<RobotPlan> robots_;
  std::vector<std::pair<std::size_t, YamlValue>> places_;  // of robots: before which body, and which
  std::vector<GeometryPlan> geometries_;
  std::map<std::string, std::size_t> plan_of_;
  std::map<std::string, std::shared_ptr<MeshFile>> files_;
  MeshGeometries meshes_;
  std::uint64_t made_vertices_ = 0;
};

}  // namespace

Scene Scene::load(const std::string& path, bool allow_outside) {
  const FpEnvironment environment;
  return is_robot_file(path) ? scene_of_robot(path, allow_outside) : SceneReader(path, allow_outside).read();
}

}  // namespace clearance
