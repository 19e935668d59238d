// Reads a URDF (http://wiki.ros.org/urdf/XML) into a RobotModel. Missing elements get the format's defaults (no
// <origin>, <axis> 1 0 0, <mimic multiplier> 1); an invalid number is an error.
#include <cmath>
#include <filesystem>
#include <unordered_map>

#include "engine/base/fp_environment.h"
#include "engine/pose/sin_cos.h"
#include "engine/robot/robot.h"

namespace clearance {

namespace {

constexpr std::size_t kMaxLinks = 10'000;
constexpr std::size_t kMaxShapes = 100'000;

using Ids = std::unordered_map<std::string, std::uint32_t>;

class UrdfReader {
 public:
  explicit UrdfReader(const XmlElement& root) : root_(root) {}

  RobotModel read() {
    check_expanded();
    robot_.name = root_.text("name");
    for (const XmlElement& link : root_.children("link")) read_link(link);
    if (robot_.links.empty()) root_.fail("expected at least one <link>");
    for (const XmlElement& joint : root_.children("joint")) read_joint(joint);
    find_base();
    sort_joints();
    read_mimics();
    add_columns();
    return std::move(robot_);
  }

 private:
  // A file of macros does not describe a robot yet. Elements that are not read may contain text that only resembles
  // macros.
  void check_expanded() const {
    using Macros = XmlElement::Macros;
    root_.reject_macros(Macros::kAttributes, "robot.urdf");
    for (const XmlElement& element : root_.children()) {
      const bool is_read = element.name() == "link" || element.name() == "joint";
      element.reject_macros(is_read ? Macros::kInside : Macros::kName, "robot.urdf");
    }
  }

  static std::string fresh_name(const XmlElement& element, const Ids& ids) {
    const std::string name = element.text("name");
    if (ids.contains(name)) element.fail("there is one of this name already");
    return name;
  }

  void read_link(const XmlElement& element) {
    RobotLink link;
    link.name = fresh_name(element, links_);
    if (robot_.links.size() >= kMaxLinks) element.fail("more than " + std::to_string(kMaxLinks) + " links");
    for (const XmlElement& shape : element.children("collision")) link.collision.push_back(read_shape(count(shape)));
    for (const XmlElement& shape : element.children("visual")) link.visual.push_back(read_visual(count(shape)));
    links_.emplace(link.name, static_cast<std::uint32_t>(robot_.links.size()));
    robot_.links.push_back(std::move(link));
  }

  static Origin read_origin(const XmlElement& element) {
    Origin origin;
    const auto at = element.child("origin");
    if (!at) return origin;
    if (at->has("xyz")) origin.xyz = at->vector("xyz");
    if (at->has("rpy")) origin.rpy = at->vector("rpy");
    for (int k = 0; k < 3; ++k) {
      if (!(std::abs(origin.rpy[k]) <= kMaxAngle)) at->fail("rpy: expected angles up to 1e6 radians");
      if (!(std::abs(origin.xyz[k]) <= 1e6)) at->fail("xyz: expected coordinates up to 1e6 m");
    }
    return origin;
  }

  const XmlElement& count(const XmlElement& shape) {
    if (++shapes_ > kMaxShapes) shape.fail("more than " + std::to_string(kMaxShapes) + " shapes");
    return shape;
  }

  // Most robots are used with their collision shapes alone, and files have markers of size 0 among the visual ones.
  static RobotShape read_visual(const XmlElement& element) {
    try {
      return read_shape(element);
    } catch (const RobotError& error) {
      RobotShape shape;
      shape.place = element.place();
      shape.problem = error.what();
      return shape;
    }
  }

  static RobotShape read_shape(const XmlElement& element) {
    const XmlElement geometry = element.required_child("geometry");
    const std::vector<XmlElement> found = geometry.children();
    if (found.size() != 1) geometry.fail("expected one shape, got " + std::to_string(found.size()));
    const XmlElement& here = found[0];
    RobotShape shape;
    shape.X_ls = read_origin(element);
    shape.place = element.place();
    const std::string kind = here.name();
    if (kind == "box") {
      shape.size = here.vector("size");
      for (int k = 0; k < 3; ++k)
        if (!(shape.size[k] > 0)) here.fail("size: expected numbers > 0, got " + excerpt(here.text("size")));
    } else if (kind == "sphere") {
      shape.kind = RobotShape::Kind::kSphere;
      shape.radius = here.positive("radius");
    } else if (kind == "cylinder" || kind == "capsule") {
      shape.kind = kind == "capsule" ? RobotShape::Kind::kCapsule : RobotShape::Kind::kCylinder;
      shape.radius = here.positive("radius");
      shape.length = here.positive("length");
    } else if (kind == "mesh") {
      shape.kind = RobotShape::Kind::kMesh;
      shape.mesh = here.text("filename");
      if (here.has("scale")) shape.mesh_scale = here.vector("scale");
      for (int k = 0; k < 3; ++k)
        if (shape.mesh_scale[k] == 0) here.fail("scale: expected factors other than 0");
    } else {
      here.fail("expected box, sphere, cylinder, capsule or mesh");
    }
    return shape;
  }

