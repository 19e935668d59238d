#include "engine/mesh/ear_cutter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "engine/base/orientation.h"

namespace clearance {

int turn(const FlatPoint& a, const FlatPoint& b, const FlatPoint& c) {
  const double left = (b.u - a.u) * (c.v - a.v), right = (b.v - a.v) * (c.u - a.u), det = left - right;
  constexpr double kU = 0x1p-53, kBound = (3 + 16 * kU) * kU;  // J. R. Shewchuk (1997), sect. 4.1
  const double bound = kBound * (std::abs(left) + std::abs(right));
  if (det > bound) return 1;
  if (-det > bound) return -1;
  if (left == 0 && right == 0) return 0;
  return orientation({0, a.u, a.v}, {0, b.u, b.v}, {0, c.u, c.v}, {1, a.u, a.v});
}

bool fan_is_right(std::span<const FlatPoint> polygon) {
  for (std::size_t k = 1; k + 1 < polygon.size(); ++k)
    if (turn(polygon[0], polygon[k], polygon[k + 1]) < 0) return false;
  return true;
}

namespace {

using Corner = std::uint32_t;
constexpr std::uint64_t kMostWorkPerCorner = 500;

// Box tree over points that supports removal.
class PointTree {
 public:
  PointTree(std::span<const FlatPoint> points, std::vector<Corner> held)
      : points_(points), held_(std::move(held)), leaf_(points.size(), kNone) {
    if (!held_.empty()) build(0, static_cast<Corner>(held_.size()), kNone);
  }

  void take_out(Corner c) {
    for (Corner at = leaf_[c]; at != kNone; at = nodes_[at].parent) --nodes_[at].left;
    leaf_[c] = kNone;
  }
  bool holds(Corner c) const { return leaf_[c] != kNone; }

  // Returns whether `found` holds for some point that may lie in a counterclockwise triangle, border included.
  template <class F>
  bool any_in(const std::array<FlatPoint, 3>& triangle, std::uint64_t* work, F&& found) const {
    std::vector<Corner> stack;
    if (!nodes_.empty()) stack.push_back(0);
    while (!stack.empty()) {
      const Corner at = stack.back();
      const Node& node = nodes_[at];
      stack.pop_back();
      ++*work;
      if (node.left == 0 || misses(node, triangle)) continue;
      if (node.second != kNone) {
        stack.push_back(node.second);
        stack.push_back(at + 1);
        continue;
      }
      for (Corner i = node.begin; i < node.end; ++i)
        if (holds(held_[i]) && (++*work, found(held_[i]))) return true;
    }
    return false;
  }

 private:
  static constexpr Corner kNone = 0xFFFFFFFFu, kLeaf = 8;
  struct Node {
    FlatPoint low, high;
    Corner begin, end, parent, second, left;
  };

  void build(Corner begin, Corner end, Corner parent) {
    const auto at = static_cast<Corner>(nodes_.size());
    Node node{points_[held_[begin]], points_[held_[begin]], begin, end, parent, kNone, end - begin};
    for (Corner i = begin; i < end; ++i) {
      const FlatPoint& p = points_[held_[i]];
      node.low = {std::min(node.low.u, p.u), std::min(node.low.v, p.v)};
      node.high = {std::max(node.high.u, p.u), std::max(node.high.v, p.v)};
    }
    nodes_.push_back(node);
    if (end - begin <= kLeaf) {
      for (Corner i = begin; i < end; ++i) leaf_[held_[i]] = at;
      return;
    }
    const Corner middle = begin + (end - begin) / 2;
    const bool along_u = node.high.u - node.low.u > node.high.v - node.low.v;
    const auto place = [&](Corner i) { return held_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(place(begin), place(middle), place(end), [&](Corner a, Corner b) {
      return along_u ? points_[a].u < points_[b].u : points_[a].v < points_[b].v;
    });
    build(begin, middle, at);
    nodes_[at].second = static_cast<Corner>(nodes_.size());
    build(middle, end, at);
  }

  // Returns whether a box lies to the right of an edge by more than the rounding error.
  static bool misses(const Node& node, const std::array<FlatPoint, 3>& triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      const FlatPoint &a = triangle[k], &b = triangle[(k + 1) % 3];
      const double du = b.u - a.u, dv = b.v - a.v;
      const double left = du * ((du > 0 ? node.high.v : node.low.v) - a.v);
      const double right = dv * ((dv > 0 ? node.low.u : node.high.u) - a.u);
      if (left - right < -1e-12 * (std::abs(left) + std::abs(right))) return true;
    }
    return false;
  }

