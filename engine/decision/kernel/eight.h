// Floats side by side, in the registers of one instruction set. Included by the kernel of decisions alone.
#pragma once

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#ifndef CLEARANCE_ISA
#error "define CLEARANCE_ISA, the instruction set this file is compiled for"
#endif

namespace clearance {
namespace CLEARANCE_ISA {

namespace hn = hwy::HWY_NAMESPACE;

/// Bit i is of number i.
using Bits = std::uint32_t;

template <int kCount>
struct Floats {
  using Tag = hn::CappedTag<float, kCount>;
  static constexpr int kLanes = std::min(static_cast<int>(HWY_LANES(float)), kCount);
  static constexpr int kParts = kCount / kLanes;

  static constexpr int kNumbers = kCount;

  hn::Vec<Tag> part[kParts];

  Floats() = default;
  HWY_INLINE explicit Floats(float x) {
    for (auto& p : part) p = hn::Set(Tag(), x);
  }
  HWY_INLINE static Floats load(const float* from) {
    Floats e;
    for (int i = 0; i < kParts; ++i) e.part[i] = hn::LoadU(Tag(), from + i * kLanes);
    return e;
  }
  /// Blocks of eight numbers, each `apart` numbers after the one before.
  HWY_INLINE static Floats load_blocks(const float* from, std::size_t apart) {
    Floats e;
    if constexpr (kLanes > 8) {
      const hn::Half<Tag> half;
      e.part[0] = Combine(Tag(), hn::LoadU(half, from + apart), hn::LoadU(half, from));  // not in all namespaces `hn`
    } else {
      for (std::size_t i = 0; i < kParts; ++i)
        e.part[i] = hn::LoadU(Tag(), from + i * kLanes / 8 * apart + i * kLanes % 8);
    }
    return e;
  }
  /// from[index[i]]
  HWY_INLINE static Floats gather(const float* from, const std::int32_t* index) {
    const hn::RebindToSigned<Tag> ints;
    Floats e;
    for (int i = 0; i < kParts; ++i) e.part[i] = hn::GatherIndex(Tag(), from, hn::LoadU(ints, index + i * kLanes));
    return e;
  }
  HWY_INLINE void store(float* to) const {
    for (int i = 0; i < kParts; ++i) hn::StoreU(part[i], Tag(), to + i * kLanes);
  }
  template <class F>
  HWY_INLINE static Floats of_parts(const Floats& a, const Floats& b, const F& f) {
    Floats e;
    for (int i = 0; i < kParts; ++i) e.part[i] = f(a.part[i], b.part[i]);
    return e;
  }
  HWY_INLINE friend Floats operator+(const Floats& a, const Floats& b) {
    return of_parts(a, b, [](auto x, auto y) { return hn::Add(x, y); });
  }
  HWY_INLINE friend Floats operator-(const Floats& a, const Floats& b) {
    return of_parts(a, b, [](auto x, auto y) { return hn::Sub(x, y); });
  }
  HWY_INLINE friend Floats operator*(const Floats& a, const Floats& b) {
    return of_parts(a, b, [](auto x, auto y) { return hn::Mul(x, y); });
  }
  HWY_INLINE friend Floats lesser(const Floats& a, const Floats& b) {
    return of_parts(a, b, [](auto x, auto y) { return hn::Min(x, y); });
  }
  HWY_INLINE friend Floats larger(const Floats& a, const Floats& b) {
    return of_parts(a, b, [](auto x, auto y) { return hn::Max(x, y); });
  }
  HWY_INLINE friend Floats magnitude(const Floats& a) {
    return of_parts(a, a, [](auto x, auto) { return hn::Abs(x); });
  }
  /// `x` where a > b, elsewhere `y`.
  HWY_INLINE friend Floats if_greater(const Floats& a, const Floats& b, const Floats& x, const Floats& y) {
    Floats e;
    for (int i = 0; i < kParts; ++i) e.part[i] = hn::IfThenElse(hn::Gt(a.part[i], b.part[i]), x.part[i], y.part[i]);
    return e;
  }
  HWY_INLINE friend Floats root(const Floats& a) {
    return of_parts(a, a, [](auto x, auto) { return hn::Sqrt(x); });
  }
  HWY_INLINE friend Bits greater(const Floats& a, const Floats& b) {
    Bits bits = 0;
    for (int i = 0; i < kParts; ++i) bits |= bits_of(hn::Gt(a.part[i], b.part[i])) << (i * kLanes);
    return bits;
  }
  HWY_INLINE friend Bits equal(const Floats& a, const Floats& b) {
    Bits bits = 0;
    for (int i = 0; i < kParts; ++i) bits |= bits_of(hn::Eq(a.part[i], b.part[i])) << (i * kLanes);
    return bits;
  }
  HWY_INLINE friend float least(const Floats& a) {
    hn::Vec<Tag> found = a.part[0];
    for (int i = 1; i < kParts; ++i) found = hn::Min(found, a.part[i]);
    return hn::GetLane(hn::MinOfLanes(Tag(), found));
  }

 private:
  HWY_INLINE static Bits bits_of(hn::Mask<Tag> mask) {
    std::uint8_t bytes[8];
    hn::StoreMaskBits(Tag(), mask, bytes);
    return kLanes > 8 ? Bits{bytes[0]} | Bits{bytes[1]} << 8 : bytes[0];
  }
};
using Eight = Floats<8>;
using Sixteen = Floats<16>;

/// Three coordinates of eight points.
struct EightPoints {
  Eight x, y, z;

  HWY_INLINE friend EightPoints operator-(const EightPoints& a, const EightPoints& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
};
HWY_INLINE Eight length(const EightPoints& v) {
  return root(v.x * v.x + v.y * v.y + v.z * v.z);
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
