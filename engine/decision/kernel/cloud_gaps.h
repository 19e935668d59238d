// Gaps of eight points from an obstacle, for the kernels of decisions and distances. Those from a cloud come from a
// search through its tree of boxes, which leaves out what does not matter.
#pragma once

#include <cstdint>

#include "engine/cover/point_gaps.h"
#include "engine/decision/kernel/eight.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// What matters of the gaps of eight points from a cloud, in metres: hit <= open <= far. Convex parts have no limits.
struct GapLimits {
  Eight far;   ///< of a gap above it, `low` is above it, too, but may be less than the gap
  Eight open;  ///< of a gap up to it, `low` and `high` are up to it, too: the search goes on for gaps below `hit` alone
  Eight hit;   ///< of a gap below it, `high` is below it, too
};

class CloudSearch {
 public:
  CloudSearch(const Obstacle& o, const float* x, const float* y, const float* z, const GapLimits& limits)
      : nodes_(o.cloud->nodes().data()),
        points_(o.cloud->points().data()),
        half_(o.half[0]),
        radius_(o.radius),
        limits_(limits),
        found_(kNone) {
    const EightPoints d{Eight::load(x) - Eight(o.at[0]), Eight::load(y) - Eight(o.at[1]),
                        Eight::load(z) - Eight(o.at[2])};
    const auto along = [&](std::size_t row) {
      return Eight(o.axes[3 * row]) * d.x + Eight(o.axes[3 * row + 1]) * d.y + Eight(o.axes[3 * row + 2]) * d.z;
    };
    c_ = {along(0), along(1), along(2)};
    // Above the limit by more than the rounding of sums with it.
    far_ = limits.far + magnitude(limits.far) * Eight(0x1p-20f) + Eight(1e-30f);
    narrow(far_ + radius_);
  }

  void run(PointGaps& gaps) {
    struct Open {
      Eight squared;
      std::uint32_t node;
    };
    Open open[64];  // one for each level
    int count = 0;
    std::uint32_t at = 0;
    for (bool is_near = near(squared_distance(0)) != 0; is_near;) {
      const Surface::Node& node = nodes_[at];
      if (node.right != 0) {
        const Eight left = squared_distance(at + 1), right = squared_distance(node.right);
        const Bits near_left = near(left), near_right = near(right);
        if (near_left && near_right) {
          const bool is_right = 2 * __builtin_popcount(greater(left, right) & (near_left | near_right)) >
                                __builtin_popcount(near_left | near_right);
          open[count++] = is_right ? Open{left, at + 1} : Open{right, node.right};
          at = is_right ? node.right : at + 1;
          continue;
        }
        if (near_left || near_right) {
          at = near_left ? at + 1 : node.right;
          continue;
        }
      } else {
        take(node.few / Surface::kLeafElements, node.few % Surface::kLeafElements + 1);
      }
      while (count > 0 && !near(open[count - 1].squared)) --count;
      is_near = count > 0;
      if (is_near) at = open[--count].node;
    }
    const Eight gap = found_ - radius_;
    lesser(gap, larger(far_, Eight(0.0f))).store(gaps.low);
    gap.store(gaps.high);
  }

 private:
  static constexpr float kNone = 1e30f;

