// What lets one piece of code run on a scalar, on a SIMD pack and on a GPU thread: masks, selection, small integers.
//
// A scalar T is a pack of one lane: its masks are bool and select() is the conditional operator. pack.h gives the same
// words to Highway's vectors. Code written with them never branches on a lane's value, only on any(mask): what no lane
// needs is skipped, and what a lane does never depends on its neighbours, so that every instantiation gives the same
// bits.
#pragma once

#include <cstdint>

#include "engine/base/vec.h"

namespace clearance {

/// Mask: one truth value for each lane. Index: a vertex's index for each lane; a float type where that is faster, since
/// indices are exact in it. Count: a small integer for each lane.
template <class T>
struct Lane {
  using Mask = bool;
  using Index = std::uint32_t;
  using Count = int;
};

// A processor chooses between addresses; a GPU thread between values, since only those live in registers.
#ifdef __CUDA_ARCH__
template <class T>
CLEARANCE_HD inline T select(bool mask, const T& yes, const T& no) {
  return mask ? yes : no;
}
#else
template <class T>
CLEARANCE_HD inline const T& select(bool mask, const T& yes, const T& no) {
  return mask ? yes : no;
}
#endif
CLEARANCE_HD inline bool any(bool mask) {
  return mask;
}

template <class Mask, class T>
CLEARANCE_HD inline Vec3<T> select(const Mask& mask, const Vec3<T>& yes, const Vec3<T>& no) {
  return {select(mask, yes.x, no.x), select(mask, yes.y, no.y), select(mask, yes.z, no.z)};
}
template <class T>
#ifdef __CUDA_ARCH__
CLEARANCE_HD inline Vec3<T> select(bool mask, const Vec3<T>& yes, const Vec3<T>& no) {
  return {mask ? yes.x : no.x, mask ? yes.y : no.y, mask ? yes.z : no.z};
}
#else
CLEARANCE_HD inline const Vec3<T>& select(bool mask, const Vec3<T>& yes, const Vec3<T>& no) {
  return mask ? yes : no;
}
#endif

}  // namespace clearance
