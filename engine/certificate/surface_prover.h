// Proves the bounds of two bodies, at least one of them non-convex, by directions that each cover many pairs of
// elements.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "engine/certificate/pair_cover.h"
#include "engine/certificate/row_prover.h"
#include "engine/mesh_distance/nearest_elements.h"

namespace clearance {

/// Proves the lower bound by halving both bodies until a direction separates each pair of parts, and the upper bound by
/// the nearest elements or by a solid that contains the other body.
class SurfaceProver final : public RowProver {
 public:
  SurfaceProver(const engine::Scene& scene, const EvaluateOptions& options, const BodyPoses& here, BodyPair pair,
                const PairAnswer& answer, CertificateText& text);

 private:
  bool step(WorkMeter& meter) override;
  void cover(WorkMeter& meter);
  bool covers(PairCover::Parts parts);
  bool find_upper(WorkMeter& meter);
  void seek_held(WorkMeter& meter);
  void try_held(const Surface& solid, const ConvexPart& part, std::uint32_t candidate, WorkMeter& meter);
  void prove_held(WorkMeter& meter);

  // Vertices that may lie inside a solid of the other body.
  struct Candidates {
    std::size_t outer = 0;                        // body of the solid: 0 is a, 1 is b
    std::uint32_t solid = 0, part = 0, next = 0;  // part of the solid; part of the other body, and its next vertex
  };
  // Such a vertex before it is proved.
  struct HeldVertex {
    PartProof proof;
    Vec3d vertex;
    std::uint32_t next = 0;  // next triangle of the solid; those before it are proved to be far enough
  };

  PairCover cover_;
  NearestElements nearest_;
  bool seeks_held_ = false;  // no two elements are close enough
  Candidates candidates_;
  std::optional<HeldVertex> held_;
};

}  // namespace clearance
