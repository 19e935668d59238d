// Spheres and boxes that are nearly the same as a convex part.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/hull/convex_part.h"
#include "engine/pose/pose.h"

namespace clearance {

/// Limit for Qhull: about a tenth of a second.
inline constexpr std::size_t kMostQhullVertices = 20'000;

/// Holds a part's vertices, without the part's radius.
struct SphereAround {
  Vec3d centre;
  double radius, error;  ///< metres; upper bound on how far it stands out
};
struct BoxAround {
  Pose pose;  ///< of its centre
  Vec3d size;
  double error;  ///< metres; upper bound on how far it stands out
};

/// \param allowed bound on the result's error, in metres
std::optional<SphereAround> find_sphere(const ConvexPartPtr& part, double allowed);
/// \param faces of the hull of the part's vertices
std::optional<BoxAround> find_box(const ConvexPartPtr& part, const std::vector<Triangle>& faces, double allowed);

}  // namespace clearance
