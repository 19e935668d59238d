#include "engine/evaluate/round_feature.h"

#include <algorithm>
#include <cmath>

namespace clearance {

namespace {

using Patch = RoundPatch::Kind;

constexpr double kNear = 1e-3;  // angle within which a start may be on the wrong patch

// A unit vector from the axis to a point.
Vec3d outward_at(const Vec3d& point) {
  const double length = std::hypot(point.x, point.y);
  return length > 0 ? Vec3d{point.x / length, point.y / length, 0} : Vec3d{1, 0, 0};
}

// Unit vector along a side, in the half-plane of `e`, towards +z.
Vec3d along_side(const Primitive& core, const Vec3d& e) {
  if (core.kind == Primitive::Kind::kCylinder) return {0, 0, 1};
  const double length = std::hypot(core.size.x, 2 * core.size.z);
  return e * (-core.size.x / length) + Vec3d{0, 0, 2 * core.size.z / length};
}

Vec3d over(const Vec3d& v, const Vec3d& axes) {
  return {v.x / (axes.x * axes.x), v.y / (axes.y * axes.y), v.z / (axes.z * axes.z)};
}

Feature on_ellipsoid(const Primitive& core, const Vec3d& point, const Vec3d& n) {
  const Vec3d up = over(point, core.size);
  Feature f = plane_feature(up * (1 / norm(up)));
  const double height = dot(n, point);
  if (!(height > 0)) f.interior = -1;
  for (int k = 0; k < 3; ++k) f.bend[k] = height * dot(f.tangent[k == 2], over(f.tangent[k > 0], core.size));
  return f;
}

// Distance over which the direction stays within the normals of an edge that these two tangents lead away from.
double wedge(const Vec3d& n, const Vec3d& first, const Vec3d& second, double arm) {
  return -arm * std::max(dot(n, first), dot(n, second));
}

}  // namespace

std::span<const RoundPatch> patches_along(const Primitive& core, const Vec3d& n, RoundPatch (&out)[4]) {
  const bool is_cone = core.kind == Primitive::Kind::kCone;
  if (core.kind == Primitive::Kind::kEllipsoid) {
    out[0] = {};
    return {out, 1};
  }
  const Vec3d e = outward_at(n);
  const double side = dot(n, along_side(core, e));  // 0 on the side
  const int end = is_cone || n.z < 0 ? -1 : 1;
  const RoundPatch disc{Patch::kDisc, end}, rim{Patch::kRim, end}, flank{Patch::kSide, 1}, apex{Patch::kApex, 1};
  const bool is_flat = std::hypot(n.x, n.y) < kNear && (!is_cone || n.z < 0);
  if (is_cone && side > kNear) {
    out[0] = apex, out[1] = flank, out[2] = rim, out[3] = disc;
    return {out, 4};
  }
  out[0] = is_flat ? disc : std::abs(side) < kNear ? flank : rim;
  out[1] = is_flat ? rim : std::abs(side) < kNear ? rim : flank;
  out[2] = is_flat ? flank : disc;
  out[3] = apex;
  return {out, is_cone ? 4u : 3u};
}

Vec3d onto_patch(const Primitive& core, const RoundPatch& patch, const Vec3d& point) {
  const Vec3d& size = core.size;
  const Vec3d e = outward_at(point);
  switch (patch.kind) {
    case Patch::kDisc:
      return {point.x, point.y, patch.end * size.z};
    case Patch::kRim:
      return e * size.x + Vec3d{0, 0, patch.end * size.z};
    case Patch::kApex:
      return {0, 0, size.z};
    case Patch::kSide: {
      const Vec3d foot = e * size.x - Vec3d{0, 0, size.z}, along = along_side(core, e);
      return foot + along * dot(along, point - foot);
    }
    case Patch::kWhole:
      break;
  }
  return point * (1 / std::sqrt(dot(point, over(point, size))));
}

Feature feature_on(const Primitive& core, const RoundPatch& patch, const Vec3d& point, const Vec3d& n,
                   double distance) {
  const Vec3d& size = core.size;
  const Vec3d e = outward_at(patch.kind == Patch::kApex ? n : point), round{-e.y, e.x, 0};
  const Vec3d along = along_side(core, e);
  Feature f;
  switch (patch.kind) {
    case Patch::kDisc:
      f.size = 2;
      f.tangent[0] = {1, 0, 0}, f.tangent[1] = {0, 1, 0};
      f.interior = n.z * patch.end > 0 ? size.x - std::hypot(point.x, point.y) : -1;
      break;
    case Patch::kRim:
      f.size = 1;
      f.tangent[0] = round;
      f.bend[0] = dot(n, e) / size.x;
      f.interior = wedge(n, -e, along * -double(patch.end), std::min(distance, size.x));
      break;
    case Patch::kApex:
      f.interior = wedge(n, -along, -along, std::min(distance, size.x));
      break;
    case Patch::kSide: {
      const double radius = std::hypot(point.x, point.y), length = 2 * size.z / along.z;
      const double at = dot(along, point - (e * size.x - Vec3d{0, 0, size.z}));
      f.size = 2;
      f.tangent[0] = round, f.tangent[1] = along;
      f.bend[0] = dot(n, e) / radius;
      f.interior = dot(n, e) > 0 ? std::min(at, length - at) : -1;
      break;
    }
    case Patch::kWhole:
      return on_ellipsoid(core, point, n);
  }
  return f;
}

}  // namespace clearance
