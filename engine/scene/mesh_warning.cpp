#include "engine/scene/mesh_warning.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <map>
#include <utility>

#include "engine/bvh/enclosure.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/make_geometry.h"

namespace clearance {

namespace {

bool is_mesh(const Body& body) {
  return body.source.ends_with(')');  // mesh_source()
}

// Largest edge of the bounding box of a body's vertices, in metres.
double width(const Body& body) {
  double widest = 0;
  for (int k = 0; k < 3; ++k) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const ConvexPartPtr& part : body.parts)
      for (const Vec3d& v : part->vertices) {
        low = std::min(low, v[k]);
        high = std::max(high, v[k]);
      }
    widest = std::max(widest, high - low);
  }
  return widest;
}

bool is_large(const Body& body) {
  return is_mesh(body) && width(body) >= kLargeMesh;
}

bool stands_out(const Body& body) {
  double size = 0;
  for (const ConvexPartPtr& part : body.parts) size = std::max(size, part->spread + part->radius);
  return body.hull_excess > kHullExcessShare * size;
}

std::string units_warning(const Body& body) {
  if (!is_large(body)) return "";
  char text[160];
  std::snprintf(text, sizeof text,
                "its mesh is %.4g m wide: coordinates are metres, and a file in millimetres needs scale: 0.001",
                width(body));
  return text;
}

std::string hull_warning(const Body& body) {
  if (!stands_out(body)) return "";
  char text[200];
  const bool is_hull = body.parts.size() == 1;
  const char* what = is_hull ? "its hull stands" : "its convex parts stand";
  int n = std::snprintf(text, sizeof text, "%s up to %.3g m out of its mesh", what, body.hull_excess);
  if (body.empty_share > 0)
    n += std::snprintf(text + n, sizeof text - static_cast<std::size_t>(n), ", %.3g %% of it is empty",
                       100 * body.empty_share);
  std::string warning =
      std::string(text, static_cast<std::size_t>(n)) + ": distances are to the " + (is_hull ? "hull" : "convex parts");
  if (!body.display) return warning;
  const auto& [vertices, triangles] = *body.display;
  std::string why;
  if (const std::string edge = open_edge(vertices, triangles); !edge.empty())
    why = " encloses nothing: " + edge;
  else if (windings_may_cancel(vertices, triangles))
    if (const std::string place = hollow_place(Surface(vertices, triangles, true)); !place.empty())
      why = " is hollow: " + place;
  if (!why.empty()) warning += "; " + body.source + why + "; mesh_as: surface uses its triangles as they are";
  return warning;
}

}  // namespace

std::string mesh_warning(const Body& body) {
  std::string units = units_warning(body), hull = hull_warning(body);
  if (units.empty() || hull.empty()) return units + hull;
  return units + "; " + hull;
}

std::vector<MeshWarning> mesh_warnings(const engine::Scene& scene, std::uint32_t first) {
  std::vector<MeshWarning> warnings;
  std::map<std::pair<const DisplayMesh*, const ConvexPart*>, std::string> known;
  for (std::uint32_t id = first; id < scene.bodies().size(); ++id) {
    const Body& body = scene.bodies()[id];
    if (!stands_out(body) && !is_large(body)) continue;
    const auto [at, fresh] = known.try_emplace({body.display.get(), body.parts[0].get()});
    if (fresh) at->second = mesh_warning(body);
    warnings.push_back({id, at->second});
  }
  return warnings;
}

}  // namespace clearance