  std::span<const FlatPoint> points_;
  std::vector<Corner> held_, leaf_;
  std::vector<Node> nodes_;
};

std::vector<Corner> range(std::size_t count) {
  std::vector<Corner> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<Corner>(i);
  return out;
}

// Remaining corners of a polygon while ears are cut. The tree holds only corners that do not turn counterclockwise,
// since no other corner can lie in an ear.
class EarCutter {
 public:
  EarCutter(std::span<const FlatPoint> points, std::span<const Vec3d> face, double tolerance,
            std::vector<Triangle>* triangles)
      : points_(points),
        face_(face),
        tolerance_(tolerance),
        triangles_(*triangles),
        left_(points.size()),
        previous_(points.size()),
        next_(points.size()),
        is_cut_(points.size(), 0),
        queue_(range(points.size())),
        tree_(points, not_convex(points)) {
    for (std::size_t i = 0; i < left_; ++i) {
      next_[i] = static_cast<Corner>((i + 1) % left_);
      previous_[next_[i]] = static_cast<Corner>(i);
    }
  }

  std::optional<double> run() {
    const std::uint64_t most_work = kMostWorkPerCorner * left_;
    while (left_ > 3) {
      if (work_ > most_work) return {};
      if (head_ == queue_.size() && !next_stage()) return {};
      if (head_ == queue_.size()) continue;
      const Corner b = queue_[head_++];
      if (!is_cut_[b] && is_ear(b)) cut(b);
    }
    Corner last = 0;
    while (is_cut_[last]) ++last;
    const int side = turn_at(last);
    if (side < 0 && !(height(last) <= tolerance_)) return {};
    if (side < 0) off_ = std::max(off_, height(last));
    triangles_.push_back({previous_[last], last, next_[last]});
    return off_;
  }

 private:
  // Definitions of an ear, ever looser. A stage is used if the stage before finds no more ears.
  enum class Stage { kStrict, kTouching, kFlat };

  static std::vector<Corner> not_convex(std::span<const FlatPoint> points) {
    std::vector<Corner> out;
    const std::size_t n = points.size();
    for (std::size_t i = 0; i < n; ++i)
      if (turn(points[(i + n - 1) % n], points[i], points[(i + 1) % n]) <= 0) out.push_back(static_cast<Corner>(i));
    return out;
  }

  int turn_of(Corner a, Corner b, Corner c) const { return turn(points_[a], points_[b], points_[c]); }
  int turn_at(Corner b) const { return turn_of(previous_[b], b, next_[b]); }

  // Returns whether the polygon reverses its direction: at the end of a slit or of a protruding line.
  bool folds_back(Corner b) const {
    const FlatPoint &a = points_[previous_[b]], &at = points_[b], &c = points_[next_[b]];
    return (a.u - at.u) * (c.u - at.u) + (a.v - at.v) * (c.v - at.v) > 0;
  }

  double height(Corner b) const {
    const Vec3d &p = face_[previous_[b]], &q = face_[b], &r = face_[next_[b]];
    const double longest = std::max({norm(q - p), norm(r - q), norm(p - r)});
    return longest > 0 ? norm(cross(q - p, r - p)) / longest : 0;
  }

  bool is_ear(Corner b) {
    const Corner a = previous_[b], c = next_[b];
    ++work_;
    const int side = turn_of(a, b, c);
    if (side == 0) return stage_ == Stage::kFlat || folds_back(b);
    if (side < 0) return false;
    return !tree_.any_in({points_[a], points_[b], points_[c]}, &work_,
                         [&](Corner q) { return q != a && q != b && q != c && blocks(q, a, b, c); });
  }

