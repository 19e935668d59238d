// Geometry of a body, which bodies of the same shape share.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/hull/convex_part.h"

namespace clearance {

/// Axis of a mesh file that points up. The body's is always z.
enum class UpAxis : std::uint8_t { kZ, kY };

/// Triangles of a body in its frame, for rendering and for the naive baseline. The engine's answers never use them.
struct DisplayMesh {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
};

/// Points of a point cloud: given, empty (the body occupies nothing), or none until some are received.
enum class CloudState : std::uint8_t { kNoCloud, kPoints, kEmpty, kAwaited };

/// Convex parts of a body, and how far they deviate from its shape.
struct Geometry {
  std::vector<ConvexPartPtr> parts;            ///< convex parts; empty for a frame, which belongs to no pair
  std::shared_ptr<const DisplayMesh> display;  ///< may be null
  /// Bound on the distance by which the parts exceed the requested shape, in metres. A mesh means the hulls of the
  /// file's scaled vertices, so that its bound covers rounding only.
  double model_error = 0;
  double model_inner = 0;  ///< bound on the distance by which that shape exceeds the parts, in metres
  double hull_excess = 0;  ///< bound on the distance from a point of the parts to their mesh, in metres (hull_excess.h)
  double empty_share = 0;  ///< fraction of the parts' volume outside the mesh; NaN for an open mesh
  std::string source;      ///< origin, such as "meshes/base.stl (hull)" or "box"
  CloudState cloud = CloudState::kNoCloud;  ///< unless kPoints, the single part of a cloud is a placeholder
  double cloud_radius = 0;                  ///< default radius of received points, in metres
  float voxel = 0;                          ///< edge of the boxes around the points, in metres; 0 for points
};

}  // namespace clearance
