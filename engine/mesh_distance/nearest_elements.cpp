#include "engine/mesh_distance/nearest_elements.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/base/arithmetic.h"
#include "engine/bvh/surface.h"
#include "engine/hull/primitive.h"
#include "engine/hull/support.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// Rounding units of a gap: of the rotation, its products and the sums (docs/bounds.md, surfaces).
constexpr double kGapUnits = 256 * 0x1p-53;
constexpr std::uint64_t kOpenedPerUnit = 4, kReachedPerUnit = 16;
// Levels that known_reach() descends: at most 4096 nodes, and 64 of a cloud, whose boxes are less tight.
constexpr int kLevels = 12, kLevelsOfCloud = 6;
constexpr std::uint32_t kMostCorners = 64;  // maximum for a part whose corners are tested one by one

Vec3d absolute(const Vec3d& v) {
  return {std::abs(v.x), std::abs(v.y), std::abs(v.z)};
}
// Slab of a node; null for anything else.
const Surface::Slab* slab_of(const Body& body, std::uint32_t convex_part, std::uint32_t at) {
  if (at >> 31) return nullptr;
  const Surface& surface = *body.parts[convex_part]->surface;
  return surface.is_cloud() ? nullptr : &surface.slabs()[at];
}
// Reach of a slab along a multiple of its normal.
double reach_across(const Surface::Slab& slab, double times, const Vec3d& centre) {
  return times * (dot(slab.normal(), centre) + double{times > 0 ? slab.high : slab.low});
}
// Squared diagonal of the node's box. Only serves to compare two sizes, so that rounding is harmless.
float squared_size(const Surface::Node& node) {
  float sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += (node.high[k] - node.low[k]) * (node.high[k] - node.low[k]);
  return sum;
}
double above_zero(double x) {
  return x > 0 ? x : 0;  // also for a NaN, as of a box without bounds
}

}  // namespace

const ConvexPart& part_of(const Body& body, const Element& element, ConvexPart& storage) {
  const ConvexPart& convex_part = *body.parts[element.part];
  if (element.triangle == kNone) return convex_part;
  remake_part(storage, convex_part.surface->element(element.triangle).span(), convex_part.radius);
  return storage;
}

void NearestElements::begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b) {
  a_ = &a;
  b_ = &b;
  R_wa_ = pose_a.R_wb;
  R_ = pose_a.R_wb.transpose_times(pose_b.R_wb);
  D_ = pose_a.R_wb.transpose_times(pose_b.t_w - pose_a.t_w);
  for (int k = 0; k < 3; ++k) R_ba_.row[k] = {R_.row[0][k], R_.row[1][k], R_.row[2][k]};
  D_ba_ = -(R_ba_ * D_);
  error_ = kGapUnits * (norm(D_) + a.reach + b.reach) + Arithmetic<double>::kUnderflowLength;
  plane_ = is_half_space(*a.parts[0]) ? Plane::kA : is_half_space(*b.parts[0]) ? Plane::kB : Plane::kNeither;
  looks_ = 0;
  looks_deep_ = false;
  reached_ = 0;
  left_out_ = kInf;
  open_.clear();
  const auto first = [](const ConvexPartPtr& convex_part) { return convex_part->surface ? 0 : kNone; };
  for (std::uint32_t i = 0; i < a.parts.size(); ++i)
    for (std::uint32_t j = 0; j < b.parts.size(); ++j) {
      Entry e{0, i, first(a.parts[i]), j, first(b.parts[j]), 0};
      e.gap = gap_of(e, bounds_a(e), bounds_b(e));
      put(e, kInf);
    }
}

