#include "engine/mesh_distance/nearest_elements.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/bvh/surface.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kOpenedPerUnit = 4, kReachedPerUnit = 16;

// Squared diagonal of the node's box. Only serves to compare two sizes, so that rounding is harmless.
float squared_size(const Surface::Node& node) {
  float sum = 0;
  for (std::size_t k = 0; k < 3; ++k) sum += (node.high[k] - node.low[k]) * (node.high[k] - node.low[k]);
  return sum;
}
// Null for an element.
const Surface::Node* node_of(const Body& body, Subtree subtree) {
  return subtree.is_element() ? nullptr : &body.parts[subtree.part]->surface->nodes()[subtree.at];
}
bool is_of_mesh(const Body& body, Subtree subtree) {
  return subtree.at != kNone && !body.parts[subtree.part]->surface->is_cloud();
}
Element element(Subtree subtree) {
  return {subtree.part, subtree.at == kNone ? kNone : subtree.at & ~Subtree::kElement};
}
ElementPair parts_of(const SubtreePair& e) {
  return {e.gap, {e.a.part, kNone}, {e.b.part, kNone}};
}

}  // namespace

const ConvexPart& part_of(const Body& body, const Element& element, ConvexPart& scratch) {
  const ConvexPart& convex_part = *body.parts[element.part];
  if (element.triangle == kNone) return convex_part;
  remake_part(scratch, convex_part.surface->element(element.triangle).span(), convex_part.radius);
  return scratch;
}

void NearestElements::begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b) {
  gaps_.begin(a, pose_a, b, pose_b);
  left_out_ = kInf;
  open_.clear();
  const auto root_of = [](const Body& body, std::uint32_t part) {
    return Subtree{part, body.parts[part]->surface ? 0 : kNone};
  };
  for (std::uint32_t i = 0; i < a.parts.size(); ++i)
    for (std::uint32_t j = 0; j < b.parts.size(); ++j) {
      SubtreePair e{0, root_of(a, i), root_of(b, j), 0};
      e.gap = gaps_.gap_of(e, gaps_.bounds_a(e), gaps_.bounds_b(e));
      put(e, kInf);
    }
}

void NearestElements::put(const SubtreePair& entry, double cut_off) {
  if (entry.gap > cut_off) {
    left_out_ = std::min(left_out_, entry.gap);
    return;
  }
  open_.put(entry);
}

// Divides the larger of both.
// \param each receives the children, each with its gap, exact as long as it is no greater than the cut-off
template <class Each>
void NearestElements::open(const SubtreePair& e, double cut_off, const Each& each) const {
  const Surface::Node *const a = node_of(gaps_.a(), e.a), *const b = node_of(gaps_.b(), e.b);
  const bool divides_a = a && !a->is_leaf(), divides_b = b && !b->is_leaf();
  const bool opens_a = divides_a != divides_b ? divides_a
                       : a && b               ? !(squared_size(*a) < squared_size(*b))
                                              : a != nullptr;
  if (!gaps_.have_half_space()) {
    if (divides_a || divides_b) return divide<NodesBelow>(e, opens_a, cut_off, each);
    if (is_of_mesh(gaps_.a(), e.a) && is_of_mesh(gaps_.b(), e.b)) return pair_triangles(e, a, b, each);
    return divide<ElementsBelow>(e, opens_a, cut_off, each);
  }
  const BoxBounds bounds_of_a = gaps_.bounds_a(e), bounds_of_b = gaps_.bounds_b(e);
  const auto with = [&](std::uint32_t child) {
    SubtreePair part = e;
    (opens_a ? part.a : part.b).at = child;
    part.gap = opens_a ? gaps_.gap_of(part, gaps_.bounds_a(part), bounds_of_b)
                       : gaps_.gap_of(part, bounds_of_a, gaps_.bounds_b(part));
    each(part);
  };
  const Surface::Node& node = opens_a ? *a : *b;
  if (node.is_leaf()) {
    for (std::uint32_t t = node.begin(); t < node.end(); ++t) with(t | Subtree::kElement);
  } else {
    with((opens_a ? e.a.at : e.b.at) + 1);
    with(node.right);
  }
}

