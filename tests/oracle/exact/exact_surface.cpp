#include "tests/oracle/exact/exact_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <queue>
#include <random>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "tests/oracle/exact/exact_difference.h"

namespace clearance::exact {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct Box {
  Vec3d low{kInf, kInf, kInf}, high{-kInf, -kInf, -kInf};
  void take(const Vec3d& v) {
    for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
  }
};
double gap_of(const Box& a, const Box& b) {
  Vec3d gap{0, 0, 0};
  for (int k = 0; k < 3; ++k) gap[k] = std::max({0.0, a.low[k] - b.high[k], b.low[k] - a.high[k]});
  return norm(gap);
}

double reach(std::span<const Vec3d> vertices) {
  double most = 0;
  for (const Vec3d& v : vertices) most = std::max(most, norm(v));
  return most;
}

/// A convex part of a body, a triangle or the whole hull: its vertices, and their approximate positions.
struct Part {
  std::vector<std::uint32_t> places;  // in BodyView::vertices
  std::vector<Vec3d> vertices, rough;
  Box box;
};

/// A body at a pose, in parts.
struct PosedBody {
  PosedBody(const BodyView& body, const Pose& pose, const Vec3d& shift) : view(body), X(pose) {
    const std::vector<Vec3d> rough = roughly_placed(body.vertices, X, shift);
    for (const Vec3d& v : rough) box.take(v);
    for (const Triangle& t : body.triangles) add({t.begin(), t.end()}, rough);
    if (!body.triangles.empty()) return;
    std::vector<std::uint32_t> all(body.vertices.size());
    std::iota(all.begin(), all.end(), 0);
    add(std::move(all), rough);
  }
  ConvexPartView hull() const { return {view.vertices, view.radius}; }
  ConvexPartView convex_part(std::uint32_t number) const { return {parts[number].vertices, view.radius}; }

  BodyView view;
  Pose X;
  std::vector<Part> parts;
  Box box;

 private:
  void add(std::vector<std::uint32_t> places, const std::vector<Vec3d>& rough) {
    Part& part = parts.emplace_back();
    for (const std::uint32_t i : places) {
      part.vertices.push_back(view.vertices[i]);
      part.rough.push_back(rough[i]);
      part.box.take(rough[i]);
    }
    part.places = std::move(places);
  }
};

/// Finds the nearest parts of two bodies, best first by lower bounds in doubles that allow for their rounding.
class NearestParts {
 public:
  /// \param rounding bound on the error of lower bounds in doubles, metres
  NearestParts(const PosedBody& a, const PosedBody& b, double rounding) : a_(a), b_(b), rounding_(rounding) {}

  Result solve() {
    std::vector<Candidate> all;
    for (std::uint32_t i = 0; i < a_.parts.size(); ++i)
      for (std::uint32_t j = 0; j < b_.parts.size(); ++j)
        all.push_back({gap_of(a_.parts[i].box, b_.parts[j].box) - rounding_, i, j, false});
    std::priority_queue<Candidate> waiting({}, std::move(all));
    while (!waiting.empty() && waiting.top().lower <= least_) {
      Candidate c = waiting.top();
      waiting.pop();
      if (!c.is_looked_at) {
        c.lower = std::max(c.lower, gap_along_rough_direction(c));
        c.is_looked_at = true;
        waiting.push(c);
      } else if (!is_proved_no_nearer(c)) {
        solve_exactly(c);
        if (best_->cores_overlap) break;
      }
    }
    return std::move(*best_);
  }

 private:
  struct Candidate {
    double lower;  // of the cores' distance
    std::uint32_t a, b;
    bool is_looked_at;                                                            // not by boxes alone
    bool operator<(const Candidate& other) const { return lower > other.lower; }  // the least is on top
  };

  double gap_along_rough_direction(const Candidate& c) const {
    const std::vector<Vec3d>&a = a_.parts[c.a].rough, &b = b_.parts[c.b].rough;
    const Vec3d n = rough_direction(a, b);
    const double length = norm(n);
    if (!(length > 1e-150 && length < 1e150)) return -kInf;
    double low = kInf, high = -kInf;
    for (const Vec3d& v : a) high = std::max(high, dot(n, v));
    for (const Vec3d& v : b) low = std::min(low, dot(n, v));
    return (low - high) / length - rounding_;
  }
  /// By the direction of the best so far, which suffices for all that share its nearest points.
  bool is_proved_no_nearer(const Candidate& c) const {
    return best_ && exact_gap_along(a_.convex_part(c.a), a_.X, b_.convex_part(c.b), b_.X, best_->direction)
                            .compare(best_->distance) >= 0;
  }
  void solve_exactly(const Candidate& c) {
    Result r = exact_distance(a_.convex_part(c.a), a_.X, b_.convex_part(c.b), b_.X, false);
    if (best_ && r.distance.compare(best_->distance) >= 0) return;
    for (VertexPair& v : r.simplex) v = {a_.parts[c.a].places[v.a], b_.parts[c.b].places[v.b]};
    Value core = r.distance;
    core.radius = 0;
    least_ = core.upper();
    best_ = std::move(r);
  }

