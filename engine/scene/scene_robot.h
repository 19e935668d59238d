// A robot in a scene: the bodies of its links, and its joints.
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
#include "wire/mesh_as.h"

namespace clearance {

/// Uncertainty of a body's pose.
struct Uncertainty {
  double position = 0;  ///< radius of the ball around the given place that contains its origin, in metres
  double angle = 0;     ///< bound on its rotation about its origin, about any axis, in radians
};

/// One of a scene's joint positions: a column of one of its robots.
struct SceneJoint {
  std::string name;             ///< "panda/panda_joint1"
  std::uint32_t robot = 0;      ///< index in Scene::robots()
  std::uint32_t column = 0;     ///< index in its model
  double lower = 0, upper = 0;  ///< radians or metres; infinite without a limit
  std::optional<double> home;   ///< position at load; without one its links have no pose until it is set
};

/// A named group of joints: those of a robot, by its name, or of a group of its SRDF, "panda/panda_arm".
struct JointGroup {
  std::string name;
  std::vector<std::uint32_t> joints;  ///< ids, ascending
};

/// Immutable. Each link is a body. The base follows a frame with the robot's name; every other link follows that frame,
/// or the child of the floating joint above it, and joints compute its pose relative to it.
struct SceneRobot {
  SceneRobot(std::string robot_name, RobotModel robot_model)
      : name(std::move(robot_name)), model(std::move(robot_model)), kinematics(model) {}

  std::string name;
  RobotModel model;
  std::string urdf, srdf;  ///< text of the files; empty without an SRDF
  Kinematics kinematics;
  LinkErrors errors;
  std::uint32_t base = kNone;         ///< body id of the frame that places the robot
  std::uint32_t first_joint = 0;      ///< index in Scene::joints() of the model's first column
  std::vector<std::uint32_t> bodies;  ///< by link
  /// Digest of the meaning of joint ids and link poses: equal in scenes with the same robot, whatever their bodies.
  std::uint64_t digest = 0;

  /// Whether joints place a link, rather than a received pose. True for all but children of floating joints.
  bool places(std::uint32_t link) const {
    return model.links[link].joint == kNone || model.joints[model.links[link].joint].kind != JointKind::kFloating;
  }
};

/// End of the error about a file outside the scene's folder.
inline constexpr const char* kOutsideIsRejected =
    "mesh files must lie inside it unless others are allowed (--allow-outside; in Python allow_outside=True)";

namespace engine {

/// A robot to be added to a scene.
struct RobotOptions {
  std::string urdf;                                  ///< path
  std::string srdf = {};                             ///< path, or empty
  std::map<std::string, std::string> packages = {};  ///< folder by package, for package://NAME/...
  std::string parent = {};                           ///< body that the base follows, or empty
  Pose base = {};                                    ///< X_wb of the base, or X_pb with a parent
  bool is_static = false;                            ///< the base never moves
  bool visual = false;                               ///< uses the shapes of `visual` instead of `collision`
  MeshAs mesh_as = MeshAs::kAuto;                    ///< geometry of the links' meshes
  std::map<std::string, MeshAs> link_mesh_as = {};   ///< by link, instead of `mesh_as`
  /// Files of Scene::save() by link, instead of the shapes of the URDF. Other links are frames.
  std::optional<std::map<std::string, std::string>> geometry_files = {};
  /// Positions at load, by joint; joints not named are at 0. Without it, links that depend on joints have no pose.
  std::optional<std::map<std::string, double>> home = {};
  std::string home_state = {};                               ///< state of the SRDF, instead of `home`, or empty
  double padding = 0;                                        ///< Body::padding of every link, in metres
  std::map<std::string, double> link_padding = {};           ///< by link, instead of `padding`
  std::map<std::string, Uncertainty> link_uncertainty = {};  ///< by link; does not apply to links below
  bool allow_outside = true;                                 ///< permits meshes outside `folder`
  std::string folder = {};
};

}  // namespace engine

}  // namespace clearance
