// What is not known of bodies before the judge: intervals must hold the distance of the true bodies, whatever of all
// that is allowed they are. Each attempt makes a seeded scene and counts what is wrong with its answers.
#pragma once

#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

/// What was found wrong. The engine as it is must leave all at 0; a mutant must not.
struct Findings {
  int asked = 0;
  int misses = 0;      ///< intervals without the truth
  int untrue = 0;      ///< statuses and flags that the truth contradicts
  int wide = 0;        ///< intervals wider than tolerance and slack
  int unresolved = 0;  ///< wider than asked, or unproved, for slack alone
  int all() const { return misses + untrue + wide + unresolved; }
};

/// Hulls whose pose is known within a ball and a turn, and padding: samples of all that is allowed, solved exactly.
void try_uncertain(Random& random, Findings& findings);
/// Pieces that miss their hulls by up to a length, inside and outside, which their bodies admit.
void try_shapes(Random& random, bool depth, Findings& findings);
/// What stands for a cylinder: a scene's own is exact, a robot's is a prism around it.
enum class CylinderAs { kItself, kPrism };
/// A ball beside a true cylinder: the distance is a closed form, computed to 64 bits. Returns whether the interval of
/// the cylinder's prism would have missed it.
bool try_cylinder(Random& random, CylinderAs as, Findings& findings);
/// Cylinders that overlap deeply: that is proved of the true ones.
void try_crossed_cylinders(Random& random, CylinderAs as, Findings& findings);
/// A box that may have come nearer at up to 10 m/s since its pose was received, and one that follows it.
void try_age(Random& random, Findings& findings);

}  // namespace clearance::exact
