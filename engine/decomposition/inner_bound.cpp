// Bound on the distance of a mesh from convex parts: triangles are subdivided until one convex part is near enough to
// all three corners of a subtriangle, and so to all of it.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <queue>
#include <unordered_map>

#include "engine/base/fp_environment.h"
#include "engine/decomposition/measure.h"
#include "engine/decomposition/prove.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kUp = 1 + 0x1p-44;             // exceeds the rounding of a few sums and roots
constexpr std::uint64_t kPartsPerDistance = 4;  // box tests of this many subtriangles cost a distance

class InnerBound {
 public:
  InnerBound(const Surface& exact_value, std::span<const ConvexPartPtr> convex_parts, const ProofEffort& effort)
      : exact_value_(exact_value),
        convex_parts_(convex_parts),
        effort_(effort),
        points_(exact_value.vertices().begin(), exact_value.vertices().end()) {
    Vec3d low = points_[0], high = points_[0];
    for (const Vec3d& v : points_) {
      reach_ = std::max(reach_, norm(v));
      for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
    }
    size_ = norm(high - low);
    measure_ = Measure(0x1p-24 * size_);
  }

  ProvedLength run() {
    for (const Triangle& t : exact_value_.triangles()) put({0, kInf, 0, 0, t, 0});
    std::uint64_t parts = 0;
    while (!parts_.empty() && parts_.top().bound > stop_below() &&
           measure_.count() + parts / kPartsPerDistance < effort_.inner_distances) {
      const Part part = parts_.top();
      parts_.pop();
      divide(part);
      ++parts;
    }
    return {parts_.empty() ? 0 : parts_.top().bound * kUp, met_};
  }

 private:
  struct Part {
    double bound;    // bound on its distance from the convex parts, with the rounding of divisions
    double parents;  // bound of the subtriangle it was cut from
    double off;      // bound on its distance from the triangle of its corners
    int generation;
    Triangle corners;                          // of points_
    std::uint32_t convex_part;                 // the convex part nearest to all of it
    bool operator<(const Part& other) const {  // the largest bound is on top; among equal ones the oldest
      return bound != other.bound ? bound < other.bound : corners > other.corners;
    }
  };

  double stop_below() const { return std::max(met_ * (1 + effort_.share), met_ + effort_.inner_of_size * size_); }

