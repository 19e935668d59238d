// Exact geometry of bodies, and sharing and growth of their convex parts.
#include <algorithm>

#include "engine/base/slack.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/primitive.h"
#include "engine/scene/scene.h"

namespace clearance {

bool has_surface(const Body& body) {
  return is_cloud(body) || surface_of(body) != nullptr;
}

bool has_uncertainty(const Body& body) {
  return body.model_error > 0 || body.model_inner > 0 || body.uncertainty.position > 0 || body.uncertainty.angle > 0 ||
         body.max_speed > 0;
}

const Surface* surface_of(const Body& body) {
  for (const ConvexPartPtr& part : body.parts)
    if (part->surface) return part->surface.get();
  return nullptr;
}

std::uint64_t triangle_count(const Body& body) {
  std::uint64_t count = 0;
  for (const ConvexPartPtr& part : body.parts)
    if (part->surface) count += part->surface->triangles().size();  // a cloud has none
  return count;
}

std::uint64_t point_count(const Body& body) {
  return body.cloud == CloudState::kPoints ? body.parts[0]->surface->size() : 0;
}

std::string placed_by_joints(const Body& body) {
  return "'" + body.name + "' is a link placed by joints: set their positions, or the pose of its robot's base";
}

namespace {

// Whether two parts have the same exact geometry: themselves, or equal surfaces.
bool same_exact_value(const ConvexPart& a, const ConvexPart& b) {
  if (!a.surface || !b.surface) return a.surface == b.surface;
  const auto same_vertex = [](const Vec3d& p, const Vec3d& q) { return p.x == q.x && p.y == q.y && p.z == q.z; };
  const Surface &s = *a.surface, &t = *b.surface;
  return s.kind() == t.kind() && s.edge() == t.edge() && std::ranges::equal(s.points(), t.points()) &&
         std::ranges::equal(s.vertices(), t.vertices(), same_vertex) &&
         std::ranges::equal(s.triangles(), t.triangles()) && std::ranges::equal(s.places(), t.places());
}

}  // namespace

// Shares one part among bodies of the same shape: this saves memory, and their pairs can share lanes.
ConvexPartPtr engine::Scene::shared_part(const ConvexPartPtr& part) {
  const auto same = [](const Vec3d& p, const Vec3d& q) { return p.x == q.x && p.y == q.y && p.z == q.z; };
  const auto [begin, end] = parts_.equal_range(part->digest);
  for (auto it = begin; it != end; ++it) {
    const ConvexPart& known = *it->second;
    if (known.radius == part->radius && known.loaded_vertices == part->loaded_vertices &&
        std::equal(known.vertices.begin(), known.vertices.end(), part->vertices.begin(), part->vertices.end(), same) &&
        same_exact_value(known, *part) && same_primitive(known, *part))
      return it->second;
  }
  parts_.emplace(part->digest, part);
  return part;
}

// Adds padding and the uncertainty of position to the radius of the parts, which is exact but for the rounding of the
// sum.
void engine::Scene::grow(Body& body, bool shares_parts) {
  const double by = body.is_grown ? 0 : sum_above(body.padding, body.uncertainty.position);
  double rounding = 0;
  for (ConvexPartPtr& part : body.parts) {
    if (by > 0) {
      const double radius = sum_above(by, part->radius);
      const bool is_exact = (part->radius == 0) + (body.padding == 0) + (body.uncertainty.position == 0) >= 2;
      if (!is_exact) rounding = std::max(rounding, radius * 0x1p-50);
      part = with_radius(*part, radius);
      if (shares_parts) part = shared_part(part);
    }
    body.reach = std::max(body.reach, (part->rho + part->radius) * (1 + 0x1p-50));
  }
  body.model_error = sum_above(body.model_error, rounding);
  body.model_inner = sum_above(body.model_inner, rounding);
  body.is_grown = true;
}

}  // namespace clearance
