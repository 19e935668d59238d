// Penetration depth of overlapping cores, exactly.
#pragma once

#include <vector>

#include "tests/oracle/exact/exact_difference.h"

namespace clearance::exact {

/// Sets distance, direction, simplex and iterations of `result` from the penetration depth of the cores.
/// \param hold vertices of C (one to four) whose hull contains the origin
void solve_depth(const Difference& C, std::vector<Vertex<mpz_class>> hold, Result& result);

}  // namespace clearance::exact
