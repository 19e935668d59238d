// Clouds: points of float32, or boxes of one size about them, which come many times a second.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "engine/base/digest.h"
#include "engine/surface/box_halving.h"
#include "engine/surface/surface.h"

namespace clearance {

namespace {

// Whether a + b has no rounding (Knuth's TwoSum).
bool is_exact(double a, double b) {
  const double sum = a + b, part = sum - a;
  return (a - (sum - part)) + (b - part) == 0;
}

// No coordinate within is rounded by more.
double most_rounding(const std::array<Vec3d, 2>& extremes) {
  double most = 0;
  for (const Vec3d& corner : extremes)
    for (int k = 0; k < 3; ++k) most = std::max(most, std::abs(corner[k]));
  return 0x1p-52 * most;
}

// The points, for halve(): sorted themselves, since places would be looked up all over the memory.
class PointList {
 public:
  PointList(std::vector<CloudPoint>& points, const Vec3d& centre, double half)
      : points_(points), centre_(centre), half_{half, half, half} {}

  Extremes box(std::uint32_t begin, std::uint32_t end) const {
    const auto [low, high] = around(begin, end);
    return {Vec3d{low[0], low[1], low[2]} - half_ - centre_, Vec3d{high[0], high[1], high[2]} + half_ - centre_};
  }
  void split(std::uint32_t begin, std::uint32_t middle, std::uint32_t end) {
    const auto [low, high] = around(begin, end);
    std::size_t axis = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    const auto at = [&](std::uint32_t i) { return points_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end),
                     [axis](const CloudPoint& a, const CloudPoint& b) { return a[axis] < b[axis]; });
  }

 private:
  struct Around {
    CloudPoint low, high;
  };
  Around around(std::uint32_t begin, std::uint32_t end) const {
    Around box{points_[begin], points_[begin]};
    for (std::uint32_t i = begin + 1; i < end; ++i)
      for (std::size_t k = 0; k < 3; ++k) {
        box.low[k] = std::min(box.low[k], points_[i][k]);
        box.high[k] = std::max(box.high[k], points_[i][k]);
      }
    return box;
  }

  std::vector<CloudPoint>& points_;
  Vec3d centre_, half_;
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
  measure_cloud();
  // What a box's corners are rounded by counts here: it may be more than what is left of them beside the centre.
  PointList list(points_, centre_, edge_ > 0 ? 0.5 * double{edge_} + 4 * most_rounding(extremes_) : 0);
  nodes_ = halve(list, size());
}

void Surface::measure_cloud() {
  Digest digest;
  digest.add(std::uint64_t{points_.size()});
  digest.add(double{edge_});
  Extremes box;
  const double half = 0.5 * double{edge_};
  bool is_rounded = false;
  for (const CloudPoint& p : points_) {
    const Vec3d at{p[0], p[1], p[2]};
    box.take(at);
    digest.add(at);
    for (int k = 0; k < 3 && half > 0; ++k) is_rounded |= !is_exact(at[k], half) || !is_exact(at[k], -half);
  }
  extremes_ = {box.low - Vec3d{half, half, half}, box.high + Vec3d{half, half, half}};
  // A corner's three coordinates.
  if (is_rounded) rounding_ = 2 * most_rounding(extremes_);
  centre_ = box.middle();
  digest_ = digest.value();
}

bool meets_leaf(const Surface& surface, const Vec3d& low, const Vec3d& high) {
  const std::span<const Surface::Node> nodes = surface.nodes();
  // Rounded here and there, each time by less than what a box's corners were moved outward by.
  const Vec3d from = low - surface.centre(), to = high - surface.centre();
  std::vector<std::uint32_t> left{0};
  while (!left.empty()) {
    const std::uint32_t at = left.back();
    left.pop_back();
    const Surface::Node& node = nodes[at];
    if (to.x < node.low[0] || from.x > node.high[0] || to.y < node.low[1] || from.y > node.high[1] ||
        to.z < node.low[2] || from.z > node.high[2])
      continue;
    if (node.is_leaf()) return true;
    left.push_back(node.right);
    left.push_back(at + 1);
  }
  return false;
}

}  // namespace clearance