// A leaf of the other side that is larger than the divided node is split into triangles: next to a mesh of small
// triangles its box is mostly empty.
template <class Below, class Each>
void NearestElements::divide(const SubtreePair& e, bool opens_a, double cut_off, const Each& each) const {
  const Subtree opened = opens_a ? e.a : e.b, other = opens_a ? e.b : e.a;
  const Surface& surface = *gaps_.body(opens_a).parts[opened.part]->surface;
  const Below below(surface, opened.at);
  const std::uint32_t looks = gaps_.looks();
  const double margin = gaps_.margin(e);
  PartColumn far;
  if (looks) part_reaches(below.columns, gaps_.direction(opens_a), far);
  const auto before = [&](std::uint32_t before_at) {
    const Subtree partner{other.part, before_at};
    const BoxBounds partner_bounds = bounds_of(gaps_.body(!opens_a), partner);
    std::array<Vec3d, 3> scratch;
    PartColumn gaps;
    part_gaps(below.columns, part_bounds_of(gaps_.body(!opens_a), partner, partner_bounds, scratch), gaps_.R(opens_a),
              gaps_.D(opens_a), cut_off + margin, gaps);
    const double partner_far = looks ? gaps_.known_reach(!opens_a, partner, partner_bounds) : 0;
    for (std::uint32_t k = 0; k < below.count; ++k) {
      SubtreePair part = e;
      (opens_a ? part.a : part.b).at = below.at[k];
      (opens_a ? part.b : part.a).at = before_at;
      part.gap = std::max(e.gap, above_zero(gaps[k] - margin));
      if (looks && part.gap <= cut_off) {
        const double own = gaps_.known_reach(opens_a, {opened.part, below.at[k]}, far[k]);
        part.gap = std::max(
            part.gap, opens_a ? gaps_.gap_known(part, own, partner_far) : gaps_.gap_known(part, partner_far, own));
      }
      each(part);
    }
  };
  if (other.is_element()) return before(other.at);
  const Surface& others = *gaps_.body(!opens_a).parts[other.part]->surface;
  const Surface::Node& node = others.nodes()[other.at];
  if (!node.is_leaf() || others.is_cloud() || squared_size(node) < squared_size(surface.nodes()[opened.at]))
    return before(other.at);
  for (std::uint32_t t = node.begin(); t < node.end(); ++t) before(t | Subtree::kElement);
}

// Pairs the triangles of two leaves, each with each.
// \param leaf_a,leaf_b null for a single triangle
template <class Each>
void NearestElements::pair_triangles(const SubtreePair& e, const Surface::Node* leaf_a, const Surface::Node* leaf_b,
                                     const Each& each) const {
  struct Range {
    std::uint32_t begin, end;
  };
  const auto range_of = [](const Surface::Node* leaf, Subtree subtree) {
    const std::uint32_t element = subtree.at & ~Subtree::kElement;
    return leaf ? Range{leaf->begin(), leaf->end()} : Range{element, element + 1};
  };
  const Surface &of_a = *gaps_.a().parts[e.a.part]->surface, &of_b = *gaps_.b().parts[e.b.part]->surface;
  const Range range_a = range_of(leaf_a, e.a), range_b = range_of(leaf_b, e.b);
  const Vec3d d = gaps_.before_a(gaps_.bounds_b(e)).centre - gaps_.bounds_a(e).centre;
  const double length = norm(d), margin = gaps_.margin(e);
  const Vec3d directions[2] = {gaps_.looks() ? gaps_.direction(true) : Vec3d{0, 0, 0},
                               length > 0 && length < kInf ? d * (1 / length) : d * 0};
  ElementColumns columns_a, columns_b;
  columns_a.take(of_a, range_a.begin, range_a.end);
  columns_b.take(of_b, range_b.begin, range_b.end);
  PartColumn gaps[kPartLanes];
  triangle_gaps(columns_a, columns_b, gaps_.R(), gaps_.D(), directions, gaps);
  for (std::uint32_t j = range_b.begin; j < range_b.end; ++j)
    for (std::uint32_t i = range_a.begin; i < range_a.end; ++i) {
      SubtreePair part = e;
      part.a.at = i | Subtree::kElement;
      part.b.at = j | Subtree::kElement;
      part.gap = std::max(e.gap, above_zero(gaps[j - range_b.begin][i - range_a.begin] - margin));
      each(part);
    }
}