NearestElements::NodeBounds NearestElements::bounds(const Body& body, std::uint32_t convex_part, std::uint32_t at) {
  const ConvexPart& p = *body.parts[convex_part];
  if (at == kNone) return {p.centre, p.half};
  const Surface& surface = *p.surface;
  if (is_element(at)) {
    if (surface.is_cloud()) {
      const double half = 0.5 * double{surface.edge()} + surface.rounding();
      return {surface.point(at & ~kTriangle), {half, half, half}};
    }
    const auto [u, v, w] = surface.corners(at & ~kTriangle);
    NodeBounds bounds;
    for (int k = 0; k < 3; ++k) {
      const double low = std::min({u[k], v[k], w[k]}), high = std::max({u[k], v[k], w[k]});
      bounds.centre[k] = 0.5 * low + 0.5 * high;
      bounds.half[k] = 0.5 * high - 0.5 * low;
    }
    return bounds;
  }
  const Surface::Node& node = surface.nodes()[at];
  NodeBounds bounds;
  for (int k = 0; k < 3; ++k) {
    const double low = node.low[static_cast<std::size_t>(k)], high = node.high[static_cast<std::size_t>(k)];
    bounds.centre[k] = surface.centre()[k] + (0.5 * low + 0.5 * high);
    bounds.half[k] = 0.5 * high - 0.5 * low;
  }
  return bounds;
}

// \param storage for the corners of a triangle
PartBounds NearestElements::part_bounds(const Body& body, std::uint32_t convex_part, std::uint32_t at,
                                        const NodeBounds& bounds, std::array<Vec3d, 3>& storage) {
  const ConvexPart& whole = *body.parts[convex_part];
  PartBounds part{bounds.centre, bounds.half};
  if (at == kNone) {
    if (!whole.primitive && whole.count() <= kMostCorners) part.corners = whole.vertices;
  } else if (is_element(at) && !whole.surface->is_cloud()) {
    storage = whole.surface->corners(at & ~kTriangle);
    part.corners = storage;
    const Vec3d normal = cross(storage[1] - storage[0], storage[2] - storage[0]);
    if (const double length = norm(normal); length > 0 && length < kInf) {
      part.normal = normal * (1 / length);
      const double at_corner[] = {dot(part.normal, storage[0]), dot(part.normal, storage[1]),
                                  dot(part.normal, storage[2])};
      part.low = std::min({at_corner[0], at_corner[1], at_corner[2]});
      part.high = std::max({at_corner[0], at_corner[1], at_corner[2]});
    }
  } else if (const Surface::Slab* const slab = slab_of(body, convex_part, at)) {
    part.normal = slab->normal();
    const double centre = dot(part.normal, body.parts[convex_part]->surface->centre());
    part.low = centre + double{slab->low};
    part.high = centre + double{slab->high};
  }
  return part;
}

NearestElements::NodeBounds NearestElements::before_a(const NodeBounds& of_b) const {
  NodeBounds turned{R_ * of_b.centre + D_, {}};
  for (int k = 0; k < 3; ++k) turned.half[k] = dot(absolute(R_.row[k]), of_b.half);
  return turned;
}

// Difference of a gap between cores and the one between grown elements, as computed.
double NearestElements::margin(const Entry& e) const {
  return a_->parts[e.part_a]->radius + b_->parts[e.part_b]->radius + error_;
}

// Gap of two parts, or of anything and a half-space: from boxes in the axes of a, and along the line of their centres.
// \param b in its own axes
double NearestElements::gap_of(const Entry& e, const NodeBounds& a, const NodeBounds& b) const {
  if (plane_ != Plane::kNeither) {  // it has no box, and its plane's normal is the only direction
    const Vec3d z{0, 0, 1};
    if (plane_ == Plane::kA) return std::max(e.gap, gap_along(e, a, b, z, R_.transpose_times(z)));
    return std::max(e.gap, gap_along(e, a, b, R_ * -z, -z));
  }
  const NodeBounds turned = before_a(b);
  const Vec3d d = turned.centre - a.centre;
  Vec3d apart;
  for (int k = 0; k < 3; ++k) apart[k] = above_zero(std::abs(d[k]) - (a.half[k] + turned.half[k]));
  const double gap = above_zero(norm(apart) - margin(e)), length = norm(d);
  if (!(length > 0 && length < kInf)) return gap;
  const Vec3d n = d * (1 / length);
  return std::max(gap, gap_along(e, a, b, n, R_.transpose_times(n)));
}

