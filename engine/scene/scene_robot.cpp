// Scene::add_robot: makes bodies, joints, groups and ignored pairs from a URDF and its SRDF.
#include "engine/scene/scene_robot.h"

#include <algorithm>
#include <filesystem>

#include "engine/base/fp_environment.h"
#include "engine/geometry/geometry_file.h"
#include "engine/geometry/link_geometry.h"
#include "engine/geometry/make_geometry.h"
#include "engine/scene/body_checks.h"
#include "engine/scene/robot_files.h"
#include "engine/scene/scene.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

using IdPair = std::pair<std::uint32_t, std::uint32_t>;

Shape shape_of(const RobotShape& shape) {
  switch (shape.kind) {
    case RobotShape::Kind::kSphere:
      return make_sphere(shape.radius);
    case RobotShape::Kind::kCylinder:
      return make_cylinder(shape.radius, shape.length);
    case RobotShape::Kind::kCapsule:
      return make_capsule(shape.radius, shape.length);
    default:
      return make_box(shape.size);
  }
}

// Whether a path lies in a folder, with symbolic links resolved.
bool is_inside(const fs::path& path, const fs::path& folder) {
  std::error_code error;
  const fs::path real = fs::canonical(path, error);
  const fs::path home = error ? folder : fs::canonical(folder, error);
  return !error && std::mismatch(home.begin(), home.end(), real.begin(), real.end()).first == home.end();
}

}  // namespace

class RobotAdder {
 public:
  RobotAdder(engine::Scene& scene, const std::string& name, const engine::RobotOptions& options)
      : scene_(scene),
        name_(name),
        options_(options),
        robot_(read_robot_files(name, options)),
        model_(robot_->model),
        packages_(options.packages),
        folder_(fs::path(options.urdf).parent_path().string()) {
    if (folder_.empty()) folder_ = ".";
    if (!options.geometry_files) find_packages(model_, options.visual, &packages_);
  }

  std::uint32_t add() {
    const auto index = static_cast<std::uint32_t>(scene_.robots_.size());
    check_robot_options(*robot_, options_);
    add_base();
    add_joints(index);
    robot_->bodies.resize(model_.links.size(), kNone);
    fixed_ = links_without_joints();
    add_link(model_.base, index);  // parents before their children
    for (const RobotJoint& joint : model_.joints) add_link(joint.child, index);
    robot_->errors = LinkErrors(robot_->kinematics, radii());
    robot_->digest = digest_of(*robot_);
    add_groups();
    leave_out_pairs();
    scene_.robots_.push_back(robot_);
    return index;
  }

 private:
  void add_base() {
    Body base;
    base.name = name_;
    base.is_static = options_.is_static;
    base.pose = options_.base;
    base.source = "robot base";
    scene_.check_free(name_, "robot");
    if (!options_.parent.empty() && (base.parent = scene_.find_body(options_.parent)) == kNone)
      throw engine::SceneError("robot " + in_quotes(name_) + ": parent: " + no_body(scene_, options_.parent));
    robot_->base = scene_.insert_body(std::move(base));
  }

  void add_joints(std::uint32_t index) {
    robot_->first_joint = static_cast<std::uint32_t>(scene_.joints_.size());
    const std::vector<std::optional<double>> home = home_positions(*robot_, options_);
    JointGroup all{name_, {}};
    for (std::uint32_t c = 0; c < model_.columns.size(); ++c) {
      const RobotColumn& column = model_.columns[c];
      SceneJoint joint{name_ + "/" + column.name, index, c, column.lower, column.upper, home[c]};
      all.joints.push_back(robot_->first_joint + c);
      scene_.joint_ids_.emplace(joint.name, all.joints.back());
      scene_.joints_.push_back(std::move(joint));
    }
    scene_.joint_groups_.push_back(std::move(all));
    for (const RobotGroup& group : model_.groups) {
      JointGroup joints{name_ + "/" + group.name, {}};
      for (const std::uint32_t c : group.columns) joints.joints.push_back(robot_->first_joint + c);
      scene_.joint_groups_.push_back(std::move(joints));
    }
  }

