// Bounds on the least distance of a state as its search goes on, for the kernel of distances (distance_kernel.h).
#pragma once

#include <cstdint>
#include <limits>

#include "engine/decision/kernel/distance_view.h"
#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// The least upper bound, the least lower bound laid aside, and the pairs left.
class LeastBounds {
 public:
  static constexpr float kFar = -BallPacket::kNoRadius;

  LeastBounds(const DistanceLimits& limits, const DistanceRoom& room) : limits_(limits), room_(room) {}

  /// \param used entries of DistanceRoom::left that belong to earlier states
  void begin(std::uint32_t used) {
    begin_ = used;
    left_ = 0;
    aside_ = upper_ = kFar;
    aside_at_ = upper_at_ = hit_ = kNowhere;
    overflow_ = false;
    limit();
  }
  void end(DistanceBounds& result) {
    drop_far();
    if (overflow_) return;
    result.is_listed = true;
    result.lower = aside_ > 0 ? double{aside_} * (1 - kRounding) : 0;
    result.upper = upper_ > kMost ? std::numeric_limits<double>::infinity()
                   : upper_ > 0   ? double{upper_} * (1 + kRounding)
                                  : upper_;
    result.lower_at = aside_at_;
    result.upper_at = hit_ != kNowhere ? hit_ : upper_at_ != kNowhere ? upper_at_ : aside_at_;
    result.left_begin = begin_;
    result.left_end = begin_ + left_;
  }
  bool is_over() const { return overflow_ || (limits_.any_overlap && upper_ <= 0); }
  float threshold() const { return threshold_; }
  /// Threshold without an upper bound.
  float greatest_threshold() {
    begin(0);
    return threshold_;
  }
  float upper() const { return upper_; }
  /// Gaps of balls whose shares are not beyond the threshold matter, but all until there is an upper bound.
  HWY_INLINE GapLimits gap_limits(const Eight& outer) const {
    const Eight never(-kFar);
    return {Eight(upper_ < kFar ? threshold_ : 0.1f * kFar) + outer, never, never};
  }
  /// Width of the bounds that is permitted; not above 0 if no bounds suffice.
  float width() const { return width_; }
  /// Position of a pair that is proved to overlap; later pairs do not matter.
  std::uint64_t hit() const { return hit_; }
  /// Takes the upper bounds of balls or pairs.
  /// \param upper at least kFar in unused lanes
  template <int kCount, class Position>
  HWY_INLINE void take_upper(const Floats<kCount>& upper, const Position& position) {
    if (!greater(Floats<kCount>(upper_), upper)) return;
    const float value = least(upper);
    take_upper(value, position(lowest(equal(upper, Floats<kCount>(value)))));
  }
  void take_upper(float upper, std::uint64_t position) {
    if (!(upper < upper_)) return;
    upper_ = upper;
    upper_at_ = position;
    if (upper <= 0) hit_ = position < hit_ ? position : hit_;
    limit();
  }
  void lay_aside(float lower, std::uint64_t position) {
    if (!(lower < aside_)) return;
    aside_ = lower;
    aside_at_ = position;
  }
  /// Lays balls or pairs beyond the threshold aside, and returns the others.
  /// \param lower beyond all thresholds in unused lanes
  /// \param values receives the lower bounds
  template <int kCount, class Position>
  HWY_INLINE Bits sift(const Floats<kCount>& lower, float* values, const Position& position) {
    using F = Floats<kCount>;
    lower.store(values);
    const Bits far = greater(lower, F(threshold_));
    if (greater(F(aside_), lower) & far) {
      const float value = least(if_greater(lower, F(threshold_), lower, F(kFar)));
      lay_aside(value, position(lowest(equal(lower, F(value)) & far)));
    }
    return ~far & first(F::kNumbers);
  }
  LeftPair* find_left(std::uint64_t position) const {
    LeftPair* const of = room_.left + begin_;
    for (std::uint32_t i = 0; i < left_; ++i)
      if (of[i].position == position) return of + i;
    return nullptr;
  }
  void leave(std::uint64_t position, float lower) {
    if (LeftPair* const known = find_left(position)) {
      known->lower = lower < known->lower ? lower : known->lower;
    } else if (begin_ + left_ == room_.capacity) {
      overflow_ = true;
    } else {
      room_.left[begin_ + left_++] = {position, lower};
    }
  }
  bool leaves_only(std::uint64_t position) const {
    return left_ == 0 || (left_ == 1 && room_.left[begin_].position == position);
  }

 private:
  static constexpr double kRounding = 0x1p-22;  // of differences of float32 numbers, relative
  static constexpr double kMost = 1e29;         // less than the lower bounds of unused columns
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};

  void limit() {
    const DistanceLimits& l = limits_;
    const double first = l.scale[0] * upper_ + l.shift[0], second = l.scale[1] * upper_ + l.shift[1];
    double t = first < second ? first : second;
    t = t < l.most ? t : l.most;
    t = t < 0 ? 0 : t > kMost ? kMost : t;
    threshold_ = static_cast<float>(t * (1 + 0x1p-23));
    width_ = upper_ - threshold_;
  }
  /// Lays pairs aside that are beyond the threshold by now, and drops those after an overlapping one.
  void drop_far() {
    LeftPair* const of = room_.left + begin_;
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < left_; ++i) {
      if (of[i].lower > threshold_)
        lay_aside(of[i].lower, of[i].position);
      else if (of[i].position <= hit_)
        of[kept++] = of[i];
    }
    left_ = kept;
  }

  const DistanceLimits& limits_;
  const DistanceRoom& room_;
  float upper_ = 0, aside_ = 0, threshold_ = 0, width_ = 0;
  std::uint64_t upper_at_ = 0, aside_at_ = 0, hit_ = 0;
  std::uint32_t begin_ = 0, left_ = 0;
  bool overflow_ = false;
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
