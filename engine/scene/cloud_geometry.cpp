#include "engine/scene/cloud_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "engine/base/digest.h"
#include "engine/base/fp_environment.h"
#include "engine/bvh/surface.h"
#include "engine/scene/scene.h"

namespace clearance {

PiecePtr make_cloud_piece(std::span<const CloudPoint> points, float voxel, double radius) {
  const FpEnvironment environment;
  const auto cloud = std::make_shared<const Surface>(points, voxel);
  const auto& ends = cloud->extremes();
  std::vector<Vec3d> corners;
  for (std::size_t i = 0; i < 8; ++i) corners.push_back({ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z});
  Digest digest;
  digest.add(cloud->digest());
  digest.add(radius);
  return make_piece(std::move(corners), radius, cloud->size(), digest.value(), nullptr, cloud);
}

PiecePtr piece_of_no_points() {
  static const PiecePtr& nothing = *new PiecePtr(make_piece({{0, 0, 0}}));  // queries may outlast main()
  return nothing;
}

float voxel_of(double edge) {
  if (!(edge >= 0 && edge <= double{Surface::kMostCloudCoordinate}))
    throw std::invalid_argument("voxel: expected a number of metres >= 0 and up to 1e9, got " + std::to_string(edge));
  const auto rounded = static_cast<float>(edge);
  return rounded < edge ? std::nextafter(rounded, std::numeric_limits<float>::infinity()) : rounded;
}

namespace {

// Puts points into a body, as they are before they grow.
void put_points(Body& body, const PiecePtr& cloud) {
  body.pieces = {cloud ? cloud : piece_of_no_points()};
  body.cloud = cloud ? CloudState::kPoints : CloudState::kEmpty;
  body.model_error = body.model_inner = cloud ? cloud->surface->rounding() : 0;
  body.reach = 0;
  body.is_grown = false;
}

}  // namespace

std::uint32_t Scene::add_points(const std::string& name, std::span<const CloudPoint> points, double voxel,
                                const BodyOptions& options) {
  const FpEnvironment environment;
  check_free(name, "body");
  Body body = body_from(name, options);
  const std::string who = "body \"" + name + "\": ";
  body.cloud_radius = options.radius;
  body.source = voxel > 0 ? "voxels" : "cloud";
  try {
    body.voxel = voxel_of(voxel);
    put_points(body, points.empty() ? nullptr : make_cloud_piece(points, body.voxel, options.radius));
  } catch (const std::invalid_argument& e) {
    throw SceneError(who + e.what());
  }
  if (points.empty() && options.is_live) body.cloud = CloudState::kAwaited;
  return add_body(std::move(body));
}

Scene Scene::with_points(std::uint32_t id, const PiecePtr& cloud) const {
  const FpEnvironment environment;
  Scene next = without_memory();
  put_points(next.bodies_.at(id), cloud);
  next.grow(next.bodies_[id], false);
  next.has_uncertainties_ = std::ranges::any_of(next.bodies_, has_uncertainty);
  if (by_pieces_) next.by_pieces_ = std::make_shared<const Scene>(by_pieces_->with_points(id, cloud));
  return next;
}

std::uint64_t point_count(const Body& body) {
  return body.cloud == CloudState::kPoints ? body.pieces[0]->surface->size() : 0;
}

}  // namespace clearance
