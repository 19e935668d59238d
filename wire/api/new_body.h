// A body to be added to a scene at run time.
#pragma once

#include <clearance/mesh_as.h>
#include <clearance/query.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace clearance {

/// A body to add at run time, with exactly one shape: the hull of `vertices` (body frame), a mesh of `vertices` and
/// `triangles`, a primitive, or a cloud of `points`.
struct NewBody {
  std::string name;
  std::span<const std::array<double, 3>> vertices = {};  ///< metres
  std::optional<std::array<double, 3>> box = {};         ///< full edge lengths, metres
  std::optional<double> sphere = {};                     ///< radius, metres
  std::optional<std::array<double, 2>> capsule = {};     ///< radius, length between the centres of its caps; along z
  std::optional<std::array<double, 2>> cylinder = {};    ///< radius, length; along z
  std::optional<std::array<double, 2>> cone = {};        ///< radius, length; along z, with its apex at the positive end
  std::optional<std::array<double, 3>> ellipsoid = {};   ///< half axes, metres
  bool half_space = false;                               ///< z <= 0 in its own frame; static, without a parent
  double radius = 0;                                     ///< metres, grows the shape
  std::uint32_t parent = kNone;                          ///< body that it follows
  std::optional<Pose7> pose = {};                        ///< X_world_body, or X_parent_body with a parent
  bool is_static = false;
  // Uncertainty, as in a scene file. Rejected by older daemons.
  double uncertainty_position = 0;  ///< metres: radius of a ball around its position that contains its origin
  double uncertainty_angle = 0;     ///< radians: bound on its rotation error about its origin
  double padding = 0;               ///< metres of growth, in addition to `radius`
  double max_speed = 0;             ///< metres per second: bound on the speed of its points
  // A mesh. Rejected by older daemons.
  std::span<const std::array<std::uint32_t, 3>> triangles = {};  ///< indices into `vertices`; closed for a solid
  MeshAs mesh_as = MeshAs::kAuto;  ///< body made from the mesh; kParts is the same as kHull
  /// Points of a cloud in metres, which set_points() replaces. No points make an empty body.
  std::optional<std::span<const std::array<float, 3>>> points = {};
  double voxel = 0;  ///< metres, for a cloud; above 0, boxes of this edge around the points are the body
};

}  // namespace clearance
