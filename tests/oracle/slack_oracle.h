// Compares uncertainty with the oracle: intervals must contain the distance of the true bodies, for any allowed bodies.
// Each attempt makes a seeded scene and counts errors in its answers.
#pragma once

#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

/// Errors found. All must be 0 for the engine, but not for a mutant.
struct Findings {
  int requested = 0;
  int misses = 0;      ///< intervals without the exact distance
  int untrue = 0;      ///< statuses and flags that contradict the exact result
  int wide = 0;        ///< intervals wider than tolerance and slack
  int unresolved = 0;  ///< wider than the tolerance, or unproved, due to slack alone
  int all() const { return misses + untrue + wide + unresolved; }
};

/// Hulls whose pose is known within a ball and a rotation, and padding: samples of all that is allowed, solved exactly.
void try_uncertain(Random& random, Findings& findings);
/// Convex parts that deviate from their hulls by up to a length, inside and outside, as their bodies state.
void try_shapes(Random& random, bool depth, Findings& findings);
/// Proxy of a cylinder: a scene's own is exact, a robot's is a prism around it.
enum class CylinderAs { kItself, kPrism };
/// A ball next to an exact cylinder: the distance is a closed form, computed to 64 bits. Returns whether the interval
/// of the cylinder's prism would have missed it.
bool try_cylinder(Random& random, CylinderAs as, Findings& findings);
/// Cylinders that overlap deeply, with a proof for the exact ones.
void try_crossed_cylinders(Random& random, CylinderAs as, Findings& findings);
/// A box that may have come nearer at up to 10 m/s since its pose was received, and one that follows it.
void try_age(Random& random, Findings& findings);

}  // namespace clearance::exact