  const Measure::Bounds& distance(std::uint32_t point, std::uint32_t convex_part) {
    const auto [at, is_new] = known_.try_emplace(std::uint64_t{point} << 32 | convex_part);
    if (is_new) at->second = measure_.to(*convex_parts_[convex_part], points_[point]);
    return at->second;
  }
  // Approximate lower bound on the distance of a point from a convex part.
  double box_gap(std::uint32_t point, std::uint32_t convex_part) const {
    const ConvexPart& p = *convex_parts_[convex_part];
    const Vec3d& v = points_[point];
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      const double gap = std::max(0.0, std::abs(v[k] - p.centre[k]) - p.half[k]);
      sum += gap * gap;
    }
    return std::sqrt(sum);
  }
  // Finds the convex part that is nearest to one of the points, by boxes first.
  // \param gap returns the distance to the box of part i, as gap(i)
  // \param of returns the distance to part i, as of(i, best so far)
  template <class Gap, class Of>
  std::pair<double, std::uint32_t> nearest(const Gap& gap, const Of& of) {
    order_.clear();
    for (std::uint32_t i = 0; i < convex_parts_.size(); ++i) order_.push_back({gap(i), i});
    std::sort(order_.begin(), order_.end());
    std::pair<double, std::uint32_t> best{kInf, 0};
    for (const auto& [least, i] : order_) {
      if (least > best.first) break;
      if (const double d = of(i, best.first); d < best.first) best = {d, i};
    }
    return best;
  }
  void evaluate_point(std::uint32_t point) {
    if (point < evaluated_.size() && evaluated_[point]) return;
    if (point >= evaluated_.size()) evaluated_.resize(point + std::size_t{1});
    evaluated_[point] = 1;
    double least = kInf;
    nearest([&](std::uint32_t i) { return box_gap(point, i); },
            [&](std::uint32_t i, double) {
              least = std::min(least, distance(point, i).lower);
              return distance(point, i).upper;
            });
    met_ = std::max(met_, least);
  }

  // No point of a subtriangle is farther from a convex part than its farthest corner.
  void bound(Part& part) {
    for (const std::uint32_t corner : part.corners) evaluate_point(corner);
    const auto& c = part.corners;
    const auto [whole, convex_part] =
        nearest([&](std::uint32_t i) { return std::max({box_gap(c[0], i), box_gap(c[1], i), box_gap(c[2], i)}); },
                [&](std::uint32_t i, double best) {
                  double most = 0;
                  for (const std::uint32_t corner : c)
                    if (most < best) most = std::max(most, distance(corner, i).upper);
                  return most;
                });
    part.convex_part = convex_part;
    part.bound = std::min(part.parents, (whole + part.off) * kUp);
  }
  void put(Part part) {
    bound(part);
    parts_.push(part);
  }

  // Divides at the boundary of the convex part that is nearest to all of it, or across the longest edge.
  void divide(const Part& part) {
    std::size_t first = longest(part);
    double along = 0.5;
    if (part.generation % 4 != 3) at_end(part, first, along);
    const std::uint32_t u = part.corners[first], v = part.corners[(first + 1) % 3], w = part.corners[(first + 2) % 3];
    const auto middle = static_cast<std::uint32_t>(points_.size());
    points_.push_back(points_[u] + (points_[v] - points_[u]) * along);
    const double off = (part.off + rounding_of_division(reach_)) * kUp;
    put({0, part.bound, off, part.generation + 1, {u, middle, w}, 0});
    put({0, part.bound, off, part.generation + 1, {middle, v, w}, 0});
  }
  std::size_t longest(const Part& part) const {
    const auto length = [&](std::size_t k) {
      return squared_norm(points_[part.corners[(k + 1) % 3]] - points_[part.corners[k]]);
    };
    std::size_t best = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (length(k) > length(best)) best = k;
    return best;
  }
  // Finds the point where an edge leaves the half-space that contains the convex part and not the edge's farther end.
  void at_end(const Part& part, std::size_t& edge, double& along) {
    const auto& c = part.corners;
    std::size_t far = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (distance(c[k], part.convex_part).lower > distance(c[far], part.convex_part).lower) far = k;
    const Measure::Bounds from = distance(c[far], part.convex_part);
    if (!(from.lower > 0)) return;
    double deepest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      if (k == far) continue;
      const double height = from.lower + dot(from.away, points_[c[k]] - points_[c[far]]);
      if (!(height < deepest)) continue;
      const double out = -height / (from.lower - height);  // from k towards far
      if (!(out > 0.01 && out < 0.99)) continue;
      deepest = height;
      edge = (k + 1) % 3 == far ? k : far;
      along = edge == k ? out : 1 - out;
    }
  }

  const Surface& exact_value_;
  std::span<const ConvexPartPtr> convex_parts_;
  const ProofEffort& effort_;
  std::vector<Vec3d> points_;
  std::vector<char> evaluated_;
  double reach_ = 0, size_ = 0, met_ = 0;
  Measure measure_{0};
  std::unordered_map<std::uint64_t, Measure::Bounds> known_;
  std::vector<std::pair<double, std::uint32_t>> order_;
  std::priority_queue<Part> parts_;
};

}  // namespace

ProvedLength prove_inner(const Surface& exact_value, std::span<const ConvexPartPtr> convex_parts,
                         const ProofEffort& effort) {
  const FpEnvironment environment;
  return InnerBound(exact_value, convex_parts, effort).run();
}

}  // namespace clearance
