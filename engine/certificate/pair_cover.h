// Two bodies, at least one of them non-convex, as pairs of parts that need separating directions.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "engine/certificate/certificate_text.h"

namespace clearance {

/// Covers all pairs of elements and convex parts of two bodies by pairs of parts. Starts with both bodies whole; a pair
/// without a separating direction is to be halved.
class PairCover {
 public:
  /// Both must outlive this.
  PairCover(const Body& a, const Body& b) : sides_{Side(a), Side(b)} {}

  void begin() { open_.assign(1, {sides_[0].whole(), sides_[1].whole()}); }
  bool is_done() const { return open_.empty(); }
  /// Two parts that are not resolved yet, as convex parts. Valid until parts() is called again.
  struct Parts {
    const ConvexPart *a, *b;  ///< null if it is not a single convex part
    bool are_elements;        ///< elements, or convex parts that are exact geometry: they have no halves
    PartProof claim;          ///< the parts of both bodies that the claim covers
    bool are_parts() const { return a && b; }
  };
  Parts parts();
  /// Marks the last parts() as resolved.
  void pop() { open_.pop_back(); }
  /// Replaces the larger part by its halves. Not for elements.
  void halve();

 private:
  static constexpr std::uint32_t kAll = kNone;         // of `convex_part`: the whole body
  static constexpr std::uint32_t kElement = 1u << 31;  // of `at`: an element instead of a node

  // A body, one of its convex parts, or a node or element of the part's surface.
  struct Part {
    std::uint32_t convex_part, at;
    friend auto operator<=>(const Part&, const Part&) = default;
  };
  // A part's convex hull, and the range of the body's parts that it covers; elements count as parts.
  struct PartHull {
    const ConvexPart* convex_part;  // null if the part has no convex hull
    std::uint32_t place, count;
  };
  // One of the two bodies.
  class Side {
   public:
    explicit Side(const Body& body) : body_(body) {}
    Part whole() const { return {body_.parts.size() == 1 ? 0 : kAll, kNone}; }
    /// Valid until the next call.
    PartHull hull(const Part& part);
    /// The components of a part; empty for an element, or a convex part that is exact geometry.
    std::vector<Part> halves(const Part& part) const;

   private:
    const Surface* surface(const Part& part) const;
    const ConvexPart& around(const Part& part, std::uint32_t begin, std::uint32_t end);

    const Body& body_;
    std::map<Part, ConvexPart> large_;
    ConvexPart small_;
    Part of_small_{kNone, kNone};
  };

  std::array<Side, 2> sides_;
  std::vector<std::array<Part, 2>> open_;
};

}  // namespace clearance
