// A query in C++, the same for a client of the daemon and for an engine in the process.
#pragma once

#if __cplusplus < 202002L
#error "Clearance needs C++20: -std=c++20, or in CMake target_compile_features(TARGET PRIVATE cxx_std_20)"
#endif

#include <clearance/query_options.h>
#include <clearance/types.h>

#include <array>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>

// Marks the exported symbols of installed shared libraries.
#ifdef CLEARANCE_STATIC
#define CLEARANCE_API
#else
#define CLEARANCE_API __attribute__((visibility("default")))
#endif

namespace clearance {

/// x, y, z, qw, qx, qy, qz; metres. X_wb, or X_parent_body for a body with a parent.
using Pose7 = std::array<double, 7>;
/// Angular velocity, then velocity of the body's origin, world axes; of a body with a parent, relative to it. rad/s, m/s.
using Twist6 = std::array<double, 6>;
/// Body ids, or group selectors (types.h).
using IdPair = std::array<std::uint32_t, 2>;

struct Query {
  std::span<const IdPair> pairs = {};          ///< the pairs; if empty, see all_pairs
  bool all_pairs = true;                       ///< whether an empty `pairs` means all enabled pairs, or none
  std::span<const std::uint32_t> bodies = {};  ///< (M,) moved bodies
  std::span<const Pose7> configurations = {};  ///< (K * M,) their poses; empty for the current poses
  std::span<const std::uint32_t> joints = {};  ///< (J,) moved joints, by id
  std::span<const double> positions = {};      ///< (K * J,) radians and metres; other joints keep their positions
  /// max_distance, reduce, ...: one member for each row of the table in query_options.h, which describes it.
  CLEARANCE_QUERY_OPTIONS(CLEARANCE_OPTION_MEMBER)
  /// Replaces `margin` in Reduce::kAny: margins of pairs of bodies and groups, where later entries win, or (P,) margins
  /// of each pair.
  std::span<const MarginEntry> margins = {};
  std::span<const double> pair_margins = {};
  /// For kFieldFreeScale: (J,) radians and metres >= 0, joint motions at a scale of 1.
  std::span<const double> weights = {};
  /// For motions: (K * M,) metres >= 0 by which the moved bodies are grown on all sides, along with their poses, as a
  /// person is who may be anywhere in a ball that grows; empty for none.
  std::span<const double> growths = {};
  /// For kFieldRate and kFieldCurvature: (K * J,) speeds of the joints, rad/s and m/s, and (K * M * 6,) twists of the
  /// bodies: rad/s, and m/s of the origin, world axes. Empty for 0.
  std::span<const double> velocities = {};
  std::span<const double> twists = {};
  /// For kFieldRateBounds: (J + 2 M,) bounds >= 0 on the errors of these: of the joints, rad/s and m/s, then of each body
  /// rad/s and m/s. Empty for none.
  std::span<const double> speed_errors = {};
  bool check_scene = true;  ///< whether to reject an answer for another scene than the client's
};

/// Number of configurations, or 0 for the current poses. Throws std::invalid_argument unless poses and positions are
/// whole numbers of configurations, and the same number.
inline std::uint64_t configuration_count(const Query& query) {
  const auto count = [](const char* what, std::size_t given, std::size_t each, const char* of) -> std::uint64_t {
    if (each == 0 ? given == 0 : given % each == 0 && given > 0) return each ? given / each : 0;
    throw std::invalid_argument("query: " + std::to_string(given) + " " + what +
                                " are not a whole number of configurations of " + std::to_string(each) + " " + of);
  };
  const std::uint64_t of_bodies = count("poses", query.configurations.size(), query.bodies.size(), "bodies"),
                      of_joints = count("positions", query.positions.size(), query.joints.size(), "joints");
  if (of_bodies && of_joints && of_bodies != of_joints)
    throw std::invalid_argument("query: " + std::to_string(of_bodies) + " configurations of bodies and " +
                                std::to_string(of_joints) + " of joints: expected equal numbers");
  return of_bodies ? of_bodies : of_joints;
}

}  // namespace clearance
