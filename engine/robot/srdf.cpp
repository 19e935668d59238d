// Reads an SRDF (http://wiki.ros.org/srdf) into a RobotModel: groups, group states and disabled pairs of links.
// Elements about pairs have the meaning that MoveIt gives them (AllowedCollisionMatrix).
//
// Most SRDFs refer to something that their URDF lacks. The group, pair or position that does so is dropped as a whole
// with a warning, and the rest is used. If the names of the robots differ as well, the file belongs to another robot,
// and such a group or pair is an error. Virtual joints place a robot in its world, which the scene does here, so their
// positions are dropped.
#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>
#include <unordered_set>

#include "engine/base/fp_environment.h"
#include "engine/robot/robot.h"

namespace clearance {

namespace {

constexpr std::size_t kMaxGroups = 1000;
constexpr std::size_t kMaxMembers = 1'000'000;  // of all groups, as often as chains and inner groups name them

constexpr std::size_t kMaxDefaultPairs = 1'000'000;

// A reference to a missing name. The text begins with the place.
struct Missing {
  std::string text;
};

class SrdfReader {
 public:
  SrdfReader(const XmlElement& root, RobotModel* robot) : root_(root), robot_(*robot) {
    for (std::uint32_t i = 0; i < robot_.links.size(); ++i) links_.emplace(robot_.links[i].name, i);
    for (std::uint32_t i = 0; i < robot_.joints.size(); ++i) joints_.emplace(robot_.joints[i].name, i);
    for (const XmlElement& joint : root_.children("virtual_joint")) virtual_.insert(joint.text("name"));
  }

  void read() {
    root_.reject_macros(XmlElement::Macros::kInside, "robot.srdf");
    warn_of_unknown(root_,
                    {"group", "group_state", "disable_collisions", "enable_collisions", "disable_default_collisions",
                     "virtual_joint", "passive_joint", "end_effector", "link_sphere_approximation", "joint_property"});
    const std::vector<XmlElement> groups = root_.children("group");
    if (groups.size() > kMaxGroups) root_.fail("more than " + std::to_string(kMaxGroups) + " groups");
    for (const XmlElement& group : groups)
      if (!groups_.emplace(group.text("name"), Group{group, {}, {}}).second)
        group.fail("there is a group of this name already");
    for (const XmlElement& group : groups) expand(group.text("name"));
    for (const XmlElement& group : groups) add_group(group.text("name"));
    for (const XmlElement& state : root_.children("group_state")) read_state(state);
    read_pairs();
  }

 private:
  struct Group {
    XmlElement element;
    std::set<std::uint32_t> joints, links;
    enum { kNew, kOpen, kDone, kLeftOut } state = kNew;
  };

  [[noreturn]] static void missing(const XmlElement& element, const std::string& what) {
    throw Missing{element.place() + ": " + what};
  }

  [[noreturn]] void not_in_urdf(const XmlElement& element, const char* kind, const std::string& name) const {
    const std::string what = std::string("there is no ") + kind + " " + excerpt(name) + " in the URDF";
    const std::string other = root_.has("name") ? root_.text("name") : robot_.name;
    if (other != robot_.name)
      element.fail(what + "; this SRDF is for the robot " + excerpt(other) + ", the URDF for " + excerpt(robot_.name));
    missing(element, what);
  }

  // Runs f, which may meet a missing name. Returns whether it did not.
  template <class F>
  bool complete(const std::string& left_out, F&& f) {
    try {
      f();
      return true;
    } catch (const Missing& missing) {
      robot_.warnings.push_back(missing.text + "; " + left_out + " is left out");
      return false;
    }
  }

  std::uint32_t link(const XmlElement& element, const char* attribute) const {
    const std::string name = element.text(attribute);
    const auto at = links_.find(name);
    if (at == links_.end()) not_in_urdf(element, "link", name);
    return at->second;
  }

  // Adds the contents of a group's subgroups. Depth first, without recursion, since a file may nest any number.
  void expand(const std::string& first) {
    std::vector<std::string> open = {first};
    while (!open.empty()) {
      Group& group = groups_.at(open.back());
      if (group.state == Group::kNew) {
        group.state = Group::kOpen;
        const std::size_t before = open.size();
        for (const XmlElement& inner : group.element.children("group")) {
          const auto at = groups_.find(inner.text("name"));
          if (at == groups_.end()) continue;
          if (at->second.state == Group::kOpen) inner.fail("the group holds itself");
          if (at->second.state == Group::kNew) open.push_back(at->first);
        }
        if (open.size() > before) continue;  // those first
      }
      if (group.state == Group::kOpen)
        group.state = complete("the group " + excerpt(open.back()), [&] { read_members(&group); }) ? Group::kDone
                                                                                                   : Group::kLeftOut;
      open.pop_back();
    }
  }

