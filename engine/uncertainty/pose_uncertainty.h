// What is not known of the bodies of a scene where they stand: from what their user says, their shapes, the rounding of
// poses that follow one another, and the age of poses (docs/bounds.md, "Slack").
#pragma once

#include <cstdint>
#include <vector>

#include "engine/scene/scene.h"
#include "engine/state/pose_store.h"
#include "engine/uncertainty/uncertainty_step.h"

namespace clearance {

/// A body that joints place: what their rounding may come to.
struct PlacedLink {
  const LinkErrors* errors = nullptr;  ///< of its robot; null: no link
  std::uint32_t link = 0;
  double travel = 0;  ///< Kinematics::travels()
};

/// What is not known of a placed body.
struct PoseUncertainty : PlacedUncertainty {
  PlacedLink link;
};

/// What a body adds of its own to what is doubted.
UncertaintySource uncertainty_source(const Body& body);
/// What is doubted of where joints put a link in its root's frame; nothing where it is none.
FrameUncertainty joints_of(const PlacedLink& link);

/// \param local its pose as given. \param t_w its origin in the world, as computed. \param age_s of that pose, seconds.
/// \param parent of the body that it follows; null: none.
/// \param composed its pose was composed with that body's, and rounded. \param link whose joints made `local`
PoseUncertainty uncertainty_of(const Body& body, const Pose& local, const Vec3d& t_w, double age_s,
                               const PoseUncertainty* parent, bool composed, const PlacedLink& link = {});

/// How long ago a body's points were received, seconds; 0: none were.
double points_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns);
/// How old a body's pose, or its points if they are older, is at `now_ns` (monotonic_ns()), seconds: since the receipt,
/// or of a pose that the scene gives since that was loaded.
double pose_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns);

/// Of each body of a snapshot, as of `now_ns`; empty: nothing is doubted of any.
std::vector<PoseUncertainty> uncertainties_of(const Scene& scene, const PoseSnapshot& snapshot, std::int64_t now_ns);

}  // namespace clearance
