#include "engine/hull/qhull_guess.h"

#include <algorithm>
#include <cstdio>
#include <memory>

extern "C" {
#include <libqhull_r/qhull_ra.h>
}

namespace clearance {

namespace {

// Centred, and each axis scaled to [-1, 1]: the same hull, without extreme aspect ratios or offsets that Qhull handles
// badly. Empty if all points share a coordinate.
std::vector<coordT> normalised(std::span<const Vec3d> points) {
  Vec3d low = points[0], high = points[0];
  for (const Vec3d& v : points)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], v[k]);
      high[k] = std::max(high[k], v[k]);
    }
  const Vec3d centre = 0.5 * low + 0.5 * high, half = 0.5 * high - 0.5 * low;
  std::vector<coordT> out;
  for (int k = 0; k < 3; ++k)
    if (!(half[k] > 0)) return out;
  out.reserve(3 * points.size());
  for (const Vec3d& v : points)
    for (int k = 0; k < 3; ++k) out.push_back((v[k] - centre[k]) / half[k]);
  return out;
}

}  // namespace

std::vector<Triangle> qhull_triangles(std::span<const Vec3d> points) {
  std::vector<Triangle> out;
  if (points.size() < 4) return out;
  std::vector<coordT> coordinates = normalised(points);
  if (coordinates.empty()) return out;
  const std::unique_ptr<FILE, int (*)(FILE*)> nowhere(std::fopen("/dev/null", "w"), &std::fclose);
  if (!nowhere) return out;

  qhT state;
  qhT* const qh = &state;
  qh_zero(qh, nowhere.get());
  char command[] = "qhull Qt Pp";
  const int failed =
      qh_new_qhull(qh, 3, static_cast<int>(points.size()), coordinates.data(), False, command, nullptr, nowhere.get());
  if (!failed) {
    facetT* facet;
    FORALLfacets {
      Triangle t{};
      int corners = 0;
      vertexT *vertex, **vertexp;
      FOREACHvertex_(facet->vertices) if (corners < 3) t[corners++] =
          static_cast<std::uint32_t>(qh_pointid(qh, vertex->point));
      const auto inside = [&](std::uint32_t i) { return i < points.size(); };
      if (corners != 3 || !std::all_of(t.begin(), t.end(), inside)) continue;
      const auto at = [&](std::uint32_t i) {
        return Vec3d{coordinates[3 * i], coordinates[3 * i + 1], coordinates[3 * i + 2]};
      };
      const Vec3d normal = cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0]));
      if (normal.x * facet->normal[0] + normal.y * facet->normal[1] + normal.z * facet->normal[2] < 0)
        std::swap(t[1], t[2]);
      out.push_back(t);
    }
  }
  qh_freeqhull(qh, !qh_ALL);
  int current, total;
  qh_memfreeshort(qh, &current, &total);
  return out;
}

}  // namespace clearance