  Bits near(const Eight& squared) const { return ~greater(squared, bound_) & 0xff; }
  /// Squared distances from a node's box.
  HWY_INLINE Eight squared_distance(std::uint32_t at) const {
    const float* const low = &nodes_[at].low[0];
    const float* const high = &nodes_[at].high[0];
    const auto out = [&](const Eight& c, int k) {
      const Eight d = larger(larger(Eight(low[k]) - c, c - Eight(high[k])), Eight(0.0f));
      return d * d;
    };
    return out(c_.x, 0) + out(c_.y, 1) + out(c_.z, 2);
  }
  /// Searches up to a distance from the cores alone.
  HWY_INLINE void narrow(const Eight& within) { bound_ = within * magnitude(within); }
  HWY_INLINE void take(std::uint32_t begin, std::uint32_t count) {
    if (half_ > 0) {
      for (std::uint32_t i = 0; i < count; ++i) found_ = lesser(found_, from_box(points_[begin + i]));
    } else {
      Eight least(kNone * 1e8f);
      for (std::uint32_t i = 0; i < count; ++i) {
        const EightPoints d = from(points_[begin + i]);
        least = lesser(least, d.x * d.x + d.y * d.y + d.z * d.z);
      }
      found_ = lesser(found_, root(least));
    }
    const Eight gap = found_ - radius_;
    Eight within = lesser(far_ + radius_, found_);
    within = if_greater(gap, limits_.open, within, lesser(within, limits_.hit + radius_));
    narrow(if_greater(limits_.hit, gap, Eight(-kNone), within));
  }
  HWY_INLINE EightPoints from(const CloudPoint& p) const {
    return {c_.x - Eight(p[0]), c_.y - Eight(p[1]), c_.z - Eight(p[2])};
  }
  HWY_INLINE Eight from_box(const CloudPoint& p) const {
    const EightPoints d = from(p);
    const Eight x = magnitude(d.x) - Eight(half_), y = magnitude(d.y) - Eight(half_), z = magnitude(d.z) - Eight(half_),
                zero(0.0f);
    return length({larger(x, zero), larger(y, zero), larger(z, zero)}) + lesser(larger(larger(x, y), z), zero);
  }

  const Surface::Node* nodes_;
  const CloudPoint* points_;
  float half_;
  Eight radius_;
  GapLimits limits_;
  EightPoints c_;
  Eight far_, bound_, found_;  ///< bound_: squared distances from the cores that matter; negative for none
};

HWY_NOINLINE inline void cloud_gaps(const Obstacle& o, const float* x, const float* y, const float* z,
                                    const GapLimits& limits, PointGaps& gaps) {
  CloudSearch(o, x, y, z, limits).run(gaps);
}

/// Whether the gaps from an obstacle are those of planes or points.
HWY_INLINE bool takes_long(const Obstacle& obstacle) {
  return obstacle.kind == Obstacle::Kind::kPlanes || obstacle.kind == Obstacle::Kind::kCloud;
}
/// Signed distances of points from an obstacle that does not take long, by the operations of point_gaps().
template <class F>
HWY_INLINE F gaps_in_lanes(const Obstacle& obstacle, const F& x, const F& y, const F& z) {
  const F from_x = x - F(obstacle.at[0]), from_y = y - F(obstacle.at[1]), from_z = z - F(obstacle.at[2]);
  const float half[3] = {obstacle.half[0], obstacle.half[1], obstacle.half[2]};
  const auto gap = [&](const F& along_x, const F& along_y, const F& along_z) {
    using Kind = Obstacle::Kind;
    const auto of = [&](Kind kind) {
      return point_gaps_detail::core_gap(kind, half, along_x, along_y, along_z) - F(obstacle.radius);
    };
    if (obstacle.kind == Kind::kBox) return of(Kind::kBox);
    if (obstacle.kind == Kind::kSegment) return of(Kind::kSegment);
    return obstacle.kind == Kind::kCylinder ? of(Kind::kCylinder) : of(Kind::kHalfSpace);
  };
  if (obstacle.is_aligned) return gap(from_x, from_y, from_z);
  const auto along = [&](std::size_t row) {
    const auto m = [&](std::size_t k) { return F(obstacle.axes[3 * row + k]); };
    return m(0) * from_x + m(1) * from_y + m(2) * from_z;
  };
  return gap(along(0), along(1), along(2));
}

/// point_gaps(), from clouds as far as they matter.
HWY_INLINE void obstacle_gaps(const Obstacle& o, const float (&x)[8], const float (&y)[8], const float (&z)[8],
                              const GapLimits& limits, PointGaps& gaps) {
  if (o.kind == Obstacle::Kind::kCloud) return cloud_gaps(o, x, y, z, limits, gaps);
  point_gaps(o, x, y, z, gaps);
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
