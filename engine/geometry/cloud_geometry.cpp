#include "engine/geometry/cloud_geometry.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/base/digest.h"
#include "engine/base/fp_environment.h"
#include "engine/bvh/surface.h"

namespace clearance {

ConvexPartPtr make_cloud_part(std::span<const CloudPoint> points, float voxel, double radius) {
  const FpEnvironment environment;
  const auto cloud = std::make_shared<const Surface>(points, voxel);
  const auto& ends = cloud->extremes();
  std::vector<Vec3d> corners;
  for (std::size_t i = 0; i < 8; ++i) corners.push_back({ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z});
  Digest digest;
  digest.add(cloud->digest());
  digest.add(radius);
  return make_convex_part(std::move(corners), radius, cloud->size(), digest.value(), nullptr, cloud);
}

ConvexPartPtr part_of_no_points() {
  static const ConvexPartPtr& nothing =
      *new ConvexPartPtr(make_convex_part({{0, 0, 0}}));  // queries may outlast main()
  return nothing;
}

float voxel_of(double edge) {
  if (!(edge >= 0 && edge <= double{Surface::kMostCloudCoordinate}))
    throw std::invalid_argument("voxel: expected a number of metres >= 0 and up to 1e9, got " + std::to_string(edge));
  const auto rounded = static_cast<float>(edge);
  return rounded < edge ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
}

}  // namespace clearance
