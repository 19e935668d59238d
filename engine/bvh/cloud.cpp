// Point clouds: points of float32, or boxes of one size about them, which arrive many times a second.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/digest.h"
#include "engine/bvh/box_halving.h"
#include "engine/bvh/leaves_in_box.h"
#include "engine/bvh/surface.h"

namespace clearance {

namespace {

// Whether a + b has no rounding (Knuth's TwoSum).
bool is_exact(double a, double b) {
  const double sum = a + b, part = sum - a;
  return (a - (sum - part)) + (b - part) == 0;
}

// Bound on the rounding of any coordinate within the extremes.
double most_rounding(const std::array<Vec3d, 2>& extremes) {
  double most = 0;
  for (const Vec3d& corner : extremes)
    for (int k = 0; k < 3; ++k) most = std::max(most, std::abs(corner[k]));
  return 0x1p-52 * most;
}

// Spreads the bits of a number of ten, two apart.
std::uint32_t spread(std::uint32_t x) {
  x = (x | x << 16) & 0x030000FF;
  x = (x | x << 8) & 0x0300F00F;
  x = (x | x << 4) & 0x030C30C3;
  return (x | x << 2) & 0x09249249;
}

struct Coded {
  std::uint32_t code, place;
};

// Sorts by code, of 30 bits; equal ones keep their order. A radix sort, since clouds arrive many times a second: it
// takes a quarter of the time of a comparison sort.
void sort_by_code(std::vector<Coded>& list) {
  constexpr std::uint32_t kDigits = 1024;
  std::vector<Coded> other(list.size());
  for (int shift = 0; shift < 30; shift += 10) {
    std::array<std::uint32_t, kDigits> place{};
    for (const Coded& c : list) ++place[c.code >> shift & (kDigits - 1)];
    std::uint32_t sum = 0;
    for (std::uint32_t& count : place) sum += std::exchange(count, sum);
    for (const Coded& c : list) other[place[c.code >> shift & (kDigits - 1)]++] = c;
    list.swap(other);
  }
}

// The box of points. Points are float32, and so are its corners, exactly.
struct PointBox {
  CloudPoint low, high;
  void take(const PointBox& other) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], other.low[k]);
      high[k] = std::max(high[k], other.high[k]);
    }
  }
};

// The points, for halve(), along the Morton curve, cut at a half, a quarter, an eighth of their box (Lauterbach et al.
// 2009).
class PointList {
 public:
  /// \param half half edge of the box about each point, rounded up
  PointList(std::vector<CloudPoint>& points, const Extremes& box, double half)
      : points_(points), half_(static_cast<float>(half * (1 + 0x1p-20))) {
    Vec3d scale;
    for (int k = 0; k < 3; ++k) scale[k] = box.high[k] > box.low[k] ? 1023.99 / (box.high[k] - box.low[k]) : 0;
    list_.resize(points.size());
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      std::uint32_t code = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const int axis = static_cast<int>(k);
        code |= spread(static_cast<std::uint32_t>((points[i][k] - box.low[axis]) * scale[axis])) << k;
      }
      list_[i] = {code, i};
    }
    sort_by_code(list_);
    std::vector<CloudPoint> ordered;
    ordered.reserve(points.size());
    for (const Coded& c : list_) ordered.push_back(points[c.place]);
    points_.swap(ordered);
  }

  std::uint32_t split(std::uint32_t begin, std::uint32_t end) const {
    const std::uint32_t differ = list_[begin].code ^ list_[end - 1].code;
    if (differ == 0) return begin + (end - begin) / 2;
    const std::uint32_t bit = std::bit_floor(differ);
    const auto at = [&](std::uint32_t i) { return list_.begin() + static_cast<std::ptrdiff_t>(i); };
    const auto middle = std::partition_point(at(begin), at(end), [bit](const Coded& c) { return (c.code & bit) == 0; });
    return static_cast<std::uint32_t>(middle - list_.begin());
  }
  PointBox box(std::uint32_t begin, std::uint32_t end) const {
    PointBox box{points_[begin], points_[begin]};
    for (std::uint32_t i = begin + 1; i < end; ++i) box.take({points_[i], points_[i]});
    return box;
  }
  // The box relative to the origin. It is exact for points; half the edge is added, with a margin for the rounding of
  // the sum.
  void close(const PointBox& box, std::array<float, 3>& low, std::array<float, 3>& high) const {
    low = box.low;
    high = box.high;
    if (half_ == 0) return;
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] -= half_ + (std::abs(low[k]) + half_) * 0x1p-22f;
      high[k] += half_ + (std::abs(high[k]) + half_) * 0x1p-22f;
    }
  }

 private:
  std::vector<CloudPoint>& points_;
  float half_;
  std::vector<Coded> list_;
};

}  // namespace

Surface::Surface(std::span<const CloudPoint> points, float edge)
    : points_(points.begin(), points.end()), edge_(edge), kind_(Kind::kCloud) {
  if (points_.empty()) throw std::invalid_argument("a cloud needs at least one point");
  if (points_.size() > kMostElements) throw std::invalid_argument("a cloud has at most 2^30 points");
  if (!(edge_ >= 0 && edge_ <= kMostCloudCoordinate))
    throw std::invalid_argument("voxel: expected a number of metres >= 0, got " + std::to_string(edge_));
  for (std::size_t i = 0; i < points_.size(); ++i)
    for (const float x : points_[i])
      if (!(std::abs(x) <= kMostCloudCoordinate))
        throw std::invalid_argument("point " + std::to_string(i) + " has the coordinate " + std::to_string(x) +
                                    "; expected a finite number up to 1e9 m");
  const double half = 0.5 * double{edge_};
  bool is_rounded = false;
  PointBox box{points_[0], points_[0]};
  for (const CloudPoint& p : points_) {
    box.take({p, p});
    for (std::size_t k = 0; k < 3 && half > 0; ++k) is_rounded |= !is_exact(p[k], half) || !is_exact(p[k], -half);
  }
  const Extremes all{{box.low[0], box.low[1], box.low[2]}, {box.high[0], box.high[1], box.high[2]}};
  extremes_ = {all.low - Vec3d{half, half, half}, all.high + Vec3d{half, half, half}};
  if (is_rounded) rounding_ = 2 * most_rounding(extremes_);  // of a corner's three coordinates
  PointList list(points_, all, half + rounding_);
  nodes_ = halve(list, size());  // from the centre, which is the origin: float32 as the points themselves
  Digest digest;
  digest.add(std::uint64_t{points_.size()});
  digest.add(double{edge_});
  for (const CloudPoint& p : points_) {  // in the order in which scenes are saved
    digest.add(std::uint64_t{std::bit_cast<std::uint32_t>(p[0])} << 32 | std::bit_cast<std::uint32_t>(p[1]));
    digest.add(std::uint64_t{std::bit_cast<std::uint32_t>(p[2])});
  }
  digest_ = digest.value();
}

bool meets_leaf(const Surface& surface, const Vec3d& low, const Vec3d& high) {
  return !visit_leaves(surface, low, high, [](const Surface::Node&) { return false; });
}

}  // namespace clearance
