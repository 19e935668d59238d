// Decisions about configurations and paths, and the queries that they are made from.
#pragma once

#include <clearance/query.h>
#include <clearance/result.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace clearance {

/// A joint's limits, radians or metres; infinite without a limit.
struct JointLimits {
  double lower, upper;
};

/// A joint beyond its limits.
struct LimitViolation {
  std::uint64_t configuration;
  std::uint32_t joint;  ///< id
  double position;      ///< radians or metres
  JointLimits limits;
  /// Distance beyond the limit, above 0.
  double excess() const { return position < limits.lower ? limits.lower - position : position - limits.upper; }
};

/// The free configurations: (K,) each, or 1 without configurations. `free` ignores joint limits, ok() includes them.
struct Check {
  std::vector<bool> free;  ///< whether every pair is proved farther than its margin
  /// kBeyond if free; kOk if `pair` is proved within its margin; otherwise the reason why nothing is proved.
  std::vector<Status> verdict;
  std::vector<IdPair> pair;  ///< kNone if free
  /// Whether a joint of the query, or without configurations of the scene, is beyond its limits.
  std::vector<bool> beyond_limits;
  std::vector<LimitViolation> limit_violations;  ///< in the order of configurations

  /// Whether configuration `k` is proved not to be free. If neither free nor hit, nothing is proved.
  bool hit(std::size_t k) const { return verdict[k] == Status::kOk; }
  /// Whether configuration `k` is free, and within the joints' limits.
  bool ok(std::size_t k) const { return free[k] && !beyond_limits[k]; }
  /// Whether all configurations are ok.
  explicit operator bool() const {
    for (std::size_t k = 0; k < free.size(); ++k)
      if (!ok(k)) return false;
    return true;
  }
};

/// Whether a whole path is free, or the first motion that is not proved free.
struct PathCheck {
  bool free = true;  ///< whether every pair is proved farther than its margin on every motion
  /// The first motion that is not free: from waypoint `index` to the next, or segment `index` of a curve.
  std::optional<std::uint64_t> index;
  double t = 0;  ///< 0 to 1 in that motion: time at which `pair` is within its margin, or at which the proof ends
  IdPair pair{kNone, kNone};  ///< bodies that are not proved free
  /// kBeyond if free; kOk, kContact, kOverlap: `pair` is proved within its margin at `t`. Otherwise there is no proof.
  Status status = Status::kBeyond;
  /// First waypoint or segment at which each joint is beyond its limits, in the order of joints. Independent of `free`.
  std::vector<LimitViolation> limit_violations;

  /// Whether a joint exceeds its limits. Straight motions are checked at their waypoints, curves throughout.
  bool beyond_limits() const { return !limit_violations.empty(); }
  /// Whether the path is proved not to be free. If neither free nor hit, nothing is proved.
  bool hit() const { return status <= Status::kContact; }
  /// Whether the whole path is free and within the joints' limits.
  bool ok() const { return free && !beyond_limits(); }
  explicit operator bool() const { return ok(); }
};

/// Maximum evaluations per motion of motions() and check_path() by default.
inline constexpr std::uint32_t kDefaultEvaluations = 256;

/// Converts a query to that of check().
inline Query as_check(Query query) {
  query.reduce = Reduce::kAny;
  query.fields = kFieldVerdict | kFieldPair;
  return query;
}
/// Converts a query to that of free_scale().
/// \param weights must outlive the query
inline Query as_free_scale(Query query, std::span<const double> weights) {
  query.reduce = Reduce::kAny;
  query.fields = kFieldFreeScale;
  query.weights = weights;
  return query;
}
/// Converts a query to that of motions(): sets options that have their default value. These are the maximum of
/// evaluations, the columns and, except for Reduce::kAny, the tolerance (1 mm). The columns are the default ones, flags,
/// pair and those of motions; of Reduce::kAny status, verdict, flags, pair and time, which need no longer search.
inline Query as_motions(Query query) {
  if (query.max_evaluations == 0) query.max_evaluations = kDefaultEvaluations;
  if (query.fields == kDefaultFields)
    query.fields = query.reduce == Reduce::kAny ? kFieldStatus | kFieldVerdict | kFieldFlags | kFieldPair | kFieldTime
                                                : kDefaultFields | kFieldFlags | kFieldPair | kMotionFields;
  if (query.reduce != Reduce::kAny && query.abs_tol == 0 && query.rel_tol < 0) {
    query.abs_tol = 1e-3;
    query.rel_tol = 0;
  }
  return query;
}

/// Converts the result of as_check(), with the limits of joints.
/// \param joints (J,) ids; empty to ignore limits
/// \param positions (K, J)
inline Check check_of(const Result& result, std::span<const std::uint32_t> joints = {},
                      std::span<const JointLimits> limits = {}, std::span<const double> positions = {}) {
  Check check;
  const std::size_t rows = result.rows();
  check.verdict.assign(result.verdict().begin(), result.verdict().end());
  check.pair.assign(result.pair().begin(), result.pair().end());
  check.free.resize(rows);
  check.beyond_limits.resize(rows);
  for (std::size_t k = 0; k < rows; ++k) {
    check.free[k] = check.verdict[k] == Status::kBeyond;
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
