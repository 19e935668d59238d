#include "engine/bvh/enclosure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>
#include <vector>

#include "engine/bvh/mesh_components.h"
#include "engine/bvh/surface.h"

namespace clearance {

namespace {

constexpr double kThin = 0x1p-16;  // two faces closer than this share of the size count as one
constexpr std::size_t kFewSamples = 256, kManySamples = 10'000, kMostPerTriangle = 64;
constexpr std::uint64_t kMostVisits = 20'000'000;  // to nodes: a few seconds at most

bool may_cancel(const MeshComponents& components) {
  const auto any = [&](const auto& is) { return std::any_of(components.all.begin(), components.all.end(), is); };
  return components.has_busy_edges || any([](const MeshComponent& p) { return p.is_thin(); }) ||
         (any([](const MeshComponent& p) { return p.volume > 0; }) &&
          any([](const MeshComponent& p) { return p.volume < 0; }));
}

// Whether a ray along an axis meets a triangle, its border and a little more included.
bool meets_ray(const std::array<Vec3d, 3>& corners, const Vec3d& p, int axis, double way) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  double left[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d a = corners[(k + 1) % 3] - p, b = corners[(k + 2) % 3] - p;
    left[k] = a[u] * b[v] - a[v] * b[u];
    if (std::abs(left[k]) <= 1e-12 * (std::abs(a[u] * b[v]) + std::abs(a[v] * b[u]))) left[k] = 0;
  }
  const bool is_in = (left[0] >= 0 && left[1] >= 0 && left[2] >= 0) || (left[0] <= 0 && left[1] <= 0 && left[2] <= 0);
  const double sum = left[0] + left[1] + left[2];
  if (!is_in || sum == 0) return false;
  double along = 0;
  for (std::size_t k = 0; k < 3; ++k) along += left[k] / sum * (corners[k][axis] - p[axis]);
  return along * way > 0;
}

class HollowSearch {
 public:
  explicit HollowSearch(const Surface& solid)
      : solid_(solid), components_(components_of(solid.vertices(), solid.triangles())), seen_(components_.all.size()) {
    Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high = -low;
    for (const MeshComponent& part : components_.all)
      for (int k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], part.low[k]);
        high[k] = std::max(high[k], part.high[k]);
      }
    size_ = norm(high - low);
  }

  std::string run() {
    constexpr std::size_t kCoarse = 16;
    const bool many = may_cancel(components_);
    const std::size_t n = solid_.size(), budget = many ? kManySamples : kFewSamples;
    const std::size_t stride = (n + budget - 1) / budget;
    const std::size_t each = std::clamp<std::size_t>(budget / n, 1, kMostPerTriangle);
    std::vector<char> is_met(components_.all.size(), 0);
    const auto test = [&](std::uint32_t t) {
      take_triangle(t, each);
      if (many) take_overlaps(t, each > 7);
    };
    const auto goes_on = [&](std::uint32_t t) { return t < n && why_.empty() && visits_ < kMostVisits; };
    // Some of the whole first, in case that not all can be tested.
    for (std::uint32_t t = 0; goes_on(t); ++t)
      if (t % (kCoarse * stride) == 0 || (many && !is_met[components_.of[t]])) {
        is_met[components_.of[t]] = 1;
        test(t);
      }
    for (std::uint32_t t = 0; goes_on(t); ++t)
      if (t % stride == 0 && t % (kCoarse * stride) != 0) test(t);
    return why_;
  }

 private:
  // Faces found in a component: a triangle with its volume behind it, and one with its volume in front.
  struct Seen {
    std::int64_t behind = -1, before = -1;
  };

  Vec3d normal_of(const std::array<Vec3d, 3>& c) const { return cross(c[1] - c[0], c[2] - c[0]); }

  // Tests points of a triangle: its middle, others near its corners and sides, and more all over it.
  void take_triangle(std::uint32_t t, std::size_t count) {
    constexpr double kNear = 0.02;
    const auto c = solid_.corners(t);
    const auto at = [&](double a, double b) { return c[0] * (1 - a - b) + c[1] * a + c[2] * b; };
    take(t, at(1 / 3.0, 1 / 3.0));
    if (count < 8) return;
    for (const auto& [a, b] : {std::pair{kNear, kNear}, {1 - 2 * kNear, kNear}, {kNear, 1 - 2 * kNear}})
      take(t, at(a, b));
    for (const auto& [a, b] : {std::pair{0.5, kNear}, {kNear, 0.5}, {0.5 - kNear / 2, 0.5 - kNear / 2}})
      take(t, at(a, b));
    double a = 0.5, b = 0.5;  // M. Roberts' sequence R2, folded into the triangle
    for (std::size_t i = 7; i < count; ++i) {
      a += 0.7548776662466927;
      b += 0.5698402909980532;
      a -= std::floor(a);
      b -= std::floor(b);
      take(t, a + b < 1 ? at(a, b) : at(1 - a, 1 - b));
    }
  }

  // Tests points of a triangle within the boxes of components of the opposite orientation, where it may lie in them.
  void take_overlaps(std::uint32_t t, bool corners) {
    constexpr std::size_t kMostParts = 2'000, kMostOthers = 8;
    if (components_.all.size() > kMostParts) return;
    const MeshComponent& own = components_.all[components_.of[t]];
    std::size_t met = 0;
    for (const MeshComponent& other : components_.all) {
      if ((own.volume > 0) == (other.volume > 0) || !own.meets(other)) continue;
      if (++met > kMostOthers) return;
      const std::vector<Vec3d> inside = clipped(t, other);
      if (inside.empty()) continue;
      Vec3d middle{0, 0, 0};
      for (const Vec3d& v : inside) middle += v * (1.0 / static_cast<double>(inside.size()));
      take(t, middle);
      for (const Vec3d& v : inside)
        if (corners) take(t, (middle + v) * 0.5);
    }
  }

  std::vector<Vec3d> clipped(std::uint32_t t, const MeshComponent& box) const {
    const auto c = solid_.corners(t);
    const Vec3d centre = first_corner();
    std::vector<Vec3d> polygon(c.begin(), c.end()), next;
    for (int k = 0; k < 6 && !polygon.empty(); ++k) {  // I. Sutherland, G. Hodgman (1974)
      const int axis = k / 2;
      const double way = k % 2 ? -1 : 1, wall = way * ((k % 2 ? box.high : box.low)[axis] + centre[axis]);
      next.clear();
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Vec3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
        const double in_a = way * a[axis] - wall, in_b = way * b[axis] - wall;
        if (in_a >= 0) next.push_back(a);
        if ((in_a > 0 && in_b < 0) || (in_a < 0 && in_b > 0)) next.push_back(a + (b - a) * (in_a / (in_a - in_b)));
      }
      polygon.swap(next);
    }
    return polygon;
  }

  // The origin of the components' boxes.
  Vec3d first_corner() const { return solid_.vertices()[solid_.triangles()[0][0]]; }

  void take(std::uint32_t t, const Vec3d& p) {
    if (!why_.empty()) return;
    const auto c = solid_.corners(t);
    const Vec3d n = normal_of(c);
    const double length = norm(n), longest = std::sqrt(std::max({squared_norm(c[1] - c[0]), squared_norm(c[2] - c[1]),
                                                                 squared_norm(c[0] - c[2])}));
    if (!(length > 1e-12 * longest * longest)) return;  // a needle has no sides
    // Less than the distance of faces near their edges, and no number that a file is likely to have.
    const double step = 0.8713 * std::min(kThin * size_, length / longest / 2048);
    const Vec3d out = n * (step / length);
    const int before = winding_number(solid_, p + out, &visits_), behind = winding_number(solid_, p - out, &visits_);
    Seen& seen = seen_[components_.of[t]];
    if (before == 0 && behind == 0 && (is_walled_in(p + out) || is_walled_in(p - out)))
      why_ = "triangle " + place(t, p) + " has no volume on either side: faces are oriented both ways there";
    if (before + behind > 0) seen.behind = t;
    if (before + behind < 0) seen.before = t;
    if (!why_.empty() || seen.behind < 0 || seen.before < 0) return;
    const std::int64_t other = before + behind > 0 ? seen.before : seen.behind;
    why_ = "triangle " + place(t, p) + " has its volume " + (before + behind > 0 ? "behind" : "in front of") + " it, " +
           (other == t ? "elsewhere" : "triangle " + number(static_cast<std::uint32_t>(other)) + " of the same part") +
           " the other way: parts cross, and not all are turned alike";
  }

  // Whether there are walls on all sides, of either orientation, so that the space within should be enclosed.
  bool is_walled_in(const Vec3d& p) {
    for (int axis = 0; axis < 3; ++axis)
      for (const double way : {1.0, -1.0})
        if (!meets_wall(p, axis, way)) return false;
    return true;
  }
  bool meets_wall(const Vec3d& p, int axis, double way) {
    const Vec3d from = p - solid_.centre();
    const auto nodes = solid_.nodes();
    std::vector<std::uint32_t> left{0};
    while (!left.empty()) {
      const std::uint32_t at = left.back();
      left.pop_back();
      ++visits_;
      const Surface::Node& node = nodes[at];
      bool misses = false;
      for (int k = 0; k < 3; ++k) {
        const auto i = static_cast<std::size_t>(k);
        misses = misses || (k != axis || way > 0 ? from[k] > node.high[i] : false) ||
                 (k != axis || way < 0 ? from[k] < node.low[i] : false);
      }
      if (misses) continue;
      if (!node.is_leaf()) {
        left.push_back(node.right);
        left.push_back(at + 1);
        continue;
      }
      for (std::uint32_t t = node.begin(); t < node.end(); ++t)
        if (meets_ray(solid_.corners(t), p, axis, way)) return true;
    }
    return false;
  }

  std::string number(std::uint32_t t) const { return std::to_string(solid_.places()[t]); }
  std::string place(std::uint32_t t, const Vec3d& p) const {
    char text[96];
    std::snprintf(text, sizeof text, " at (%.6g, %.6g, %.6g)", p.x, p.y, p.z);
    return number(t) + text;
  }

  const Surface& solid_;
  MeshComponents components_;
  double size_ = 0;
  std::uint64_t visits_ = 0;
  std::vector<Seen> seen_;
  std::string why_;
};

}  // namespace

bool windings_may_cancel(std::span<const Vec3d> vertices, std::span<const Triangle> triangles) {
  return !triangles.empty() && may_cancel(components_of(vertices, triangles));
}

std::string hollow_place(const Surface& solid) {
  return HollowSearch(solid).run();
}

std::string why_not_solid(std::span<const Vec3d> vertices, std::span<const Triangle> triangles) {
  if (std::string why = open_edge(vertices, triangles); !why.empty()) return why;
  return hollow_place(Surface({vertices.begin(), vertices.end()}, {triangles.begin(), triangles.end()}, true));
}

}  // namespace clearance
