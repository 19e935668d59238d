// Threads that share a computation: a single one, or on a device those of a warp (engine/cuda/pair/warp_team.cuh). All
// threads of a team take the same branches and hold the same values, apart from their own share of a list.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/vec.h"

namespace clearance {

/// A value found in a list, and its index.
template <class T>
struct Ranked {
  T value;
  std::uint32_t index;
};

/// A team of one.
struct OneThread {
  static constexpr std::uint32_t kSize = 1;
  CLEARANCE_HD static std::uint32_t rank() { return 0; }
  /// Makes all earlier writes visible to the team.
  CLEARANCE_HD static void sync() {}
  CLEARANCE_HD static bool all(bool x) { return x; }
  CLEARANCE_HD static bool any(bool x) { return x; }
  /// The best of all threads' values, the same for all.
  /// \param before returns, as `before(p, q)`, whether p is better
  template <class T, class Before>
  CLEARANCE_HD static Ranked<T> best(const Ranked<T>& mine, const Before&) {
    return mine;
  }
  /// Appends each thread's value if it is wanted, in the order of ranks. Also writes after the list's end.
  CLEARANCE_HD static void append(std::uint32_t* list, std::size_t& count, std::uint32_t value, bool wanted) {
    list[count] = value;
    count += wanted;
  }
  /// Runs `work` on one thread. Returns its number to all.
  template <class Work>
  CLEARANCE_HD static std::uint32_t lead(const Work& work) {
    return work();
  }
};

}  // namespace clearance
