// Proofs of a row's bounds: directions in spans of time, points, closed surfaces.
#pragma once

#include "tests/oracle/certificate/motion.h"

namespace clearance::certificate_oracle {

using IdPair = std::array<Id, 2>;
IdPair pair_of(const Value& ids);

/// Begin and end of a proved span of time.
struct ProvedTime {
  double begin, end;
  friend auto operator<=>(const ProvedTime&, const ProvedTime&) = default;
};

/// Checks that two bodies are farther apart than `bound` throughout a span of a certificate. Throws `Rejection`.
ProvedTime check_span(const Motion& motion, const IdPair& ids, const Value& span, const Dyadic& bound);

/// Checks that two bodies are no farther apart than `bound` at a witness's time. Throws `Rejection`.
void check_witness(const Motion& motion, const IdPair& ids, const Value& witness, const Dyadic& bound);

/// Checks that a surface of triangles between `points` (divided by `divisor`) goes around the origin, and around a ball
/// of that radius, if it is positive. Throws `Rejection`.
/// \param faces if null, those of the witness
void check_surface(const Value& witness, const std::vector<Vector>& points, const Dyadic& divisor, const Dyadic& radius,
                   const std::vector<Face>* faces = nullptr);

/// Winding number of the faces around the origin, none of which comes as near as `near` (> 0), from crossings of rays.
/// Throws `Rejection` if no ray decides.
long turns_around(const std::vector<Face>& faces, const std::vector<Vector>& points, const Dyadic& near);

}  // namespace clearance::certificate_oracle
