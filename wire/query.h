// A query as C++ callers write it, the same for a client of the daemon and for an engine of their own.
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
#include <vector>

// Installed shared libraries show what is marked so, and nothing else.
#ifdef CLEARANCE_STATIC
#define CLEARANCE_API
#else
#define CLEARANCE_API __attribute__((visibility("default")))
#endif

namespace clearance {

/// x, y, z, qw, qx, qy, qz; metres. X_wb, or X_parent_body for a body with a parent.
using Pose7 = std::array<double, 7>;
/// Body ids, or group selectors (types.h).
using IdPair = std::array<std::uint32_t, 2>;

struct Query {
  std::span<const IdPair> pairs = {};          ///< empty: all enabled pairs, or none
  bool all_pairs = true;                       ///< what empty `pairs` means; with pairs it is not read
  std::span<const std::uint32_t> bodies = {};  ///< (M,) moved bodies
  std::span<const Pose7> configurations = {};  ///< (K * M,) their poses; empty: the current poses
  std::span<const std::uint32_t> joints = {};  ///< (J,) moved joints, by id
  std::span<const double> positions = {};      ///< (K * J,) radians and metres; other joints stay as they are
  /// max_distance, reduce, ...: one member for each row of the table in query_options.h, which says what it is for.
  CLEARANCE_QUERY_OPTIONS(CLEARANCE_OPTION_MEMBER)
  /// Reduce::kAny, in place of `margin`: of pairs of bodies and groups, later entries win; or (P,) one of each pair.
  std::span<const MarginEntry> margins = {};
  std::span<const double> pair_margins = {};
  std::span<const double> weights =
      {};                   ///< kFieldFreeScale: (J,) radians and metres >= 0 that joints go at a scale of 1
  bool check_scene = true;  ///< refuse an answer for another scene than the one this client fetched
};

/// K: how many configurations it has; 0: none, it is about the current poses. Throws std::invalid_argument for poses
/// and positions that are no whole number of configurations, or not the same.
inline std::uint64_t configuration_count(const Query& query) {
  const auto count = [](const char* what, std::size_t given, std::size_t each, const char* of) -> std::uint64_t {
    if (each == 0 ? given == 0 : given % each == 0 && given > 0) return each ? given / each : 0;
    throw std::invalid_argument("query: " + std::to_string(given) + " " + what +
                                " are no whole number of configurations of " + std::to_string(each) + " " + of);
  };
  const std::uint64_t of_bodies = count("poses", query.configurations.size(), query.bodies.size(), "bodies"),
                      of_joints = count("positions", query.positions.size(), query.joints.size(), "joints");
  if (of_bodies && of_joints && of_bodies != of_joints)
    throw std::invalid_argument("query: " + std::to_string(of_bodies) + " configurations of bodies and " +
                                std::to_string(of_joints) + " of joints: expected as many");
  return of_bodies ? of_bodies : of_joints;
}

/// A joint's limits, radians or metres; infinite: none.
struct JointLimits {
  double lower, upper;
};

/// A joint that is beyond its limits.
struct LimitViolation {
  std::uint64_t configuration;
  std::uint32_t joint;  ///< id
  double position;      ///< radians or metres
  JointLimits limits;
  /// How far beyond, above 0.
  double excess() const { return position < limits.lower ? limits.lower - position : position - limits.upper; }
};

/// Which configurations are free: (K,) each, 1 without configurations. Distances do not depend on joint limits, nor
/// does `free`; ok() does.
struct Check {
  std::vector<bool> free;  ///< every pair is proved farther than its margin
  std::vector<Status>
      status;                ///< kBeyond: free; kOk, kContact, kOverlap: `pair` is within; else nothing is proved of it
  std::vector<IdPair> pair;  ///< kNone where it is free
  std::vector<double> lower, upper;  ///< metres, of `pair`
  /// A joint of the query is beyond its limits; without configurations, a joint of the scene.
  std::vector<bool> beyond_limits;
  std::vector<LimitViolation> limit_violations;  ///< in the order of configurations

  /// Whether configuration `k` is free, and within the joints' limits.
  bool ok(std::size_t k) const { return free[k] && !beyond_limits[k]; }
  /// Whether all are.
  explicit operator bool() const {
    for (std::size_t k = 0; k < free.size(); ++k)
      if (!ok(k)) return false;
    return true;
  }
};

/// A query as check() asks it.
inline Query as_check(Query query) {
  query.reduce = Reduce::kAny;
  query.format = Format::kFull;
  query.fields = kFieldLower | kFieldUpper | kFieldStatus;
  return query;
}
/// A query as free_scale() asks it. \param weights must stay until it is answered
inline Query as_free_scale(Query query, std::span<const double> weights) {
  query.reduce = Reduce::kAny;
  query.format = Format::kFull;
  query.fields = kFieldFreeScale;
  query.weights = weights;
  return query;
}
/// What the answer to as_check() says.
/// \param limits (J,) of the joints
template <class Answer>
Check check_of(const Answer& answer, std::span<const std::uint32_t> joints, std::span<const JointLimits> limits,
               std::span<const double> positions) {
  Check check;
  for (std::size_t k = 0; k < answer.rows(); ++k) {
    check.free.push_back(answer.status()[k] == Status::kBeyond);
    check.status.push_back(answer.status()[k]);
    check.pair.push_back(answer.pair()[k]);
    check.lower.push_back(answer.lower()[k]);
    check.upper.push_back(answer.upper()[k]);
    check.beyond_limits.push_back(false);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const double position = positions[k * joints.size() + j];
      if (!(position < limits[j].lower || position > limits[j].upper)) continue;
      check.beyond_limits[k] = true;
      check.limit_violations.push_back({k, joints[j], position, limits[j]});
    }
  }
  return check;
}

}  // namespace clearance