  // By link: whether no joint moves it relative to its root.
  std::vector<std::uint8_t> links_without_joints() const {
    std::vector<std::uint8_t> fixed(model_.links.size(), 0);
    fixed[model_.base] = 1;
    for (const RobotJoint& joint : model_.joints)
      fixed[joint.child] = joint.kind == JointKind::kFixed && fixed[joint.parent];
    return fixed;
  }

  void add_link(std::uint32_t link, std::uint32_t index) {
    const RobotLink& of = model_.links[link];
    Body body;
    body.name = name_ + "/" + of.name;
    scene_.check_free(body.name, "link");
    if (options_.geometry_files)
      read_geometry(of.name, body);
    else if (const std::vector<RobotShape>& shapes = options_.visual ? of.visual : of.collision; !shapes.empty())
      make_geometry(shapes, mesh_as_of_link(of.name), body);
    if (!body.parts.empty()) add_uncertainty(of.name, body);
    if (robot_->places(link)) {
      body.robot = index;
      body.link = link;
      body.parent = root_body(link);
      body.is_static = options_.is_static && fixed_[link];
      body.pose = Pose{};  // until joints place it
    }
    robot_->bodies[link] = scene_.insert_body(std::move(body));
  }

  // The body to which a link's pose is relative.
  std::uint32_t root_body(std::uint32_t link) const {
    while (robot_->places(link) && model_.links[link].joint != kNone)
      link = model_.joints[model_.links[link].joint].parent;
    return link == model_.base ? robot_->base : robot_->bodies[link];
  }

  void read_geometry(const std::string& link, Body& body) {
    const auto file = options_.geometry_files->find(link);
    if (file == options_.geometry_files->end()) return;
    take(read_geometry_file(file->second), body);
    body.is_grown = true;
  }

  void add_uncertainty(const std::string& link, Body& body) const {
    const auto padding = options_.link_padding.find(link);
    body.padding = padding == options_.link_padding.end() ? options_.padding : padding->second;
    const auto uncertainty = options_.link_uncertainty.find(link);
    if (uncertainty != options_.link_uncertainty.end()) body.uncertainty = uncertainty->second;
  }

  MeshAs mesh_as_of_link(const std::string& link) const {
    const auto named = options_.link_mesh_as.find(link);
    return named == options_.link_mesh_as.end() ? options_.mesh_as : named->second;
  }

  void make_geometry(const std::vector<RobotShape>& shapes, MeshAs mesh_as, Body& body) {
    std::vector<Geometry> parts;
    for (const RobotShape& shape : shapes) try {
        parts.push_back(moved(geometry_of(shape, mesh_as), shape.X_ls));
      } catch (const RobotError& e) {
        throw engine::SceneError(e.what());
      } catch (const std::exception& e) {  // from its mesh or its numbers
        throw engine::SceneError(shape.place + ": " + e.what());
      }
    take(joined(std::move(parts)), body);
  }

  void take(Geometry geometry, Body& body) {
    for (ConvexPartPtr& part : geometry.parts) part = scene_.shared_part(part);
    static_cast<Geometry&>(body) = std::move(geometry);
  }

  Geometry geometry_of(const RobotShape& shape, MeshAs mesh_as) {
    if (!shape.problem.empty()) throw RobotError(shape.problem);
    if (shape.kind != RobotShape::Kind::kMesh) {
      constexpr const char* kNames[] = {"box", "sphere", "cylinder", "capsule"};
      return geometry_of_shape(shape_of(shape), 0, kNames[static_cast<int>(shape.kind)]);
    }
    const std::string path = mesh_path(shape, folder_, packages_);
    if (!options_.allow_outside && !is_inside(path, options_.folder))
      throw engine::SceneError("mesh " + in_quotes(shape.mesh) + " lies outside the scene's folder; " +
                               kOutsideIsRejected);
    return scene_.mesh_geometry(path, {.scale = shape.mesh_scale, .mesh_as = mesh_as});
  }

