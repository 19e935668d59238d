// A robot in a scene: which body each of its links is, and which joints place it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/pose/pose.h"
#include "engine/robot/kinematics.h"
#include "engine/robot/robot.h"
#include "engine/scene/link_errors.h"
#include "wire/convexify.h"

namespace clearance {

/// How well a body's pose is known.
struct Uncertainty {
  double position = 0;  ///< metres: its origin lies within a ball of this radius about the place given
  double angle = 0;     ///< radians: it may be turned by up to this about its origin, about any axis
};

/// One number of a scene's joint positions: a column of one of its robots.
struct SceneJoint {
  std::string name;             ///< "panda/panda_joint1"
  std::uint32_t robot = 0;      ///< of Scene::robots()
  std::uint32_t column = 0;     ///< of its model
  double lower = 0, upper = 0;  ///< radians or metres; infinite: no limit
  std::optional<double> home;   ///< position at load; none: its links have no pose until one is set
};

/// Joints that are named together: those of a robot, by its name, or of a group of its SRDF, "panda/panda_arm".
struct JointGroup {
  std::string name;
  std::vector<std::uint32_t> joints;  ///< ids, ascending
};

/// Immutable. Each link is a body; the base hangs on a frame that has the robot's name, and each other one follows that
/// frame, or the child of the floating joint that it hangs on: its pose relative to it is what the joints make.
struct SceneRobot {
  SceneRobot(std::string robot_name, RobotModel robot_model)
      : name(std::move(robot_name)), model(std::move(robot_model)), kinematics(model) {}

  std::string name;
  RobotModel model;
  std::string urdf, srdf;  ///< the files' text; no SRDF: empty
  Kinematics kinematics;
  LinkErrors errors;
  std::uint32_t base = kNone;         ///< body: the frame that places the robot
  std::uint32_t first_joint = 0;      ///< of Scene::joints(): they follow in the order of the model's columns
  std::vector<std::uint32_t> bodies;  ///< by link
  /// Of what joint ids and poses of links mean: the same where two scenes have the same robot, bodies aside.
  std::uint64_t digest = 0;

  /// Whether joints place a link, rather than a pose that somebody gives: all but children of floating joints.
  bool places(std::uint32_t link) const {
    return model.links[link].joint == kNone || model.joints[model.links[link].joint].kind != JointKind::kFloating;
  }
};

/// Ends the error about a file that a scene names and that lies elsewhere.
inline constexpr const char* kOutsideIsRefused =
    "mesh files must lie inside it unless others are allowed (--allow-outside; in Python allow_outside=True)";

/// A robot to be added to a scene.
struct RobotOptions {
  std::string urdf;                                      ///< path
  std::string srdf = {};                                 ///< path; empty: none
  std::map<std::string, std::string> packages = {};      ///< folder by package, for package://NAME/...
  std::string parent = {};                               ///< body that the base follows; empty: none
  Pose base = {};                                        ///< X_wb of the base, with a parent X_pb
  bool is_static = false;                                ///< the base never moves
  bool visual = false;                                   ///< links have the shapes of `visual`, not of `collision`
  Convexify convexify = Convexify::kAuto;                ///< what the bodies of the links' meshes are
  std::map<std::string, Convexify> link_convexify = {};  ///< the same by link, in place of `convexify`
  /// Files of Scene::save() by link, in place of the shapes of the URDF; links that it does not name are frames.
  std::optional<std::map<std::string, std::string>> geometry_files = {};
  /// Positions at load, by joint; those that it does not name are at 0. None: no link has a pose that a joint has yet
  /// to make.
  std::optional<std::map<std::string, double>> home = {};
  std::string home_state = {};                               ///< of the SRDF, in place of `home`; empty: none
  double padding = 0;                                        ///< metres, grows every link: Body::padding
  std::map<std::string, double> link_padding = {};           ///< the same by link, in place of `padding`
  std::map<std::string, Uncertainty> link_uncertainty = {};  ///< of single links, not of those that hang on them
  bool allow_outside = true;                                 ///< meshes may lie outside `folder`
  std::string folder = {};
};

}  // namespace clearance
