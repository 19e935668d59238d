// Containment of one body in the other, as found by the evaluator, and proxies of meshes.
#include <algorithm>

#include "engine/evaluate/evaluate.h"
#include "engine/hull/primitive.h"
#include "engine/mesh_distance/containment.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// The exact body of a proxy.
const Body& exact_body_of(const Body& body) {
  return body.exact_body ? *body.exact_body : body;
}

// Bound on the length of a shift that separates two boxes and their contents, in metres.
double depth_of(const Aabb& a, const Aabb& b) {
  double least = kInf;
  for (int k = 0; k < 3; ++k) least = std::min({least, a.high[k] - b.low[k], b.high[k] - a.low[k]});
  return std::max(least, 0.0) * (1 + 0x1p-50);
}

}  // namespace

bool Evaluator::is_by_parts(BodyPair pair) const {
  if (!scene_.has_proxies()) return false;
  const Body &a = scene_.bodies()[pair.a], &b = scene_.bodies()[pair.b];
  return (a.exact_body || b.exact_body) && !is_half_space(*a.parts[0]) && !is_half_space(*b.parts[0]);
}

// Whether one body contains the other although all searched elements are apart. Proxies are tested as well, since their
// meshes may be hollow.
bool Evaluator::finds_containment(PairSearch& search, WorkMeter& meter) {
  const PlacedBodies& bodies = pairs_[search.index];
  const bool by_parts = is_by_parts(bodies.pair);
  BodiesAnswer& found = search.found;
  const double apart = by_parts ? search.slack.true_lower(found.lower) : found.lower;
  if (!(apart > 0) || (by_parts && box_gap(scene_, *bodies.placement, bodies.pair) > 0)) return false;
  const Body &a = exact_body_of(scene_.bodies()[bodies.pair.a]), &b = exact_body_of(scene_.bodies()[bodies.pair.b]);
  Vec3d shared[2];
  switch (either_contains(a, (*bodies.placement)[bodies.pair.a].pose, b, (*bodies.placement)[bodies.pair.b].pose, apart,
                          meter, shared)) {
    case Containment::kNo:
      return false;
    case Containment::kUnknown:
      found.lower = 0;
      return false;
    case Containment::kYes:
      take_contained(search, apart, shared);
      return true;
  }
  return false;
}

// \param apart distance of the inner body from the surface around it
void Evaluator::take_contained(PairSearch& search, double apart, const Vec3d (&shared)[2]) {
  const PlacedBodies& bodies = pairs_[search.index];
  BodiesAnswer& found = search.found;
  const Vec3d normal = found.best.bounds.upper < kInf ? found.best.normal : Vec3d{1, 0, 0};  // no pair was evaluated
  found.best = NarrowAnswer{};
  found.best.bounds.upper = -apart;
  found.best.point_a = shared[0];
  found.best.point_b = shared[1];
  found.best.normal = normal;
  found.lower = -kInf;
  if (!is_by_parts(bodies.pair)) return;
  const BodyPoses& placement = *bodies.placement;
  found.lower = -std::max(apart, depth_of(placement.box(bodies.pair.a), placement.box(bodies.pair.b)));
}

}  // namespace clearance