  std::uint32_t link_of(const XmlElement& joint, const char* role) {
    const XmlElement element = joint.required_child(role);
    const std::string name = element.text("link");
    const auto at = links_.find(name);
    if (at == links_.end()) element.fail("there is no link " + excerpt(name));
    return at->second;
  }

  static JointKind kind_of(const XmlElement& element) {
    const std::string type = element.text("type");
    constexpr const char* kTypes[] = {"fixed", "revolute", "continuous", "prismatic", "planar", "floating"};
    for (int k = 0; k < 6; ++k)
      if (type == kTypes[k]) return static_cast<JointKind>(k);
    element.fail("type: expected fixed, revolute, continuous, prismatic, planar or floating, got " + excerpt(type));
  }

  static bool has_axis(JointKind kind) { return kind != JointKind::kFixed && kind != JointKind::kFloating; }

  void read_joint(const XmlElement& element) {
    RobotJoint joint;
    joint.name = fresh_name(element, joints_);
    joint.kind = kind_of(element);
    joint.parent = link_of(element, "parent");
    joint.child = link_of(element, "child");
    joint.X_pj = read_origin(element);
    if (has_axis(joint.kind)) joint.axis = read_axis(element, joint.kind);
    if (joint.parent == joint.child) element.fail("its parent and child are the same link");
    std::uint32_t& carrier = robot_.links[joint.child].joint;
    if (carrier != kNone)
      element.fail("the link " + excerpt(robot_.links[joint.child].name) + " already has the parent joint " +
                   excerpt(robot_.joints[carrier].name) + "; links must form a tree");
    carrier = static_cast<std::uint32_t>(robot_.joints.size());
    joints_.emplace(joint.name, carrier);
    elements_.push_back(element);
    robot_.joints.push_back(std::move(joint));
  }

  static Vec3d read_axis(const XmlElement& joint, JointKind kind) {
    const auto element = joint.child("axis");
    const Vec3d axis = element ? element->vector("xyz") : Vec3d{1, 0, 0};
    const XmlElement& place = element ? *element : joint;
    if (is_zero(axis)) place.fail("expected an axis other than 0 0 0 of a joint that moves");
    for (int k = 0; k < 3; ++k)
      if (std::abs(axis[k]) > 1e6) place.fail("xyz: expected coordinates up to 1e6");
    if (kind == JointKind::kPlanar && !(axis.x == 0 && axis.y == 0 && axis.z > 0))
      place.fail("a planar joint must have the axis 0 0 1: URDF does not define x and y for another axis");
    return axis;
  }

  void find_base() {
    for (std::uint32_t i = 0; i < robot_.links.size(); ++i) {
      if (robot_.links[i].joint != kNone) continue;
      if (robot_.base != kNone)
        root_.fail("two links have no parent joint, " + excerpt(robot_.links[robot_.base].name) + " and " +
                   excerpt(robot_.links[i].name) + "; a robot has one base");
      robot_.base = i;
    }
    if (robot_.base == kNone) root_.fail("every link has a parent: the joints form a cycle");
  }

  // Sorts the joints in the order from the base, children in the file's order.
  void sort_joints() {
    std::vector<std::vector<std::uint32_t>> carried(robot_.links.size());
    for (std::uint32_t j = static_cast<std::uint32_t>(robot_.joints.size()); j-- > 0;)
      carried[robot_.joints[j].parent].push_back(j);
    std::vector<std::uint32_t> order, open = carried[robot_.base];
    while (!open.empty()) {
      const std::uint32_t j = open.back();
      open.pop_back();
      order.push_back(j);
      const auto& next = carried[robot_.joints[j].child];
      open.insert(open.end(), next.begin(), next.end());
    }
    std::vector<std::uint32_t> place(robot_.joints.size(), kNone);
    for (std::uint32_t i = 0; i < order.size(); ++i) place[order[i]] = i;
    for (std::uint32_t j = 0; j < place.size(); ++j)
      if (place[j] == kNone) elements_[j].fail("it is its own ancestor: the joints form a cycle");
    std::vector<RobotJoint> sorted;
    std::vector<XmlElement> elements;
    for (const std::uint32_t j : order) {
      sorted.push_back(std::move(robot_.joints[j]));
      elements.push_back(elements_[j]);
    }
    robot_.joints = std::move(sorted);
    elements_ = std::move(elements);
    for (RobotLink& link : robot_.links)
      if (link.joint != kNone) link.joint = place[link.joint];
    for (auto& [name, id] : joints_) id = place[id];
  }

