// A query as C++ callers write it, the same for a client of the daemon and for an engine of their own.
#pragma once

#include <clearance/query_options.h>
#include <clearance/types.h>

#include <array>
#include <cstdint>
#include <span>
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
  /// max_distance, reduce, ...: one member for each row of the table in query_options.h, which says what it is for.
  CLEARANCE_QUERY_OPTIONS(CLEARANCE_OPTION_MEMBER)
  /// Reduce::kAny, in place of `margin`: of pairs of bodies and groups, later entries win; or (P,) one of each pair.
  std::span<const MarginEntry> margins = {};
  std::span<const double> pair_margins = {};
  bool check_scene = true;  ///< refuse an answer for another scene than the one this client fetched
};

/// Which configurations are free: (K,) each, 1 without configurations.
struct Check {
  std::vector<bool> free;  ///< every pair is proved farther than its margin
  std::vector<Status>
      status;                ///< kBeyond: free; kOk, kContact, kOverlap: `pair` is within; else nothing is proved of it
  std::vector<IdPair> pair;  ///< kNone where it is free
  std::vector<double> lower, upper;  ///< metres, of `pair`
};

/// A query as check() asks it.
inline Query as_check(Query query) {
  query.reduce = Reduce::kAny;
  query.format = Format::kFull;
  query.fields = kFieldLower | kFieldUpper | kFieldStatus;
  return query;
}
/// What its answer says.
template <class Answer>
Check check_of(const Answer& answer) {
  Check check;
  for (std::size_t k = 0; k < answer.rows(); ++k) {
    check.free.push_back(answer.status()[k] == Status::kBeyond);
    check.status.push_back(answer.status()[k]);
    check.pair.push_back(answer.pair()[k]);
    check.lower.push_back(answer.lower()[k]);
    check.upper.push_back(answer.upper()[k]);
  }
  return check;
}

}  // namespace clearance
