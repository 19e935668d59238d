// A query's payload as the engine reads it, and the limits of one query.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/engine.h"
#include "engine/narrow/work_meter.h"
#include "wire/wire.h"

namespace clearance {

/// Returns the engine's view of a query whose payload begins on a multiple of 8.
QueryView view_of(const wire::QueryParts& parts, std::uint64_t scene_revision);

/// Returns a payload whose first byte lies on a multiple of 8: the given one, or a copy in `copy`.
std::span<const std::byte> aligned(std::span<const std::byte> payload, std::vector<std::uint64_t>& copy);

struct QueryLimits {
  std::uint64_t max_pairs = 10'000'000'000;           ///< pairs times configurations, kTooLarge beyond it
  std::uint64_t max_part_pairs = 10'000'000'000'000;  ///< pairs of convex parts, likewise
  /// Of the one slice on the loop. Counted in work, not time, so that the machine's load does not matter.
  WorkBudget on_loop{.units = 4096, .pair_units = 1024};
  /// The same for motions, and for a query of the class planning where clients of the class control exist.
  WorkBudget on_loop_briefly{.units = 512, .pair_units = 256};
  bool has_control = false;  ///< clients may have that class

  /// Throw RejectedRequest (kTooLarge): before pairs are listed, and afterwards.
  void check(const QueryCost& cost) const;
  void check(const QuerySize& size) const;
};

}  // namespace clearance