  static bool has_one_column(JointKind kind) {
    return kind == JointKind::kRevolute || kind == JointKind::kContinuous || kind == JointKind::kPrismatic;
  }

  // A <mimic> on a fixed joint has no effect.
  void read_mimics() {
    for (std::uint32_t j = 0; j < robot_.joints.size(); ++j) {
      RobotJoint& joint = robot_.joints[j];
      const auto element = elements_[j].child("mimic");
      if (!element || joint.kind == JointKind::kFixed) continue;
      if (!has_one_column(joint.kind))
        element->fail("only a revolute, continuous or prismatic joint can mimic another");
      const std::string name = element->text("joint");
      const auto at = joints_.find(name);
      if (at == joints_.end()) element->fail("there is no joint " + excerpt(name));
      if (at->second == j) element->fail("it mimics itself");
      const RobotJoint& other = robot_.joints[at->second];
      if (!has_one_column(other.kind))
        element->fail("the joint " + excerpt(name) +
                      " has not one position; expected a revolute, continuous or prismatic one");
      Mimic mimic{at->second};
      if (element->has("multiplier")) mimic.multiplier = element->number("multiplier");
      if (element->has("offset")) mimic.offset = element->number("offset");
      check_mimic(*element, mimic);
      joint.mimic = mimic;
    }
    follow_mimics();
  }

  static void check_mimic(const XmlElement& element, const Mimic& mimic) {
    if (!(std::abs(mimic.multiplier) <= 1e6 && std::abs(mimic.offset) <= 1e6))
      element.fail("expected a multiplier and an offset up to 1e6");
  }

  // A joint that mimics a mimic joint mimics the last one of the chain, by factors multiplied in float64.
  void follow_mimics() {
    const std::vector<RobotJoint> read = robot_.joints;
    for (std::uint32_t j = 0; j < read.size(); ++j) {
      if (!read[j].mimic) continue;
      Mimic& mimic = *robot_.joints[j].mimic;
      std::size_t steps = 0;
      while (const auto& next = read[mimic.joint].mimic) {
        const XmlElement element = elements_[j].required_child("mimic");
        if (++steps > read.size()) element.fail("it mimics itself through others");
        mimic = {next->joint, mimic.multiplier * next->multiplier, mimic.multiplier * next->offset + mimic.offset};
        check_mimic(element, mimic);
      }
    }
  }

  void add_columns() {
    Ids seen;
    for (std::uint32_t j = 0; j < robot_.joints.size(); ++j) {
      RobotJoint& joint = robot_.joints[j];
      const auto [lower, upper] = read_limits(elements_[j], joint);
      if (joint.mimic || joint.kind == JointKind::kFixed || joint.kind == JointKind::kFloating) continue;
      joint.column = static_cast<std::uint32_t>(robot_.columns.size());
      if (joint.kind == JointKind::kPlanar)
        for (const char* part : {"/x", "/y", "/theta"}) robot_.columns.push_back({joint.name + part, j, lower, upper});
      else
        robot_.columns.push_back({joint.name, j, lower, upper});
      for (std::size_t c = joint.column; c < robot_.columns.size(); ++c)
        if (!seen.emplace(robot_.columns[c].name, 0).second)
          elements_[j].fail("two joints have a position " + excerpt(robot_.columns[c].name));
    }
  }

  // A missing limit is 0, as in the format.
  std::pair<double, double> read_limits(const XmlElement& element, const RobotJoint& joint) {
    if (joint.kind != JointKind::kRevolute && joint.kind != JointKind::kPrismatic) return {-INFINITY, INFINITY};
    const XmlElement limit = element.required_child("limit");
    if (!limit.has("lower") && !limit.has("upper") && !joint.mimic)
      robot_.warnings.push_back(limit.place() +
                                ": neither lower nor upper: both are 0, and every other position is beyond them; a "
                                "joint that turns without end has the type continuous");
    const auto text = [&](const char* which) { return limit.has(which) ? limit.text(which) : "0"; };
    const auto number = [&](const char* which) { return limit.has(which) ? limit.number(which) : 0.0; };
    const double lower = number("lower"), upper = number("upper");
    if (lower > upper) limit.fail("lower " + excerpt(text("lower")) + " is above upper " + excerpt(text("upper")));
    return {lower, upper};
  }

  XmlElement root_;
  RobotModel robot_;
  Ids links_, joints_;
  std::vector<XmlElement> elements_;  // of the joints
  std::size_t shapes_ = 0;
};

}  // namespace

RobotModel read_urdf(const std::string& path) {
  const FpEnvironment environment;
  return UrdfReader(XmlElement::load(path, "robot")).read();
}

RobotModel parse_urdf(std::string_view text, const std::string& file) {
  const FpEnvironment environment;
  return UrdfReader(XmlElement::parse(text, file, "robot")).read();
}

}  // namespace clearance
