// Finds what proves the bounds of two bodies of which one is not convex: directions for all pairs of their elements, of
// many at a time.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/query/nearest_elements.h"
#include "engine/query/pair_cover.h"
#include "engine/query/row_prover.h"

namespace clearance {

/// Lower bounds by halving what the bodies consist of until a direction takes each two parts apart; the upper one by
/// the nearest elements, or by a solid that one of them lies within.
class SurfaceProver final : public RowProver {
 public:
  SurfaceProver(const Scene& scene, const EvaluateOptions& options, const Placement& here, BodyPair pair,
                const PairAnswer& answer, CertificateText& text);

 private:
  bool step(WorkMeter& meter) override;
  void cover(WorkMeter& meter);
  bool covers(PairCover::Parts parts);
  bool find_upper(WorkMeter& meter);
  bool find_held(std::size_t outer, WorkMeter& meter);
  bool prove_held(std::size_t outer, std::uint32_t solid, PieceProof proof, const Vec3d& vertex, WorkMeter& meter);

  PairCover cover_;
  NearestElements nearest_;
};

}  // namespace clearance
