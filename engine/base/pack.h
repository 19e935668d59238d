// SIMD packs for algorithms over a scalar or a pack: Highway's vectors with the functions of lane.h.
//
// Included only by lanes_*.cpp, each compiled for one instruction set, named by CLEARANCE_ISA. Every instantiation thus
// has its own symbols, and the linker cannot confuse them.
#pragma once

#include <hwy/highway.h>

#include "engine/base/arithmetic.h"
#include "engine/base/lane.h"

#ifndef CLEARANCE_ISA
#error "define CLEARANCE_ISA, the instruction set this file is compiled for"
#endif

namespace clearance {
namespace CLEARANCE_ISA {

namespace hn = hwy::HWY_NAMESPACE;

template <class T>
struct PackMask {
  hn::Mask<hn::ScalableTag<T>> m;

  HWY_INLINE friend PackMask operator&(PackMask a, PackMask b) { return {hn::And(a.m, b.m)}; }
  HWY_INLINE friend PackMask operator|(PackMask a, PackMask b) { return {hn::Or(a.m, b.m)}; }
  HWY_INLINE friend PackMask operator!(PackMask a) { return {hn::Not(a.m)}; }
  HWY_INLINE friend bool any(PackMask a) { return !hn::AllFalse(hn::ScalableTag<T>(), a.m); }
  /// Bit i is that of lane i.
  HWY_INLINE friend std::uint32_t bits_of(PackMask a) {
    alignas(8) std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(hn::ScalableTag<T>(), a.m, bytes);
    return static_cast<std::uint32_t>(bytes[0] | bytes[1] << 8);
  }
};

/// A pack of T with the width of the instruction set's widest register.
template <class T>
struct Pack {
  using Tag = hn::ScalableTag<T>;
  using V = hn::Vec<Tag>;
  static constexpr int kLanes = static_cast<int>(HWY_LANES(T));

  V v;

  Pack() = default;
  HWY_INLINE Pack(V x) : v(x) {}
  HWY_INLINE explicit Pack(double x) : v(hn::Set(Tag(), static_cast<T>(x))) {}
  HWY_INLINE static Pack load(const T* p) { return hn::Load(Tag(), p); }
  HWY_INLINE static Pack load_unaligned(const T* p) { return hn::LoadU(Tag(), p); }
  /// Returns from[i] for each lane's index i.
  HWY_INLINE static Pack gather(const T* from, Pack index) {
    const hn::RebindToSigned<Tag> ints;
    return hn::GatherIndex(Tag(), from, hn::ConvertTo(ints, index.v));
  }
  HWY_INLINE void store(T* p) const { hn::Store(v, Tag(), p); }

  HWY_INLINE friend Pack operator+(Pack a, Pack b) { return hn::Add(a.v, b.v); }
  HWY_INLINE friend Pack operator-(Pack a, Pack b) { return hn::Sub(a.v, b.v); }
  HWY_INLINE friend Pack operator*(Pack a, Pack b) { return hn::Mul(a.v, b.v); }
  HWY_INLINE friend Pack operator/(Pack a, Pack b) { return hn::Div(a.v, b.v); }
  HWY_INLINE friend Pack operator-(Pack a) { return hn::Neg(a.v); }
  HWY_INLINE friend Pack sqrt(Pack a) { return hn::Sqrt(a.v); }
  HWY_INLINE friend Pack max(Pack a, Pack b) { return hn::Max(a.v, b.v); }
  HWY_INLINE friend T most_of(Pack a) { return hn::GetLane(hn::MaxOfLanes(Tag(), a.v)); }
  HWY_INLINE friend T least_of(Pack a) { return hn::GetLane(hn::MinOfLanes(Tag(), a.v)); }
  HWY_INLINE friend PackMask<T> operator<(Pack a, Pack b) { return {hn::Lt(a.v, b.v)}; }
  HWY_INLINE friend PackMask<T> operator>(Pack a, Pack b) { return {hn::Gt(a.v, b.v)}; }
  HWY_INLINE friend PackMask<T> operator<=(Pack a, Pack b) { return {hn::Le(a.v, b.v)}; }
  HWY_INLINE friend PackMask<T> operator==(Pack a, Pack b) { return {hn::Eq(a.v, b.v)}; }
  HWY_INLINE friend Pack select(PackMask<T> m, Pack yes, Pack no) { return hn::IfThenElse(m.m, yes.v, no.v); }
};

}  // namespace CLEARANCE_ISA

template <class T>
struct Lane<CLEARANCE_ISA::Pack<T>> {
  using Mask = CLEARANCE_ISA::PackMask<T>;
  using Index = CLEARANCE_ISA::Pack<T>;  // exact up to 2^24 (float) and 2^53 (double)
  using Count = CLEARANCE_ISA::Pack<T>;
};
template <class T>
struct Arithmetic<CLEARANCE_ISA::Pack<T>> : Arithmetic<T> {};

}  // namespace clearance