  void count_members(const XmlElement& element, std::size_t more) {
    members_ += more;
    if (members_ > kMaxMembers) element.fail("more than " + std::to_string(kMaxMembers) + " members of groups");
  }

  void read_members(Group* group) {
    warn_of_unknown(group->element, {"group", "joint", "link", "chain"});
    for (const XmlElement& inner : group->element.children("group")) {
      const auto at = groups_.find(inner.text("name"));
      if (at == groups_.end()) missing(inner, "there is no group " + excerpt(inner.text("name")));
      if (at->second.state == Group::kLeftOut) missing(inner, "this group is left out");
      count_members(inner, at->second.joints.size() + at->second.links.size());
      group->joints.insert(at->second.joints.begin(), at->second.joints.end());
      group->links.insert(at->second.links.begin(), at->second.links.end());
    }
    for (const XmlElement& joint : group->element.children("joint")) {
      const std::string name = joint.text("name");
      if (virtual_.contains(name)) continue;
      const auto at = joints_.find(name);
      if (at == joints_.end()) not_in_urdf(joint, "joint", name);
      add_joint(at->second, group);
    }
    for (const XmlElement& element : group->element.children("link")) {
      const std::uint32_t id = link(element, "name");
      group->links.insert(id);
      if (robot_.links[id].joint != kNone) group->joints.insert(robot_.links[id].joint);
    }
    for (const XmlElement& chain : group->element.children("chain")) {
      const std::uint32_t base = link(chain, "base_link"), tip = link(chain, "tip_link");
      group->links.insert(base);
      std::uint32_t at = tip;
      for (; at != base && robot_.links[at].joint != kNone; at = robot_.joints[robot_.links[at].joint].parent) {
        count_members(chain, 1);
        add_joint(robot_.links[at].joint, group);
      }
      if (at != base)
        missing(chain, "the link " + excerpt(robot_.links[tip].name) + " is not a descendant of " +
                           excerpt(robot_.links[base].name));
    }
  }

  void add_joint(std::uint32_t joint, Group* group) const {
    group->joints.insert(joint);
    group->links.insert(robot_.joints[joint].child);
  }

  void add_group(const std::string& name) {
    const Group& group = groups_.at(name);
    if (group.state == Group::kLeftOut) return;
    RobotGroup out{name, {}, {group.links.begin(), group.links.end()}};
    for (const std::uint32_t j : group.joints) {
      const RobotJoint& joint = robot_.joints[j];
      if (joint.column == kNone) continue;
      for (std::uint32_t part = 0; part < width(joint); ++part) out.columns.push_back(joint.column + part);
    }
    std::sort(out.columns.begin(), out.columns.end());
    robot_.groups.push_back(std::move(out));
  }

  static std::uint32_t width(const RobotJoint& joint) { return joint.kind == JointKind::kPlanar ? 3 : 1; }

  void read_state(const XmlElement& element) {
    GroupState state{element.text("name"), element.has("group") ? element.text("group") : "", {}};
    if (!states_.emplace(state.name, state.group).second)
      element.fail("there is a state of this name and group already");
    const bool placed = complete("the state", [&] {
      if (!state.group.empty() && !groups_.contains(state.group))
        missing(element, "there is no group " + excerpt(state.group));
    });
    if (!placed) return;
    warn_of_unknown(element, {"joint"});
    std::set<std::string> seen;
    for (const XmlElement& joint : element.children("joint")) {
      if (!seen.insert(joint.text("name")).second) joint.fail("its position is set already");
      complete("this position", [&] { read_position(joint, &state); });
    }
    robot_.states.push_back(std::move(state));
  }