// Reach of a subtree along a direction, in the axes of its body: of the triangles in a leaf, and of the box otherwise.
double NearestElements::reach(const Body& body, std::uint32_t convex_part, std::uint32_t at, const NodeBounds& box,
                              const Vec3d& n) {
  const Surface* const surface = body.parts[convex_part]->surface.get();
  const auto of_elements = [&](std::uint32_t begin, std::uint32_t end) {
    double most = -kInf;
    if (surface->is_cloud()) {
      const double half = 0.5 * double{surface->edge()} + surface->rounding();
      for (std::uint32_t i = begin; i < end; ++i) most = std::max(most, dot(n, surface->point(i)));
      return most + half * (std::abs(n.x) + std::abs(n.y) + std::abs(n.z));
    }
    for (std::uint32_t t = begin; t < end; ++t)
      for (const std::uint32_t corner : surface->triangles()[t])
        most = std::max(most, dot(n, surface->vertices()[corner]));
    return most;
  };
  if (at != kNone && is_element(at)) return of_elements(at & ~kTriangle, (at & ~kTriangle) + 1);
  if (at != kNone && surface->nodes()[at].is_leaf())
    return of_elements(surface->nodes()[at].begin(), surface->nodes()[at].end());
  const double by_box = dot(n, box.centre) + dot(absolute(n), box.half);
  if (at == kNone || surface->is_cloud()) return by_box;
  // The component of n along the slab's normal reaches no farther than its plane, and the rest of n no farther than the
  // box.
  const Surface::Slab& slab = surface->slabs()[at];
  const Vec3d m = slab.normal();
  const double along = dot(n, m);
  const Vec3d rest = n - along * m;
  return std::min(by_box,
                  dot(rest, box.centre) + dot(absolute(rest), box.half) + reach_across(slab, along, surface->centre()));
}

// \param n_a,n_b the direction in the axes of both, of length 1 up to rounding
double NearestElements::gap_along(const Entry& e, const NodeBounds& a, const NodeBounds& b, const Vec3d& n_a,
                                  const Vec3d& n_b) const {
  const double far_a = reach(*a_, e.part_a, e.at_a, a, n_a), far_b = reach(*b_, e.part_b, e.at_b, b, -n_b);
  return above_zero(((dot(n_a, D_) - far_b) - far_a) * (1 - 0x1p-45) - margin(e));
}

// reach() of a subtree along the known direction, tighter than that of its box, since it descends some levels. Most
// subtrees are skipped, since their boxes reach less far than the result so far.
// \param by_bounds reach() by its own box
double NearestElements::known_reach(bool of_a, std::uint32_t convex_part, std::uint32_t at, double by_bounds,
                                    int levels) const {
  if (is_element(at) || levels <= 0) return by_bounds;
  Reach& known = reaches_[(at * 2654435761u + convex_part * 40503u + of_a) % kReaches];
  if (known.direction == directions_ && known.at == at && known.part == convex_part && known.of_a == of_a)
    return known.reach;
  const Body& body = of_a ? *a_ : *b_;
  const Surface& surface = *body.parts[convex_part]->surface;
  const Vec3d n = of_a ? n_a_ : -n_b_;
  double most = -kInf;
  if (surface.nodes()[at].is_leaf()) {
    most = reach(body, convex_part, at, {}, n);
  } else {
    ++reached_;
    const NodesBelow below(surface, at);
    PartColumn far;
    part_reaches(below.columns, n, far);
    for (std::uint32_t left = below.count; left > 0; --left) {
      std::uint32_t farthest = 0;
      for (std::uint32_t k = 1; k < below.count; ++k)
        if (far[k] > far[farthest]) farthest = k;
      if (!(far[farthest] > most)) break;
      most = std::max(most, known_reach(of_a, convex_part, below.at[farthest], far[farthest], levels - 2));
      far[farthest] = -kInf;
    }
  }
  known = {directions_, convex_part, at, of_a, most};
  return most;
}

double NearestElements::known_reach(bool of_a, std::uint32_t convex_part, std::uint32_t at,
                                    const NodeBounds& box) const {
  const Body& body = of_a ? *a_ : *b_;
  if (at == kNone) {
    Reach& known = reaches_[(convex_part * 2 + of_a) % kReaches];
    if (known.direction != directions_ || known.at != at || known.part != convex_part || known.of_a != of_a)
      known = {directions_, convex_part, at, of_a, support(*body.parts[convex_part], of_a ? n_a_ : -n_b_).value};
    return known.reach;
  }
  return known_reach(of_a, convex_part, at, reach(body, convex_part, at, box, of_a ? n_a_ : -n_b_),
                     levels(body, convex_part));
}

