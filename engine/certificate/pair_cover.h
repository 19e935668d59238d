// Two bodies of which one is not convex, in parts: each two parts wait for a direction that takes them apart.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "engine/certificate/certificate_text.h"

namespace clearance {

/// All pairs of elements and pieces of two bodies, as pairs of parts. Begins with both bodies whole; whoever finds no
/// direction for two parts has them halved.
class PairCover {
 public:
  /// Both must outlive this.
  PairCover(const Body& a, const Body& b) : sides_{Side(a), Side(b)} {}

  void begin() { open_.assign(1, {sides_[0].whole(), sides_[1].whole()}); }
  bool is_done() const { return open_.empty(); }
  /// Two parts of which nothing is known yet, as convex pieces. They stay until parts() is called again.
  struct Parts {
    const Piece *a, *b;  ///< null: it is no single one
    bool are_elements;   ///< or pieces that are the truth: they have no halves
    PieceProof claim;    ///< which of both bodies' pieces they are
    bool are_pieces() const { return a && b; }
  };
  Parts parts();
  /// What is to be known of the last parts() is known.
  void settle() { open_.pop_back(); }
  /// Halves of the larger one take their place. Not of elements.
  void halve();

 private:
  static constexpr std::uint32_t kAll = kNone;         // of `piece`: the whole body
  static constexpr std::uint32_t kElement = 1u << 31;  // of `at`: an element, no node

  // A body, a piece of it, or a node or an element of the piece's surface.
  struct Part {
    std::uint32_t piece, at;
    friend auto operator<=>(const Part&, const Part&) = default;
  };
  // One as a convex piece, and which pieces of the body it is, where elements count as such.
  struct PartHull {
    const Piece* piece;  // null: it is not one
    std::uint32_t place, count;
  };
  // One of the two bodies.
  class Side {
   public:
    explicit Side(const Body& body) : body_(body) {}
    Part whole() const { return {body_.pieces.size() == 1 ? 0 : kAll, kNone}; }
    /// Holds until another is asked for.
    PartHull hull(const Part& part);
    /// What it consists of; none: it is an element, or a piece that is the truth.
    std::vector<Part> halves(const Part& part) const;

   private:
    const Surface* surface(const Part& part) const;
    const Piece& around(const Part& part, std::uint32_t begin, std::uint32_t end);

    const Body& body_;
    std::map<Part, Piece> large_;
    Piece small_;
    Part of_small_{kNone, kNone};
  };

  std::array<Side, 2> sides_;
  std::vector<std::array<Part, 2>> open_;
};

}  // namespace clearance
