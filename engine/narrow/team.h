// Who works on something together: a thread alone, or on a device the threads of a warp (engine/cuda/pair/warp_team.cuh).
// All of a team go the same way and hold the same values, but for what each looks at in a list that they share out.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/vec.h"

namespace clearance {

/// What was found in a list, and where.
template <class T>
struct Ranked {
  T value;
  std::uint32_t index;
};

/// A team of one.
struct OneThread {
  static constexpr std::uint32_t kSize = 1;
  CLEARANCE_HD static std::uint32_t rank() { return 0; }
  /// After it all see what each has written.
  CLEARANCE_HD static void sync() {}
  CLEARANCE_HD static bool all(bool x) { return x; }
  CLEARANCE_HD static bool any(bool x) { return x; }
  /// The best of what each brings, a value and a bool `before(p, q)`: the same for all.
  template <class T, class Before>
  CLEARANCE_HD static Ranked<T> best(const Ranked<T>& mine, const Before&) {
    return mine;
  }
  /// Appends what each brings if it is wanted, in the order of ranks. Writes behind the list's end, too.
  CLEARANCE_HD static void append(std::uint32_t* list, std::size_t& count, std::uint32_t value, bool wanted) {
    list[count] = value;
    count += wanted;
  }
  /// What one of them does for all. \returns its number
  template <class Work>
  CLEARANCE_HD static std::uint32_t lead(const Work& work) {
    return work();
  }
};

}  // namespace clearance
