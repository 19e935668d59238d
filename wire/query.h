// A query as C++ callers write it, the same for a client of the daemon and for an engine of their own.
#pragma once

#include <clearance/query_options.h>
#include <clearance/types.h>

#include <array>
#include <cstdint>
#include <span>

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
  bool check_scene = true;  ///< refuse an answer for another scene than the one this client fetched
};

}  // namespace clearance