ElementPair NearestElements::parts() const {
  return parts_of(open_.front());
}

bool NearestElements::is_one_within() const {
  const BoxBounds a = gaps_.bounds_a(open_.front()), b = gaps_.bounds_b(open_.front());
  const auto holds = [](const BoxBounds& outer, const BoxBounds& inner) {
    for (int k = 0; k < 3; ++k)
      if (!(std::abs(inner.centre[k] - outer.centre[k]) + inner.half[k] < outer.half[k])) return false;
    return true;
  };
  return holds(a, gaps_.before_a(b)) || holds(b, gaps_.before_b(a));
}

void NearestElements::touching_parts(std::vector<ElementPair>& others) const {
  open_.each_behind([&](const SubtreePair& e) {
    if (!(e.gap > 0)) others.push_back(parts_of(e));
  });
}

void NearestElements::take_parts(double lower) {
  gaps_.look_deep(lower > 0);
  SubtreePair e = open_.pop();
  e.gap = std::max(e.gap, lower);
  put(e, kInf);
}

// Descends by the nearest boxes and, among touching ones, by their centres. Skipped nodes stay in the queue.
bool NearestElements::take_near(double cut_off, ElementPair& pair) {
  if (open_.empty() || open_.front().gap > cut_off) return false;
  SubtreePair at = open_.pop();
  const double known = at.gap;  // of all below, so it does not rank them
  const auto middles = [&](const SubtreePair& e) {
    return squared_norm(gaps_.before_a(gaps_.bounds_b(e)).centre - gaps_.bounds_a(e).centre);
  };
  const auto pass_by = [&](SubtreePair e) {
    e.gap = std::max(e.gap, known);
    put(e, cut_off);
  };
  while (!at.a.is_element() || !at.b.is_element()) {
    SubtreePair best = at;
    bool is_there = false;
    at.gap = 0;
    at.looked = gaps_.looks();
    open(at, cut_off, [&](const SubtreePair& part) {
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
  pair = {std::max(at.gap, known), element(at.a), element(at.b)};
  return true;
}

NearestElements::Found NearestElements::next(double cut_off, WorkMeter& meter, ElementPair& pair) {
  for (std::uint64_t opened = 1; !open_.empty() && open_.front().gap <= cut_off; ++opened) {
    SubtreePair e = open_.pop();
    if (const double along = e.looked == gaps_.looks() ? 0 : gaps_.gap_known(e); along > e.gap) {
      e.gap = along;  // it may no longer be the first
      e.looked = gaps_.looks();
      put(e, cut_off);
      continue;
    }
    if (e.a.is_element() && e.b.is_element()) {
      pair = {e.gap, element(e.a), element(e.b)};
      return Found::kPair;
    }
    open(e, cut_off, [&](SubtreePair part) {
      part.looked = gaps_.looks();
      put(part, cut_off);
    });
    if (opened % kOpenedPerUnit != 0 && gaps_.reached() < kReachedPerUnit) continue;
    meter.count(1 + gaps_.take_reached() / kReachedPerUnit);
    if (meter.is_over()) return Found::kPaused;
  }
  return Found::kNoMore;
}

}  // namespace clearance
