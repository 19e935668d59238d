// Finds what proves the bounds of two bodies of which one is not convex: directions for all pairs of their elements, of
// many at a time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "engine/query/nearest_elements.h"
#include "engine/query/row_prover.h"

namespace clearance {

/// Lower bounds by halving what the bodies consist of until a direction takes each two parts apart; the upper one by
/// the nearest elements, or by a solid that one of them lies within.
class SurfaceProver final : public RowProver {
 public:
  SurfaceProver(const Scene& scene, const EvaluateOptions& options, const Placement& here, BodyPair pair,
                const PairAnswer& answer, CertificateText& text);

 private:
  static constexpr std::uint32_t kAll = kNone;         // of `piece`: the whole body
  static constexpr std::uint32_t kElement = 1u << 31;  // of `at`: an element, no node

  // A body, a piece of it, or a node or an element of the piece's surface.
  struct Part {
    std::uint32_t piece, at;
    friend auto operator<=>(const Part&, const Part&) = default;
  };
  // A part as one convex piece, and which pieces of the body it is, where elements count as such.
  struct Bulk {
    const Piece* piece;  // null: it is not one
    std::uint32_t place, count;
  };
  // One of the two bodies.
  class Side {
   public:
    explicit Side(const Body& body) : body_(body) {}
    Part whole() const { return {body_.pieces.size() == 1 ? 0 : kAll, kNone}; }
    /// Holds until another is asked for.
    Bulk bulk(const Part& part);
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

  bool step(WorkMeter& meter) override;
  void cover(WorkMeter& meter);
  bool covers(const std::array<Part, 2>& parts, const std::array<Bulk, 2>& bulks, bool are_elements);
  bool find_upper(WorkMeter& meter);
  bool find_held(std::size_t outer, WorkMeter& meter);
  bool prove_held(std::size_t outer, std::uint32_t solid, PieceProof proof, const Vec3d& vertex, WorkMeter& meter);

  std::array<Side, 2> sides_;
  std::vector<std::array<Part, 2>> open_;  // what no direction is known for yet
  NearestElements nearest_;
};

}  // namespace clearance
