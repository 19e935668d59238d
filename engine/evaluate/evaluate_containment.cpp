// Containment of one body in the other, as found by the evaluator.
#include "engine/evaluate/evaluate.h"
#include "engine/mesh_distance/containment.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

}  // namespace

// Takes in whether one body contains the other although all searched elements are apart.
void Evaluator::take_containment(PairSearch& search, WorkMeter& meter) {
  const PlacedBodies& bodies = pairs_[search.index];
  BodiesAnswer& found = search.found;
  const double apart = found.lower;  // the inner body, from the surface around it
  if (!(apart > 0)) return;
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  Vec3d shared[2];
  const Containment contained = either_contains(a, (*bodies.placement)[bodies.pair.a].pose, b,
                                                (*bodies.placement)[bodies.pair.b].pose, apart, meter, shared);
  if (contained == Containment::kNo) return;
  if (contained == Containment::kUnknown) {
    found.lower = 0;
    return;
  }
  const Vec3d normal = found.best.bounds.upper < kInf ? found.best.normal : Vec3d{1, 0, 0};  // no pair was evaluated
  found.best = NarrowAnswer{};
  found.best.bounds.upper = -apart;
  found.best.point_a = shared[0];
  found.best.point_b = shared[1];
  found.best.normal = normal;
  found.lower = -kInf;
}

}  // namespace clearance