  void add_groups() {
    scene_.insert_group({name_, robot_->bodies});  // in addition to the base of that name, which has no pairs
    for (const RobotGroup& group : model_.groups) {
      const std::string name = name_ + "/" + group.name;
      if (scene_.find_body(name) != kNone) {
        robot_->model.warnings.push_back(
            options_.srdf + ": the group " + in_quotes(group.name) +
            " has the name of a link, which that name means in pairs; its joints can be used");
        continue;
      }
      Group bodies{name, {}};
      for (const std::uint32_t link : group.links) bodies.bodies.push_back(robot_->bodies[link]);
      scene_.check_free(name, "group");
      scene_.insert_group(std::move(bodies));
    }
  }

  void leave_out_pairs() {
    std::vector<IdPair> pairs;
    const auto leave_out = [&](std::uint32_t a, std::uint32_t b) {
      const std::uint32_t i = robot_->bodies[a], j = robot_->bodies[b];
      if (has_shape(a) && has_shape(b)) pairs.emplace_back(std::min(i, j), std::max(i, j));
    };
    for (const DisabledPair& pair : model_.disabled) leave_out(pair.a, pair.b);
    std::map<std::uint32_t, std::vector<std::uint32_t>> rigid;  // links by the one that they are fixed to
    for (std::uint32_t link = 0; link < model_.links.size(); ++link) {
      std::uint32_t on = link;
      while (model_.links[on].joint != kNone && model_.joints[model_.links[on].joint].kind == JointKind::kFixed)
        on = model_.joints[model_.links[on].joint].parent;
      for (const std::uint32_t other : rigid[on])
        if (!std::binary_search(model_.enabled.begin(), model_.enabled.end(), IdPair(other, link)))
          leave_out(other, link);
      if (has_shape(link)) rigid[on].push_back(link);
    }
    if (options_.srdf.empty())
      for (std::uint32_t link = 0; link < model_.links.size(); ++link)
        if (const std::uint32_t carrier = shape_above(link); carrier != kNone) leave_out(carrier, link);
    scene_.leave_out(std::move(pairs));
  }

  // By link: bound on the distance of its points from its origin, negative without points.
  std::vector<double> radii() const {
    constexpr double kUp = 1 + 0x1p-40;
    std::vector<double> radii;
    for (const std::uint32_t b : robot_->bodies) {
      const Body& body = scene_.bodies_[b];
      radii.push_back(body.parts.empty() ? -1 : (body.reach + body.model_inner) * kUp);
    }
    return radii;
  }

  bool has_shape(std::uint32_t link) const { return !scene_.bodies_[robot_->bodies[link]].parts.empty(); }

  // The nearest link with a shape on the way to the base, or kNone.
  std::uint32_t shape_above(std::uint32_t link) const {
    while (model_.links[link].joint != kNone) {
      link = model_.joints[model_.links[link].joint].parent;
      if (has_shape(link)) return link;
    }
    return kNone;
  }

  engine::Scene& scene_;
  const std::string& name_;
  const engine::RobotOptions& options_;
  std::shared_ptr<SceneRobot> robot_;
  const RobotModel& model_;
  std::map<std::string, std::string> packages_;  // also those found through the environment
  std::string folder_;
  std::vector<std::uint8_t> fixed_;  // by link
};

std::uint32_t engine::Scene::add_robot(const std::string& name, const engine::RobotOptions& options) {
  const FpEnvironment environment;
  engine::Scene with = *this;  // a rejected robot leaves nothing behind
  const std::uint32_t index = RobotAdder(with, name, options).add();
  *this = std::move(with);
  return index;
}

}  // namespace clearance
