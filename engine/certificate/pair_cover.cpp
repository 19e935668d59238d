#include "engine/certificate/pair_cover.h"

#include <cmath>
#include <deque>

#include "engine/bvh/surface.h"

namespace clearance {

namespace {

constexpr std::uint32_t kKeptFrom = 256;     // elements; hulls of fewer are rebuilt when needed
constexpr std::uint32_t kMostListed = 2048;  // elements; more are represented by boxes
constexpr std::size_t kBoxes = 128;          // number of these boxes

// The elements of a node's subtree are [first_of(), end_of()).
std::uint32_t first_of(const Surface& surface, std::uint32_t node) {
  while (!surface.nodes()[node].is_leaf()) ++node;
  return surface.nodes()[node].begin();
}
std::uint32_t end_of(const Surface& surface, std::uint32_t node) {
  while (!surface.nodes()[node].is_leaf()) node = surface.nodes()[node].right;
  return surface.nodes()[node].end();
}

// Corners of boxes around all elements of a node: a direction that separates these separates the elements.
std::vector<Vec3d> corners_around(const Surface& surface, std::uint32_t node) {
  std::deque<std::uint32_t> left{node};  // breadth first
  std::vector<Vec3d> corners;
  while (!left.empty()) {
    const std::uint32_t at = left.front();
    const Surface::Node& n = surface.nodes()[at];
    left.pop_front();
    if (!n.is_leaf() && left.size() + corners.size() / 8 < kBoxes) {
      left.insert(left.end(), {at + 1, n.right});
      continue;
    }
    const auto side = [&](std::size_t k, bool is_high) {
      const double centre = surface.centre()[static_cast<int>(k)], by = is_high ? n.high[k] : n.low[k],
                   sum = centre + by;
      const double rounding = std::abs(sum) * 0x1p-52;
      return is_high ? sum + rounding : sum - rounding;
    };
    for (int corner = 0; corner < 8; ++corner)
      corners.push_back({side(0, corner & 1), side(1, corner & 2), side(2, corner & 4)});
  }
  return corners;
}

}  // namespace

const Surface* PairCover::Side::surface(const Part& part) const {
  return part.convex_part == kAll ? nullptr : body_.parts[part.convex_part]->surface.get();
}

// The hull of some elements, or an enclosure of it.
const ConvexPart& PairCover::Side::around(const Part& part, std::uint32_t begin, std::uint32_t end) {
  if (const auto found = large_.find(part); found != large_.end()) return found->second;
  if (part == of_small_) return small_;
  const Surface& surface = *this->surface(part);
  ConvexPart convex_part;
  convex_part.radius = body_.parts[part.convex_part]->radius;
  if (end - begin > kMostListed) convex_part.vertices = corners_around(surface, part.at);
  for (std::uint32_t i = begin; i < end && end - begin <= kMostListed; ++i) {
    const ElementCorners element = surface.element(i);
    convex_part.vertices.insert(convex_part.vertices.end(), element.span().begin(), element.span().end());
  }
  if (end - begin >= kKeptFrom) return large_.emplace(part, without_table(convex_part)).first->second;
  of_small_ = part;
  return small_ = without_table(convex_part);
}

PairCover::PartHull PairCover::Side::hull(const Part& part) {
  if (part.convex_part == kAll) return {nullptr, 0, 0};
  const Surface* const surface = this->surface(part);
  const std::uint32_t place = part_place(body_, part.convex_part);
  if (part.at == kNone) return {body_.parts[part.convex_part].get(), place, surface ? surface->size() : 1};
  const bool is_element = (part.at & kElement) != 0;
  const std::uint32_t begin = is_element ? part.at & ~kElement : first_of(*surface, part.at),
                      end = is_element ? begin + 1 : end_of(*surface, part.at);
  return {&around(part, begin, end), place + begin, end - begin};
}

std::vector<PairCover::Part> PairCover::Side::halves(const Part& part) const {
  std::vector<Part> halves;
  if (part.convex_part == kAll) {
    for (std::uint32_t i = 0; i < body_.parts.size(); ++i) halves.push_back({i, kNone});
    return halves;
  }
  const Surface* const surface = this->surface(part);
  if (!surface || (part.at != kNone && (part.at & kElement) != 0)) return halves;
  const std::uint32_t at = part.at == kNone ? 0 : part.at;
  const Surface::Node& node = surface->nodes()[at];
  if (!node.is_leaf()) return {{part.convex_part, at + 1}, {part.convex_part, node.right}};
  for (std::uint32_t i = node.begin(); i < node.end(); ++i) halves.push_back({part.convex_part, i | kElement});
  return halves;
}

PairCover::Parts PairCover::parts() {
  const auto& [of_a, of_b] = open_.back();
  const PartHull a = sides_[0].hull(of_a), b = sides_[1].hull(of_b);
  PartProof claim{a.place, b.place, {}};
  claim.count_a = a.count;
  claim.count_b = b.count;
  if (of_a == sides_[0].whole() && of_b == sides_[1].whole()) claim.part_a = claim.part_b = kNone;
  return {a.convex_part, b.convex_part, sides_[0].halves(of_a).empty() && sides_[1].halves(of_b).empty(),
          std::move(claim)};
}

void PairCover::halve() {
  const std::array<Part, 2> parts = open_.back();
  const std::array<std::vector<Part>, 2> halves{sides_[0].halves(parts[0]), sides_[1].halves(parts[1])};
  const auto spread = [&](std::size_t side) {
    const ConvexPart* const convex_part = sides_[side].hull(parts[side]).convex_part;
    return convex_part ? convex_part->spread : std::numeric_limits<double>::infinity();
  };
  const std::size_t larger = halves[0].empty() ? 1 : halves[1].empty() || spread(0) > spread(1) ? 0 : 1;
  open_.pop_back();
  for (const Part& half : halves[larger]) {
    open_.push_back(parts);
    open_.back()[larger] = half;
  }
}

}  // namespace clearance