// Levels to descend.
int NearestElements::levels(const Body& body, std::uint32_t convex_part) const {
  const Surface* const surface = body.parts[convex_part]->surface.get();
  return !looks_deep_ ? 0 : surface && surface->is_cloud() ? kLevelsOfCloud : kLevels;
}

double NearestElements::gap_known(const Entry& e, double far_a, double far_b) const {
  return above_zero(((dot(n_a_, D_) - far_b) - far_a) * (1 - 0x1p-45) - margin(e));
}

double NearestElements::gap_known(const Entry& e, const NodeBounds& a, const NodeBounds& b) const {
  return gap_known(e, known_reach(true, e.part_a, e.at_a, a), known_reach(false, e.part_b, e.at_b, b));
}

void NearestElements::look_along(const Vec3d& n_w) {
  if (plane_ != Plane::kNeither || !(std::abs(norm(n_w) - 1) < 0x1p-46)) return;
  ++looks_;
  ++directions_;
  n_a_ = R_wa_.transpose_times(n_w);
  n_b_ = R_.transpose_times(n_a_);
}

void NearestElements::put(const Entry& entry, double cut_off) {
  if (entry.gap > cut_off) {
    left_out_ = std::min(left_out_, entry.gap);
    return;
  }
  open_.put(entry);
}

// Divides the larger of both.
// \param each receives the children, each with its gap, exact as long as it is no greater than the cut-off
template <class Each>
void NearestElements::open(const Entry& e, double cut_off, const Each& each) const {
  const auto node_of = [](const Body& body, std::uint32_t convex_part, std::uint32_t at) {
    return is_element(at) ? nullptr : &body.parts[convex_part]->surface->nodes()[at];
  };
  const auto is_of_mesh = [](const Body& body, std::uint32_t convex_part, std::uint32_t at) {
    return at != kNone && !body.parts[convex_part]->surface->is_cloud();
  };
  const Surface::Node *const a = node_of(*a_, e.part_a, e.at_a), *const b = node_of(*b_, e.part_b, e.at_b);
  const bool divides_a = a && !a->is_leaf(), divides_b = b && !b->is_leaf();
  const bool opens_a = divides_a != divides_b ? divides_a
                       : a && b               ? !(squared_size(*a) < squared_size(*b))
                                              : a != nullptr;
  if (plane_ == Plane::kNeither) {
    if (divides_a || divides_b) return divide<NodesBelow>(e, opens_a, cut_off, each);
    if (is_of_mesh(*a_, e.part_a, e.at_a) && is_of_mesh(*b_, e.part_b, e.at_b)) return pair_triangles(e, a, b, each);
    return divide<ElementsBelow>(e, opens_a, cut_off, each);
  }
  const NodeBounds bounds_of_a = bounds_a(e), bounds_of_b = bounds_b(e);
  const auto with = [&](std::uint32_t child) {
    Entry part = e;
    (opens_a ? part.at_a : part.at_b) = child;
    part.gap = opens_a ? gap_of(part, bounds_a(part), bounds_of_b) : gap_of(part, bounds_of_a, bounds_b(part));
    each(part);
  };
  const Surface::Node& node = opens_a ? *a : *b;
  if (node.is_leaf()) {
    for (std::uint32_t t = node.begin(); t < node.end(); ++t) with(t | kTriangle);
  } else {
    with((opens_a ? e.at_a : e.at_b) + 1);
    with(node.right);
  }
}

NearestElements::NodesBelow::NodesBelow(const Surface& surface, std::uint32_t node) {
  for (const std::uint32_t child : {node + 1, surface.nodes()[node].right}) {
    const Surface::Node& half = surface.nodes()[child];
    at[count++] = half.is_leaf() ? child : child + 1;
    if (!half.is_leaf()) at[count++] = half.right;
  }
  columns.take(surface, at, count);
}

