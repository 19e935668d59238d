#include "tests/oracle/states/arm.h"

#include <cstdio>

namespace clearance::exact {
namespace {

std::string text_of(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", number);
  return text;
}

std::string text_of(const Vec3d& v) {
  return text_of(v.x) + " " + text_of(v.y) + " " + text_of(v.z);
}

struct LinkPart {
  std::string geometry;
  PartBounds bounds;
  Vec3d at;
};

class ArmMaker {
 public:
  explicit ArmMaker(Random& random) : random_(random) {}

  /// Adds a link, and the joint that moves it unless it is the first.
  void link(const std::vector<LinkPart>& parts, std::size_t parent = 0, const std::string& joint = {}) {
    const std::string number = std::to_string(links_.size());
    text_ += "<link name='l" + number + "'>";
    std::vector<PartBounds> bounds;
    for (const LinkPart& part : parts) {
      text_ +=
          "<collision><origin xyz='" + text_of(part.at) + "'/><geometry>" + part.geometry + "</geometry></collision>";
      bounds.push_back(moved(part.bounds, part.at));
    }
    text_ += "</link>";
    if (!joint.empty())
      text_ += "<joint name='j" + number + "' " + joint + "<parent link='l" + std::to_string(parent) +
               "'/><child link='l" + number + "'/></joint>";
    links_.push_back(std::move(bounds));
  }
  std::string turning(const Vec3d& at, const Vec3d& axis) {
    const Vec3d rpy{random_.uniform(-0.5, 0.5), random_.uniform(-0.5, 0.5), random_.uniform(-0.5, 0.5)};
    return "type='revolute'><origin xyz='" + text_of(at) + "' rpy='" + text_of(rpy) + "'/><axis xyz='" + text_of(axis) +
           "'/><limit lower='-2.5' upper='2.5'/>";
  }
  std::string text() const { return "<robot name='arm'>" + text_ + "</robot>"; }
  const std::vector<std::vector<PartBounds>>& links() const { return links_; }

 private:
  Random& random_;
  std::string text_;
  std::vector<std::vector<PartBounds>> links_;
};

LinkPart box_part(const Vec3d& size, const Vec3d& at) {
  return {"<box size='" + text_of(size) + "'/>", box_bounds(size), at};
}

LinkPart capsule_part(double radius, double length, const Vec3d& at) {
  return {"<capsule radius='" + text_of(radius) + "' length='" + text_of(length) + "'/>",
          capsule_bounds(radius, length), at};
}

std::string as_obj(const std::vector<Vec3d>& points) {
  std::string text;
  for (const Vec3d& v : points) text += "v " + text_of(v) + "\n";
  for (std::size_t i = 3; i <= points.size(); ++i)
    text += "f " + std::to_string(i - 2) + " " + std::to_string(i - 1) + " " + std::to_string(i) + "\n";
  return text;
}

}  // namespace

Arm make_arm(Random& random) {
  const std::vector<Vec3d> points = random_points(random, 20, {0.0625, 0.046875, 0.109375});
  const LinkPart mesh{"<mesh filename='hull.obj'/>", hull_bounds(points), {0, 0, 0.125}};
  ArmMaker arm(random);
  arm.link({box_part({0.25, 0.25, 0.125}, {0, 0, -0.0625})});
  arm.link({{"<cylinder radius='0.0625' length='0.25'/>", cylinder_bounds(0.0625, 0.25), {0, 0, 0.1875}}}, 0,
           arm.turning({0, 0, 0.03125}, {0, 0, 1}));
  arm.link({box_part({0.0625, 0.09375, 0.3125}, {0, 0, 0.21875}), capsule_part(0.03125, 0.125, {0.0625, 0, 0.25})}, 1,
           arm.turning({0, 0, 0.375}, {0, 1, 0}));
  arm.link({mesh}, 2, arm.turning({0, 0, 0.4375}, {0, 1, 0.25}));
  arm.link({capsule_part(0.0390625, 0.125, {0, 0, 0.125})}, 3,
           "type='prismatic'><origin xyz='0 0 0.25'/><axis xyz='0 0 1'/><limit lower='0' upper='0.25'/>");
  arm.link({mesh}, 4, arm.turning({0, 0, 0.25}, {1, 0, 0}));
  arm.link({{"<sphere radius='0.0625'/>", hull_bounds({{0, 0, 0}}, 0.0625), {0, 0.03125, 0.0625}}}, 5,
           arm.turning({0, 0, 0.3125}, {0, 1, 0}));
  arm.link({mesh}, 2,
           arm.turning({0, 0.125, 0.375}, {1, 0, 0}) + "<mimic joint='j1' multiplier='-0.5' offset='0.25'/>");
  return {arm.text(), as_obj(points), arm.links()};
}

}  // namespace clearance::exact
