// A pair of bodies or selectors.
#pragma once

#include <compare>
#include <cstdint>

#include "wire/types.h"

namespace clearance {

/// Two selectors: body ids, or groups (see kGroupBit, kEveryBody). In an answer, always two body ids.
struct BodyPair {
  std::uint32_t a = kNone;
  std::uint32_t b = kNone;
  friend bool operator==(const BodyPair&, const BodyPair&) = default;
  friend auto operator<=>(const BodyPair&, const BodyPair&) = default;
};
static_assert(sizeof(BodyPair) == 8);

}  // namespace clearance