  // Returns whether the polygon enters the triangle a, b, c at its corner q.
  bool blocks(Corner q, Corner a, Corner b, Corner c) const {
    const int ab = turn_of(a, b, q), bc = turn_of(b, c, q), ca = turn_of(c, a, q);
    if (ab < 0 || bc < 0 || ca < 0) return false;
    if (ab > 0 && bc > 0 && ca > 0) return true;
    // Equal positions, as at the ends of a bridge, whose edges may run along the triangle's or away from it.
    const auto enters = [&](Corner before, Corner at, Corner after) {
      for (const Corner x : {previous_[q], next_[q]})
        if (turn_of(before, at, x) > 0 && turn_of(at, after, x) > 0) return true;
      return false;
    };
    if (points_[q] == points_[a]) return enters(c, a, b);
    if (points_[q] == points_[b]) return enters(a, b, c);
    if (points_[q] == points_[c]) return enters(b, c, a);
    return stage_ == Stage::kStrict;
  }

  void cut(Corner b) {
    const Corner a = previous_[b], c = next_[b];
    triangles_.push_back({a, b, c});
    is_cut_[b] = 1;
    next_[a] = c;
    previous_[c] = a;
    --left_;
    if (tree_.holds(b)) tree_.take_out(b);
    for (const Corner changed : {a, c}) {
      if (tree_.holds(changed) && turn_at(changed) > 0) tree_.take_out(changed);
      queue_.push_back(changed);
    }
  }

  // Goes on where no ear is left: with more that counts as one or, past the last stage, with the flattest corner that
  // may be cut. Whether there is one.
  bool next_stage() {
    if (stage_ != Stage::kFlat) {
      stage_ = stage_ == Stage::kStrict ? Stage::kTouching : Stage::kFlat;
      queue_.clear();
      head_ = 0;
      for (Corner i = 0; i < is_cut_.size(); ++i)
        if (!is_cut_[i]) queue_.push_back(i);
      return true;
    }
    work_ += 16 * is_cut_.size();  // each is measured in space
    Corner best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (Corner i = 0; i < is_cut_.size(); ++i) {
      if (is_cut_[i]) continue;
      const double h = height(i);
      if (h < least && (h <= tolerance_ || turn_at(i) >= 0)) {
        least = h;
        best = i;
      }
    }
    if (!(least < std::numeric_limits<double>::infinity())) return false;
    if (turn_at(best) < 0) off_ = std::max(off_, least);
    cut(best);
    return true;
  }

  std::span<const FlatPoint> points_;
  std::span<const Vec3d> face_;
  double tolerance_, off_ = 0;
  std::vector<Triangle>& triangles_;
  std::size_t left_, head_ = 0;
  std::vector<Corner> previous_, next_;
  std::vector<char> is_cut_;
  std::vector<Corner> queue_;  // corners that may be ears, in the order of their places: no corner gets all triangles
  PointTree tree_;
  Stage stage_ = Stage::kStrict;
  std::uint64_t work_ = 0;
};

}  // namespace

std::optional<double> cut_ears(std::span<const FlatPoint> polygon, std::span<const Vec3d> face, double tolerance,
                               std::vector<Triangle>* triangles) {
  triangles->clear();
  std::vector<Corner> kept;  // a position that comes twice in a row is one corner
  const auto same = [&](Corner a, Corner b) { return is_zero(face[a] - face[b]); };
  for (const Corner i : range(polygon.size()))
    if (kept.empty() || !same(i, kept.back())) kept.push_back(i);
  while (kept.size() > 1 && same(kept.front(), kept.back())) kept.pop_back();
  if (kept.size() < 3) return 0;
  std::vector<FlatPoint> points;
  std::vector<Vec3d> positions;
  for (const Corner i : kept) {
    points.push_back(polygon[i]);
    positions.push_back(face[i]);
  }
  const std::optional<double> off = EarCutter(points, positions, tolerance, triangles).run();
  for (Triangle& t : *triangles)
    for (Corner& c : t) c = kept[c];
  return off;
}

}  // namespace clearance
