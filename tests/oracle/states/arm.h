// An arm whose links have every kind of shape.
#pragma once

#include <string>
#include <vector>

#include "tests/oracle/states/part_bounds.h"

namespace clearance::exact {

struct Arm {
  std::string urdf;                            ///< text, with the mesh hull.obj
  std::string obj;                             ///< text of that mesh
  std::vector<std::vector<PartBounds>> links;  ///< of the links l0, l1, ...
};

/// Seven joints, one of which slides and one of which mimics the first.
Arm make_arm(Random& random);

}  // namespace clearance::exact