NearestElements::ElementsBelow::ElementsBelow(const Surface& surface, std::uint32_t leaf) {
  const std::uint32_t begin = surface.nodes()[leaf].begin(), end = surface.nodes()[leaf].end();
  count = end - begin;
  for (std::uint32_t k = 0; k < count; ++k) at[k] = (begin + k) | kTriangle;
  columns.take(surface, begin, end);
}

// A leaf of the other side that is larger than the divided node is split into triangles: next to a mesh of small
// triangles its box is mostly empty.
template <class Below, class Each>
void NearestElements::divide(const Entry& e, bool opens_a, double cut_off, const Each& each) const {
  const Body &body = opens_a ? *a_ : *b_, &other = opens_a ? *b_ : *a_;
  const std::uint32_t convex_part = opens_a ? e.part_a : e.part_b, at = opens_a ? e.at_a : e.at_b,
                      other_part = opens_a ? e.part_b : e.part_a, other_at = opens_a ? e.at_b : e.at_a;
  const Surface& surface = *body.parts[convex_part]->surface;
  const Below below(surface, at);
  PartColumn far;
  if (looks_) part_reaches(below.columns, opens_a ? n_a_ : -n_b_, far);
  const auto before = [&](std::uint32_t before_at) {
    const NodeBounds other_bounds = bounds(other, other_part, before_at);
    std::array<Vec3d, 3> storage;
    PartColumn gaps;
    part_gaps(below.columns, part_bounds(other, other_part, before_at, other_bounds, storage), opens_a ? R_ : R_ba_,
              opens_a ? D_ : D_ba_, cut_off + margin(e), gaps);
    const double other_far = looks_ ? known_reach(!opens_a, other_part, before_at, other_bounds) : 0;
    for (std::uint32_t k = 0; k < below.count; ++k) {
      Entry part = e;
      (opens_a ? part.at_a : part.at_b) = below.at[k];
      (opens_a ? part.at_b : part.at_a) = before_at;
      part.gap = std::max(e.gap, above_zero(gaps[k] - margin(e)));
      if (looks_ && part.gap <= cut_off) {
        const double own = known_reach(opens_a, convex_part, below.at[k], far[k], levels(body, convex_part));
        part.gap = std::max(part.gap, opens_a ? gap_known(part, own, other_far) : gap_known(part, other_far, own));
      }
      each(part);
    }
  };
  if (is_element(other_at)) return before(other_at);
  const Surface& others = *other.parts[other_part]->surface;
  const Surface::Node& node = others.nodes()[other_at];
  if (!node.is_leaf() || others.is_cloud() || squared_size(node) < squared_size(surface.nodes()[at]))
    return before(other_at);
  for (std::uint32_t t = node.begin(); t < node.end(); ++t) before(t | kTriangle);
}

// Pairs the triangles of two leaves, each with each.
// \param leaf_a,leaf_b null for a single triangle
template <class Each>
void NearestElements::pair_triangles(const Entry& e, const Surface::Node* leaf_a, const Surface::Node* leaf_b,
                                     const Each& each) const {
  struct Range {
    std::uint32_t begin, end;
  };
  const auto range_of = [](const Surface::Node* leaf, std::uint32_t at) {
    return leaf ? Range{leaf->begin(), leaf->end()} : Range{at & ~kTriangle, (at & ~kTriangle) + 1};
  };
  const Surface &of_a = *a_->parts[e.part_a]->surface, &of_b = *b_->parts[e.part_b]->surface;
  const Range range_a = range_of(leaf_a, e.at_a), range_b = range_of(leaf_b, e.at_b);
  const Vec3d d = before_a(bounds_b(e)).centre - bounds_a(e).centre;
  const double length = norm(d);
  const Vec3d directions[2] = {looks_ ? n_a_ : Vec3d{0, 0, 0}, length > 0 && length < kInf ? d * (1 / length) : d * 0};
  ElementColumns columns_a, columns_b;
  columns_a.take(of_a, range_a.begin, range_a.end);
  columns_b.take(of_b, range_b.begin, range_b.end);
  PartColumn gaps[kPartLanes];
  triangle_gaps(columns_a, columns_b, R_, D_, directions, gaps);
  for (std::uint32_t j = range_b.begin; j < range_b.end; ++j)
    for (std::uint32_t i = range_a.begin; i < range_a.end; ++i) {
      Entry part = e;
      part.at_a = i | kTriangle;
      part.at_b = j | kTriangle;
      part.gap = std::max(e.gap, above_zero(gaps[j - range_b.begin][i - range_a.begin] - margin(e)));
      each(part);
    }
}

