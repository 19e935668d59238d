// Queries of the device benchmarks.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "engine/engine.h"

namespace clearance::test {

struct Workload {
  std::string name;
  engine::Scene (*scene)();
  std::uint32_t configurations;  // 0 for the current poses
  std::uint32_t fields;
  Reduce reduce = Reduce::kNone;
  double max_distance = std::numeric_limits<double>::infinity();
  std::size_t first_pairs = 0;  // use only this many; 0 for all
  Precision precision = Precision::kF64;
  bool depth = false;
  double room = 1;    // bodies are at most this far from the origin along each axis
  double margin = 0;  // Reduce::kAny only
};

const std::vector<Workload>& workloads();
engine::Scene spheres(int count, double box);  ///< of 42 vertices

// The query of a workload. Must not be moved: the query points into it.
struct Requested {
  QueryView q;
  std::vector<std::uint32_t> bodies, joints;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  std::vector<double> positions;

  Requested(const Workload& w, const engine::Engine& cpu);
  Requested(const Requested&) = delete;
};

}  // namespace clearance::test
