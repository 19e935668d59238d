// What the contenders are timed on, and the case classes as problems.
#pragma once

#include <string>
#include <vector>

#include "bench/peers/problem.h"
#include "tests/oracle/cases/cases.h"

namespace clearance {

struct Workload {
  std::string name, what;  ///< what: a line for the table
};
const std::vector<Workload>& workloads();

/// Where the links of scenes/cell are, from its arm.py.
struct LinkPoses {
  std::vector<std::string> names;
  std::vector<std::array<double, 7>> poses;  ///< (K, links), world
};

/// The problem of that name, truth included. \param scenes the repository's folder of scenes. \param links for "cell"
/// only. Throws std::invalid_argument for an unknown name.
peers::Problem make_workload(const std::string& name, const std::string& scenes, const LinkPoses& links);
/// `count` cases of a class, judged exactly.
peers::Problem make_class_problem(const exact::CaseClass& c, std::uint64_t seed, int count);

}  // namespace clearance