ElementPair NearestElements::parts() const {
  const Entry& e = open_.front();
  return {e.gap, {e.part_a, kNone}, {e.part_b, kNone}};
}

bool NearestElements::is_one_within() const {
  const NodeBounds a = bounds_a(open_.front()), b = bounds_b(open_.front());
  const auto holds = [](const NodeBounds& outer, const Vec3d& centre, const Vec3d& half) {
    for (int k = 0; k < 3; ++k)
      if (!(std::abs(centre[k] - outer.centre[k]) + half[k] < outer.half[k])) return false;
    return true;
  };
  const NodeBounds turned = before_a(b);
  Vec3d half;
  for (int k = 0; k < 3; ++k) half[k] = dot(absolute(R_ba_.row[k]), a.half);
  return holds(a, turned.centre, turned.half) || holds(b, R_ba_ * a.centre + D_ba_, half);
}

void NearestElements::touching_parts(std::vector<ElementPair>& others) const {
  open_.each_behind([&](const Entry& e) {
    if (!(e.gap > 0)) others.push_back({e.gap, {e.part_a, kNone}, {e.part_b, kNone}});
  });
}

void NearestElements::take_parts(double lower) {
  looks_deep_ = lower > 0;  // without a direction that separates all, one helps for a few triangles only
  Entry e = open_.pop();
  e.gap = std::max(e.gap, lower);
  put(e, kInf);
}

// Descends by the nearest boxes and, among touching ones, by their centres. Skipped nodes stay in the queue.
bool NearestElements::take_near(double cut_off, ElementPair& pair) {
  if (open_.empty() || open_.front().gap > cut_off) return false;
  Entry at = open_.pop();
  const double known = at.gap;  // of all below, so it does not rank them
  const auto middles = [&](const Entry& e) { return squared_norm(before_a(bounds_b(e)).centre - bounds_a(e).centre); };
  const auto pass_by = [&](Entry e) {
    e.gap = std::max(e.gap, known);
    put(e, cut_off);
  };
  while (!is_element(at.at_a) || !is_element(at.at_b)) {
    Entry best = at;
    bool is_there = false;
    at.gap = 0;
    at.looked = looks_;
    open(at, cut_off, [&](const Entry& part) {
      const bool is_nearer =
          !is_there || part.gap < best.gap || (part.gap == best.gap && middles(part) < middles(best));
      if (is_there) pass_by(is_nearer ? best : part);
      if (is_nearer) best = part;
      is_there = true;
    });
    if (best.gap > cut_off) {
      pass_by(best);
      return false;
    }
    at = best;
  }
  pair = {std::max(at.gap, known), element(at.part_a, at.at_a), element(at.part_b, at.at_b)};
  return true;
}

NearestElements::Found NearestElements::next(double cut_off, WorkMeter& meter, ElementPair& pair) {
  for (std::uint64_t opened = 1; !open_.empty() && open_.front().gap <= cut_off; ++opened) {
    Entry e = open_.pop();
    if (const double along = e.looked == looks_ ? 0 : gap_known(e, bounds_a(e), bounds_b(e)); along > e.gap) {
      e.gap = along;  // it may no longer be the first
      e.looked = looks_;
      put(e, cut_off);
      continue;
    }
    if (is_element(e.at_a) && is_element(e.at_b)) {
      pair = {e.gap, element(e.part_a, e.at_a), element(e.part_b, e.at_b)};
      return Found::kPair;
    }
    open(e, cut_off, [&](Entry part) {
      part.looked = looks_;
      put(part, cut_off);
    });
    if (opened % kOpenedPerUnit != 0 && reached_ < kReachedPerUnit) continue;
    meter.count(1 + std::exchange(reached_, 0) / kReachedPerUnit);
    if (meter.is_over()) return Found::kPaused;
  }
  return Found::kNoMore;
}

}  // namespace clearance