  void read_position(const XmlElement& element, GroupState* state) const {
    const std::string name = element.text("name");
    const auto at = joints_.find(name);
    if (virtual_.contains(name)) missing(element, "a virtual joint; the scene sets the pose of a base");
    if (at == joints_.end()) missing(element, "there is no joint " + excerpt(name) + " in the URDF");
    const RobotJoint& joint = robot_.joints[at->second];
    if (joint.column == kNone)
      missing(element, joint.mimic                       ? "this joint mimics another"
                       : joint.kind == JointKind::kFixed ? "this joint is fixed"
                                                         : "this joint is floating: its link is placed as a body");
    if (joint.kind == JointKind::kPlanar) {
      const Vec3d x = element.vector("value");
      for (int k = 0; k < 3; ++k) state->positions.emplace_back(joint.column + static_cast<std::uint32_t>(k), x[k]);
    } else {
      state->positions.emplace_back(joint.column, element.number("value"));
    }
  }

  // A misspelt element would otherwise silently disable no pair, or drop a group's link.
  void warn_of_unknown(const XmlElement& parent, std::initializer_list<const char*> known) {
    for (const XmlElement& element : parent.children()) {
      const std::string name = element.name();
      if (std::find(known.begin(), known.end(), name) == known.end() && unknown_.insert(name).second)
        robot_.warnings.push_back(element.place() + ": an unknown element; it is not read");
    }
  }

  using IdPair = std::pair<std::uint32_t, std::uint32_t>;

  IdPair pair_of(const XmlElement& element) const {
    const std::uint32_t a = link(element, "link1"), b = link(element, "link2");
    if (a == b) element.fail("a link with itself");
    return std::minmax(a, b);
  }

  // Independent of the file's order: a link's default comes first, then pairs enabled by name, and then those disabled
  // by name.
  void read_pairs() {
    for (const XmlElement& element : root_.children("disable_collisions"))
      complete("the pair", [&] {
        const auto [a, b] = pair_of(element);
        robot_.disabled.push_back({a, b, element.has("reason") ? element.text("reason") : ""});
      });
    sort_disabled();
    std::set<IdPair> disabled, enabled;
    for (const DisabledPair& pair : robot_.disabled) disabled.emplace(pair.a, pair.b);
    for (const XmlElement& element : root_.children("enable_collisions"))
      complete("the pair", [&] {
        const IdPair pair = pair_of(element);
        if (disabled.contains(pair)) missing(element, "the pair is disabled by name as well, which counts");
        enabled.insert(pair);
      });
    add_defaults(enabled);
    robot_.enabled.assign(enabled.begin(), enabled.end());
  }

  void add_defaults(const std::set<IdPair>& enabled) {
    std::set<std::uint32_t> links;
    for (const XmlElement& element : root_.children("disable_default_collisions")) {
      complete("it", [&] { links.insert(link(element, "link")); });
      if (links.size() * robot_.links.size() > kMaxDefaultPairs)
        element.fail("links with more than " + std::to_string(kMaxDefaultPairs) + " pairs are disabled by default");
    }
    for (const std::uint32_t a : links)
      for (std::uint32_t b = 0; b < robot_.links.size(); ++b)
        if (a != b && !enabled.contains(std::minmax(a, b)))
          robot_.disabled.push_back({std::min(a, b), std::max(a, b), "Default"});
    sort_disabled();
  }

  // The first of several entries for a pair is kept.
  void sort_disabled() {
    auto& disabled = robot_.disabled;
    const auto key = [](const DisabledPair& p) { return std::pair(p.a, p.b); };
    std::stable_sort(disabled.begin(), disabled.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
    disabled.erase(
        std::unique(disabled.begin(), disabled.end(), [&](const auto& a, const auto& b) { return key(a) == key(b); }),
        disabled.end());
  }

  XmlElement root_;
  RobotModel& robot_;
  std::unordered_map<std::string, std::uint32_t> links_, joints_;
  std::unordered_set<std::string> virtual_;
  std::unordered_map<std::string, Group> groups_;
  std::set<std::pair<std::string, std::string>> states_;  // name, group
  std::set<std::string> unknown_;                         // elements warned about
  std::size_t members_ = 0;
};

void add_srdf(const XmlElement& root, RobotModel* robot) {
  RobotModel with = *robot;  // a rejected SRDF changes nothing
  SrdfReader(root, &with).read();
  *robot = std::move(with);
}

}  // namespace

void read_srdf(const std::string& path, RobotModel* robot) {
  const FpEnvironment environment;
  add_srdf(XmlElement::load(path, "robot"), robot);
}

void parse_srdf(std::string_view text, const std::string& file, RobotModel* robot) {
  const FpEnvironment environment;
  add_srdf(XmlElement::parse(text, file, "robot"), robot);
}

}  // namespace clearance
