// Robots with the links `base` and `tip`, for tests of joint tables.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/joint_table/joint_table_maker.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {

using Positions = std::array<double, 2>;

struct TableBall {
  Vec3d centre;
  double radius;
};

inline std::string shapes(const std::vector<TableBall>& balls) {
  std::string text;
  for (const auto& [c, radius] : balls)
    text += "<collision><origin xyz='" + std::to_string(c.x) + " " + std::to_string(c.y) + " " + std::to_string(c.z) +
            "'/><geometry><sphere radius='" + std::to_string(radius) + "'/></geometry></collision>";
  return text;
}
inline std::string link(const std::string& name, const std::string& inside = "") {
  return "<link name='" + name + "'>" + inside + "</link>";
}
/// \param rest further elements
inline std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                         const std::string& child, const std::string& origin, const std::string& axis,
                         const std::string& rest = "") {
  return "<joint name='" + name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child +
         "'/><origin xyz='" + origin + "'/><axis xyz='" + axis + "'/>" + rest + "</joint>";
}
inline std::string limits(double lower, double upper) {
  return "<limit lower='" + std::to_string(lower) + "' upper='" + std::to_string(upper) + "'/>";
}

/// The links `base` and `tip` of a robot.
class TwoLinks {
 public:
  /// \param meshes names and texts of files
  explicit TwoLinks(const std::string& links_and_joints, const std::map<std::string, std::string>& meshes = {}) {
    const TemporaryFolder folder;
    for (const auto& [name, text] : meshes) folder.write(name, text);
    engine::RobotOptions options;
    options.urdf = folder.write("r.urdf", "<robot name='r'>" + links_and_joints + "</robot>");
    options.home.emplace();
    scene_.add_robot("r", options);
    pair_ = table_pair(scene_.robots()[0], body("base"), body("tip"));
  }

  const Body& body(const std::string& name) const { return scene_.bodies()[scene_.find_body("r/" + name)]; }
  const std::optional<TablePair>& pair() const { return pair_; }
  std::vector<test::RealFrame> frames(const Positions& at) const {
    const SceneRobot& robot = *scene_.robots()[0];
    std::vector<double> q(robot.model.columns.size(), 0.25);  // the others do not matter
    for (std::size_t c = 0; c < pair_->columns.size(); ++c) q[pair_->columns[c]] = at[c];
    const auto all = test::real_links(robot.model, q.data(), robot.kinematics.roots(), std::vector<Pose>(1));
    return {all[pair_->a.link], all[pair_->b.link]};
  }

 private:
  engine::Scene scene_;
  std::optional<TablePair> pair_;
};

}  // namespace clearance::exact
