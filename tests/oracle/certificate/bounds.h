// What proves the bounds of a row: directions in spans of time, points, closed surfaces.
#pragma once

#include "tests/oracle/certificate/motion.h"

namespace clearance::certificate_oracle {

using IdPair = std::array<Id, 2>;
IdPair pair_of(const Value& ids);

/// From when to when something was shown.
struct Span {
  double begin, end;
  friend auto operator<=>(const Span&, const Span&) = default;
};

/// Two bodies are farther apart than `bound` all along a span of a certificate. Throws Refusal.
Span check_span(const Motion& motion, const IdPair& ids, const Value& span, const Dyadic& bound);

/// Two bodies are no farther apart than `bound` at a witness's time. Throws Refusal.
void check_witness(const Motion& motion, const IdPair& ids, const Value& witness, const Dyadic& bound);

/// A surface of triangles between `points` (divided by `divisor`) goes around the origin, and around a ball of that
/// radius, if it is positive. Throws Refusal. \param faces none: the witness's own
void check_surface(const Value& witness, const std::vector<Vector>& points, const Dyadic& divisor, const Dyadic& radius,
                   const std::vector<Face>* faces = nullptr);

/// How often more rays from the origin cross the faces one way than the other, of which none comes as near as `near`
/// (> 0). Throws Refusal where no ray tells.
long turns_around(const std::vector<Face>& faces, const std::vector<Vector>& points, const Dyadic& near);

}  // namespace clearance::certificate_oracle
