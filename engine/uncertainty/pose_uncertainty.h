// Uncertainty of the placed bodies of a scene: declared by the user, from their shapes, from the rounding of chained
// poses, and from the age of poses (docs/trust/bounds_bodies.md, "Slack").
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/scene.h"
#include "engine/state/pose_store.h"
#include "engine/uncertainty/uncertainty_step.h"

namespace clearance {

/// A body placed by joints, with the source of its rounding errors.
struct PlacedLink {
  const LinkErrors* errors = nullptr;  ///< of its robot; null if the body is no link
  std::uint32_t link = 0;
  double travel = 0;  ///< Kinematics::travels()
};

/// Uncertainty of a placed body.
struct PoseUncertainty : PlacedUncertainty {
  PlacedLink link;
};

/// Uncertainty that a body contributes itself, wherever it is placed.
UncertaintySource uncertainty_source(const Body& body);
/// Uncertainty of a link's pose in its root's frame; zero if the body is no link.
FrameUncertainty joints_of(const PlacedLink& link);

/// \param local its pose as given
/// \param t_w its origin in the world, as computed
/// \param age_s age of that pose, in seconds
/// \param parent the body that it follows, or null
/// \param composed whether its pose was composed with the parent's, and rounded
/// \param link the link whose joints made `local`
PoseUncertainty uncertainty_of(const Body& body, const Pose& local, const Vec3d& t_w, double age_s,
                               const PoseUncertainty* parent, bool composed, const PlacedLink& link = {});

/// Age of a body's points in seconds since they were received, or 0 if none were.
double points_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns);
/// Age at `now_ns` (monotonic_ns()) of a body's pose, or of its points if they are older, in seconds. Counts from the
/// receipt, or from the load of the scene for a pose that the scene gives.
double pose_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns);

/// Uncertainty of each body of a snapshot at `now_ns`; empty if no body has any.
std::vector<PoseUncertainty> uncertainties_of(const engine::Scene& scene, const PoseSnapshot& snapshot,
                                              std::int64_t now_ns);

}  // namespace clearance
