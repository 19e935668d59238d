// The timed workloads of the contenders, and the case classes as problems.
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

/// Poses of the links of scenes/cell, from its arm.py.
struct LinkPoses {
  std::vector<std::string> names;
  std::vector<std::array<double, 7>> poses;  ///< (K, links), world
};

/// The problem of that name, with exact distances. Throws std::invalid_argument for an unknown name.
/// \param scenes the repository's folder of scenes
/// \param links for "cell" only
peers::Problem make_workload(const std::string& name, const std::string& scenes, const LinkPoses& links);
/// `count` cases of a class, with exact results.
peers::Problem make_class_problem(const exact::CaseClass& c, std::uint64_t seed, int count);

}  // namespace clearance