  const PosedBody &a_, &b_;
  double rounding_, least_ = kInf;
  std::optional<Result> best_;
};

/// Intersection of the line through the origin along d with a triangle: nothing at an edge or a vertex. Returns the
/// sign of n . d of the triangle's normal n, if it is met at a positive multiple of d; otherwise 0.
std::optional<int> crossing(const std::array<Vec3z, 3>& t, const Vec3z& d) {
  const Vec3z n0 = cross(t[0], t[1]), n1 = cross(t[1], t[2]), n2 = cross(t[2], t[0]);
  const int s0 = sgn(dot(d, n0)), s1 = sgn(dot(d, n1)), s2 = sgn(dot(d, n2));
  const int low = std::min({s0, s1, s2}), high = std::max({s0, s1, s2});
  if (low < 0 && high > 0) return 0;
  if (low == 0 && high == 0 && squared_norm(Vec3z(n0 + n1 + n2)) == 0) return 0;  // no area
  if (s0 == 0 || s1 == 0 || s2 == 0) return std::nullopt;
  const int height = sgn(dot(n0, t[2]));  // of the plane along n, so that the line is at height / (n . d)
  if (height == 0) return std::nullopt;   // the origin is on the triangle
  return height == s0 ? s0 : 0;
}

/// Winding number of triangles around the origin.
/// \param at returns the position of a vertex
template <class At>
int winding_of(std::span<const Triangle> triangles, At&& at) {
  std::map<std::uint32_t, Vec3z> vertices;
  for (const Triangle& t : triangles)
    for (const std::uint32_t i : t)
      if (!vertices.contains(i)) vertices.emplace(i, at(i));
  std::mt19937 random(1);
  const auto draw = [&] { return mpz_class(static_cast<long>(random() % 20001) - 10000); };
  for (int attempt = 0; attempt < 50; ++attempt) {
    const Vec3z d{draw(), draw(), draw()};
    int winding = 0;
    bool is_generic = true;
    for (std::size_t i = 0; i < triangles.size() && is_generic; ++i) {
      const Triangle& t = triangles[i];
      const std::optional<int> c = crossing({vertices.at(t[0]), vertices.at(t[1]), vertices.at(t[2])}, d);
      is_generic = c.has_value();
      winding += c.value_or(0);
    }
    if (is_generic) return winding;
  }
  throw std::invalid_argument("exact_winding_number: the point lies on a triangle");
}

/// A vertex of each connected component of a body. Equal positions are connected.
std::vector<std::uint32_t> one_of_each_component(const BodyView& body) {
  if (body.triangles.empty()) return {0};
  using Position = std::tuple<double, double, double>;
  std::map<Position, std::uint32_t> first;  // vertex of a position
  std::vector<std::uint32_t> component(body.vertices.size());
  for (std::uint32_t i = 0; i < component.size(); ++i) {
    const Vec3d& v = body.vertices[i];
    component[i] = first.emplace(Position{v.x, v.y, v.z}, i).first->second;
  }
  for (bool changed = true; std::exchange(changed, false);)
    for (const Triangle& t : body.triangles) {
      const std::uint32_t least = std::min({component[t[0]], component[t[1]], component[t[2]]});
      for (const std::uint32_t i : t) {
        const std::uint32_t own = component[i];
        if (own == least) continue;
        std::replace(component.begin(), component.end(), own, least);
        changed = true;
      }
    }
  std::vector<std::uint32_t> chosen;
  std::map<std::uint32_t, bool> seen;
  for (const Triangle& t : body.triangles)
    if (!std::exchange(seen[component[t[0]]], true)) chosen.push_back(t[0]);
  return chosen;
}

/// Whether a component of `inner`, no triangle of which meets one of `outer`, is inside of that.
bool is_inside(const PosedBody& inner, const PosedBody& outer, double rounding) {
  if (!outer.view.is_solid || outer.view.triangles.empty()) return false;
  if (gap_of(inner.box, outer.box) > rounding) return false;
  const Difference C(outer.hull(), outer.X, inner.hull(), inner.X);
  for (const std::uint32_t i : one_of_each_component(inner.view))
    if (winding_of(outer.view.triangles, [&](std::uint32_t j) { return -C.at({j, i}).c; }) != 0) return true;
  return false;
}

}  // namespace

Result exact_distance(const BodyView& a, const Pose& X_wa, const BodyView& b, const Pose& X_wb) {
  const Vec3d apart = X_wb.translation - X_wa.translation;
  // In doubles the error of a position is below 16 units of rounding of all its inputs, that of a gap those of two
  // positions and as many again.
  const double rounding = 0x1p-46 * (norm(apart) + reach(a.vertices) + reach(b.vertices));
  const PosedBody posed_a(a, X_wa, {0, 0, 0}), posed_b(b, X_wb, apart);
  Result r = NearestParts(posed_a, posed_b, rounding).solve();
  if (r.cores_overlap || !(is_inside(posed_b, posed_a, rounding) || is_inside(posed_a, posed_b, rounding))) return r;
  Result inside;
  inside.cores_overlap = true;
  inside.distance.radius = r.distance.radius;
  return inside;
}

int exact_winding_number(const BodyView& body, const Pose& X_wb, const Vec3d& p) {
  const Difference C({body.vertices, 0}, X_wb, {std::span(&p, 1), 0}, {});
  return winding_of(body.triangles, [&](std::uint32_t i) { return -C.at({i, 0}).c; });
}

}  // namespace clearance::exact
