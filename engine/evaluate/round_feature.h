// Smooth patches of the surfaces of cones, cylinders and ellipsoids, as features that meet others.
#pragma once

#include <span>

#include "engine/evaluate/feature.h"
#include "engine/hull/primitive.h"

namespace clearance {

/// A smooth part of a round core's surface.
struct RoundPatch {
  enum class Kind : std::uint8_t { kDisc, kRim, kSide, kApex, kWhole };
  Kind kind = Kind::kWhole;
  int end = 1;  ///< of a disc or rim: the side of z = 0
};

/// The patches that may contain the farthest point along a direction, the likeliest first.
/// \param n unit, axes of the core
/// \param out at least four
std::span<const RoundPatch> patches_along(const Primitive& core, const Vec3d& n, RoundPatch (&out)[4]);

/// A point of the patch near a point, in axes of the core.
Vec3d onto_patch(const Primitive& core, const RoundPatch& patch, const Vec3d& point);

/// Tangents and curvature of the patch at a point of it, in axes of the core. `interior` is negative where another patch
/// has the point.
/// \param n unit, from the point to the other core
/// \param distance of the cores
Feature feature_on(const Primitive& core, const RoundPatch& patch, const Vec3d& point, const Vec3d& n, double distance);

}  // namespace clearance
