// Distance of two triangles, as the report of 2023 adopts it from PQP (E. Larsen): the minimum over all pairs of edges
// and all vertices against the other's face; 0 if an edge pierces the other triangle.
#pragma once

#include <algorithm>

#include "engine/base/vec.h"

namespace clearance::baselines {

/// Two points, and the square of their distance.
struct NearestPoints {
  double squared_distance;
  Vec3d a, b;
};

/// Nearest points of the segments p + s u and q + t v, s and t in [0, 1]. Either may be a point.
inline NearestPoints nearest_on_segments(const Vec3d& p, const Vec3d& u, const Vec3d& q, const Vec3d& v) {
  const auto clamped = [](double x) { return std::clamp(x, 0.0, 1.0); };
  const Vec3d r = q - p;
  const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), ur = dot(u, r), vr = dot(v, r);
  const double det = uu * vv - uv * uv;
  // The lines' nearest points: s is clamped to its segment, t follows from s, and s again if t was clamped.
  double s = det > 0 ? clamped((ur * vv - vr * uv) / det) : 0.0, t = 0;
  if (vv > 0) t = (s * uv - vr) / vv;
  if (!(t >= 0 && t <= 1)) {
    t = clamped(t);
    s = uu > 0 ? clamped((t * uv + ur) / uu) : 0.0;
  }
  const Vec3d a = p + s * u, b = q + t * v;
  return {squared_norm(b - a), a, b};
}

/// A triangle with the data shared by its pairs.
struct PreparedTriangle {
  Vec3d corner[3];
  Vec3d edge[3];  ///< from corner i to corner i + 1
  Vec3d normal;   ///< not of unit length
  double plane;   ///< dot(normal, x) of the points in its plane

  explicit PreparedTriangle(const Vec3d& a, const Vec3d& b, const Vec3d& c)
      : corner{a, b, c}, edge{b - a, c - b, a - c}, normal(cross(b - a, c - a)), plane(dot(normal, a)) {}

  /// Returns whether a point, projected along the normal onto the plane, is in the triangle.
  bool below(const Vec3d& x) const {
    for (int i = 0; i < 3; ++i)
      if (!(dot(cross(edge[i], x - corner[i]), normal) >= 0)) return false;
    return squared_norm(normal) > 0;
  }
};

/// Updates `best` with the nearest points of two triangles if they are nearer. Returns true if the triangles share a
/// point; best.squared_distance is then 0.
inline bool take_triangle_pair(const PreparedTriangle& s, const PreparedTriangle& t, NearestPoints& best) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const NearestPoints n = nearest_on_segments(s.corner[i], s.edge[i], t.corner[j], t.edge[j]);
      if (n.squared_distance < best.squared_distance) best = n;
    }
  const auto faces = [&](const PreparedTriangle& face, const PreparedTriangle& other, bool face_is_b) {
    double height[3];
    for (int i = 0; i < 3; ++i) height[i] = dot(face.normal, other.corner[i]) - face.plane;
    const double nn = squared_norm(face.normal);
    for (int i = 0; i < 3; ++i) {
      if (height[i] * height[i] < best.squared_distance * nn && face.below(other.corner[i])) {
        const Vec3d foot = other.corner[i] - face.normal * (height[i] / nn);
        best = {height[i] * height[i] / nn, face_is_b ? other.corner[i] : foot, face_is_b ? foot : other.corner[i]};
      }
      const double next = height[(i + 1) % 3];
      if ((height[i] < 0 && next > 0) || (height[i] > 0 && next < 0)) {  // the edge crosses the plane
        const Vec3d x = other.corner[i] + other.edge[i] * (height[i] / (height[i] - next));
        if (face.below(x)) {
          best = {0, x, x};
          return true;
        }
      }
    }
    return false;
  };
  return faces(t, s, true) || faces(s, t, false) || best.squared_distance == 0;
}

}  // namespace clearance::baselines
