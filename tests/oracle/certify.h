// Options and parts of clearance-certify.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

struct CertifyOptions {
  std::int64_t pairs = 10000, slack = 0, motions = 0, trajectories = 0, stops = 0, states = 0, edges = 0, distances = 0;
  std::uint64_t seed = 1;
  int threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  int columns_every = 10;
  std::vector<std::string> backends{"cpu", "reference"};
  std::string csv, only, failures;
  std::vector<std::string> robots;
  bool meshes = false;

  const std::vector<CaseClass>& classes() const { return meshes ? mesh_classes() : case_classes(); }
};

/// States and edges of two made robots and of those in files, in shares that do not depend on the threads. Returns
/// false if any decision is wrong.
bool certify_decisions(const CertifyOptions& o);
/// The same for distances of states to tolerances.
bool certify_distances(const CertifyOptions& o);
/// Motions of each kind in turn, divided among the threads. Returns false if any is wrong, or if a requested device has
/// decided none.
bool certify_motions(const CertifyOptions& o);
/// Trajectories of several segments, divided among the threads. Returns false if any segment is wrong.
bool certify_trajectories(const CertifyOptions& o);
/// Approaches that brake at the last proved moment, divided among the threads. Returns false if a person touches a
/// robot that moves, or a capsule model keeps a greater speed.
bool certify_stops(const CertifyOptions& o);

}  // namespace clearance::exact
