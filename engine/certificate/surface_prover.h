// Finds what proves the bounds of two bodies of which one is not convex: directions for all pairs of their elements, of
// many at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "engine/certificate/pair_cover.h"
#include "engine/certificate/row_prover.h"
#include "engine/mesh_distance/nearest_elements.h"

namespace clearance {

/// Lower bounds by halving what the bodies consist of until a direction takes each two parts apart; the upper one by
/// the nearest elements, or by a solid that one of them lies within.
class SurfaceProver final : public RowProver {
 public:
  SurfaceProver(const Scene& scene, const EvaluateOptions& options, const BodyPoses& here, BodyPair pair,
                const PairAnswer& answer, CertificateText& text);

 private:
  bool step(WorkMeter& meter) override;
  void cover(WorkMeter& meter);
  bool covers(PairCover::Parts parts);
  bool find_upper(WorkMeter& meter);
  void seek_held(WorkMeter& meter);
  void try_held(const Surface& solid, const Piece& piece, std::uint32_t candidate, WorkMeter& meter);
  void prove_held(WorkMeter& meter);

  // Vertices that may lie within a solid of the other body.
  struct Candidates {
    std::size_t outer = 0;                         // whose solid: 0: a, 1: b
    std::uint32_t solid = 0, piece = 0, next = 0;  // pieces of the one and of the other body; of the latter's vertices
  };
  // Such a vertex, before it is proved.
  struct HeldVertex {
    PieceProof proof;
    Vec3d vertex;
    std::uint32_t next = 0;  // triangle of the solid: those before it are proved to be far enough
  };

  PairCover cover_;
  NearestElements nearest_;
  bool seeks_held_ = false;  // no two elements are so near
  Candidates candidates_;
  std::optional<HeldVertex> held_;
};

}  // namespace clearance
