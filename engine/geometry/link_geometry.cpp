#include "engine/geometry/link_geometry.h"

#include <algorithm>
#include <cmath>

#include "engine/base/slack.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/hull.h"
#include "engine/robot/exact_frame.h"

namespace clearance {

namespace {

bool is_zero(const Vec3d& v) {
  return v.x == 0 && v.y == 0 && v.z == 0;
}

// Transforms points to another frame, with each coordinate rounded once.
class PointMover {
 public:
  explicit PointMover(const Origin& X) : X_(exact_frame(X)) {}
  Vec3d operator()(const Vec3d& p) {
    double off = 0;
    const Vec3d at = rounded(X_.t + turned(X_.q, cast<DoubleDouble>(p)), &off);
    worst_ = std::max(worst_, off + 0x1p-90 * (norm(at) + norm(p)));  // covers the rounding of double-double
    return at;
  }
  double worst() const { return worst_ * (1 + 0x1p-40); }

 private:
  static double norm(const Vec3d& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }
  ExactFrame X_;
  double worst_ = 0;  // bound on the rounding of a point, in metres
};

}  // namespace

Geometry moved(const Geometry& geometry, const Origin& X) {
  if (is_zero(X.xyz) && is_zero(X.rpy)) return geometry;
  PointMover mover(X);
  Geometry out = geometry;
  const auto all_of = [&mover](std::span<const Vec3d> points) {
    std::vector<Vec3d> there;
    there.reserve(points.size());
    for (const Vec3d& p : points) there.push_back(mover(p));
    return there;
  };
  for (ConvexPartPtr& convex_part : out.parts)
    if (const Surface* surface = convex_part->surface.get())  // a new hull: rounding may have moved inner vertices out
      convex_part = make_surface_part(all_of(surface->vertices()), triangles_as_loaded(*surface), surface->is_solid(),
                                      convex_part->radius, convex_part->loaded_vertices);
    else
      convex_part =
          make_hull_part(all_of(convex_part->vertices), {}, convex_part->radius, convex_part->loaded_vertices);
  out.model_error += mover.worst();
  out.model_inner += mover.worst();
  if (out.display) {
    auto display = std::make_shared<DisplayMesh>(*out.display);
    display->vertices = all_of(display->vertices);
    out.display = std::move(display);
  }
  return out;
}

Geometry joined(std::vector<Geometry> parts) {
  if (parts.size() == 1) return std::move(parts[0]);
  Geometry out;
  auto display = std::make_shared<DisplayMesh>();
  for (const Geometry& part : parts) {
    out.parts.insert(out.parts.end(), part.parts.begin(), part.parts.end());
    out.model_error = std::max(out.model_error, part.model_error);
    out.model_inner = std::max(out.model_inner, part.model_inner);
    out.source += (out.source.empty() ? "" : " + ") + part.source;
    if (part.hull_excess > out.hull_excess) {
      out.hull_excess = part.hull_excess;
      out.empty_share = part.empty_share;
    }
    if (!part.display) continue;
    const auto base = static_cast<std::uint32_t>(display->vertices.size());
    display->vertices.insert(display->vertices.end(), part.display->vertices.begin(), part.display->vertices.end());
    for (const Triangle& t : part.display->triangles)
      display->triangles.push_back({base + t[0], base + t[1], base + t[2]});
  }
  if (!display->triangles.empty()) out.display = std::move(display);
  return out;
}

}  // namespace clearance
