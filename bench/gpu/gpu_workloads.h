// What the benchmarks of a device ask.
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "engine/engine.h"

namespace clearance::test {

struct Workload {
  std::string name;
  Scene (*scene)();
  std::uint32_t configurations;  // 0: the current poses
  Format format;
  std::uint32_t fields;
  Reduce reduce = Reduce::kNone;
  double max_distance = std::numeric_limits<double>::infinity();
  std::size_t first_pairs = 0;  // only so many; 0: all
  bool warm = false;            // every query's poses are 0.01 rad from those of the one before
  Precision precision = Precision::kF64;
  bool depth = false;
  double room = 1;     // configurations put bodies up to so far from the origin along each axis
  bool moves = false;  // as with `warm`, but cold
  double margin = 0;   // of Reduce::kAny
};

const std::vector<Workload>& workloads();
Scene spheres(int count, double box);  ///< of 42 vertices

// What a workload asks. Not to be moved: the query points into it.
struct Asked {
  QueryView q;
  std::vector<std::uint32_t> bodies, joints;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  std::vector<double> positions;

  Asked(const Workload& w, const Engine& cpu);
  Asked(const Asked&) = delete;
};

}  // namespace clearance::test
