// What is not known of the bodies of a scene where they stand: from what their user says, their shapes, the rounding of
// poses that follow one another, and the age of poses (docs/bounds.md, "Slack").
#pragma once

#include <cstdint>
#include <vector>

#include "engine/base/slack.h"
#include "engine/scene/pose_store.h"
#include "engine/scene/scene.h"

namespace clearance {

/// How far a frame may be from where it was computed to be: no point that belongs to it, d metres from its origin, is
/// farther than shift + turn * d from its place.
struct FrameDoubt {
  double shift = 0, turn = 0;
};

/// What the slack of a body's pieces is made of, metres: lengths that add up to no more than it. Inner ones, but for
/// `placed`, which counts on both sides.
struct SlackParts {
  double age = 0;     ///< how far it may have got since its own pose was received, `age_s` ago
  double turn = 0;    ///< by its own uncertain turn
  double parent = 0;  ///< by what is doubted of that which it follows
  double placed = 0;  ///< by the rounding of joints and of poses that follow one another
  double step = 0;    ///< of `placed`: by the rounding of this body's own pose
  double age_s = 0;   ///< seconds
};

/// A body that joints place: what their rounding may come to.
struct PlacedLink {
  const LinkErrors* errors = nullptr;  ///< of its robot; null: no link
  std::uint32_t link = 0;
  double travel = 0;  ///< of the configuration: Kinematics::travel()
};

/// What is not known of a placed body.
struct BodyDoubt {
  FrameDoubt known;   ///< its frame, and all that follow it: by what the user knows and by the age of its pose
  FrameDoubt placed;  ///< by the rounding of joints and of poses that follow one another
  Slack slack;        ///< of its pieces
  SlackParts parts;   ///< beside what its shape adds: Body::model_inner, model_error
  PlacedLink link;
  Slack beside;  ///< of a link: without what moves all links on its root alike, and without the joints' rounding
};

/// \param local its pose as given. \param t_w its origin in the world, as computed. \param age_s of that pose, seconds.
/// \param parent of the body that it follows; null: none.
/// \param composed its pose was composed with that body's, and rounded. \param link whose joints made `local`
BodyDoubt doubt_of(const Body& body, const Pose& local, const Vec3d& t_w, double age_s, const BodyDoubt* parent,
                   bool composed, const PlacedLink& link = {});

/// How long ago a body's points were received, seconds; 0: none were.
double points_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns);
/// How old a body's pose, or its points if they are older, is at `now_ns` (monotonic_ns()), seconds: since the receipt,
/// or of a pose that the scene gives since that was loaded.
double pose_age_s(const PoseSnapshot& snapshot, std::uint32_t body, std::int64_t now_ns);

/// Of each body of a snapshot, as of `now_ns`; empty: nothing is doubted of any.
std::vector<BodyDoubt> doubts_of(const Scene& scene, const PoseSnapshot& snapshot, std::int64_t now_ns);

}  // namespace clearance
