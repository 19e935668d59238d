// Masks, selection and small integers for code that runs on a scalar, a SIMD pack and a GPU thread alike.
//
// A scalar T is a pack of one lane: its masks are bool and select() is the conditional operator. pack.h defines the
// same functions for Highway's vectors. Such code never branches on a lane's value, only on any(mask): it skips work
// that no lane needs, and no lane's result depends on its neighbours, so that every instantiation gives the same bits.
#pragma once

#include <cstdint>

#include "engine/base/vec.h"

namespace clearance {

/// Mask: a bool per lane. Index: a vertex index per lane, in a float type where that is faster, since indices are exact
/// in it. Count: a small integer per lane.
template <class T>
struct Lane {
  using Mask = bool;
  using Index = std::uint32_t;
  using Count = int;
};

// A CPU selects between addresses; a GPU thread selects between values, since only these can stay in registers.
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
