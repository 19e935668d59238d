// Two bodies, or what selects them.
#pragma once

#include <compare>
#include <cstdint>

#include "wire/types.h"

namespace clearance {

/// Two selectors: body ids, or groups (see kGroupBit, kEveryBody). An answered pair always holds two body ids.
struct BodyPair {
  std::uint32_t a = kNone;
  std::uint32_t b = kNone;
  friend bool operator==(const BodyPair&, const BodyPair&) = default;
  friend auto operator<=>(const BodyPair&, const BodyPair&) = default;
};
static_assert(sizeof(BodyPair) == 8);

}  // namespace clearance
