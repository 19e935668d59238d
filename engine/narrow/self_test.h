// Tests whether this build computes correctly on this machine: pairs of bodies with known distances, queried in every
// implementation. A compiler, an emulator or a worn-out core may break one instruction set and leave the others right.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/hull/convex_part.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

/// Two convex parts in several places whose signed distance is known by construction, in integers: float64 represents
/// their vertices and poses exactly.
struct KnownPair {
  std::string_view kind;
  ConvexPartPtr a, b;
  double exact;                              ///< metres; the same in all places
  std::vector<std::pair<Pose, Pose>> poses;  ///< X_wa and X_wb
};
/// Vertex, edge and face on each other, apart, touching and overlapping; round, far from the origin, of many vertices.
const std::vector<KnownPair>& known_pairs();

/// Results of one implementation.
struct SelfTest {
  std::string name;  ///< "reference", "scalar" (one pair after another), or the name of an instruction set
  std::size_t answers = 0, wrong = 0;
  std::string first_wrong = {};  ///< a sentence about the first wrong answer, or empty
  double seconds = 0;

  /// Counts an answer.
  /// \param error describes an error in it, or is empty
  void count(const std::string& error);
  bool passed() const { return wrong == 0; }
};

/// Describes an error in an answer, or is empty.
/// \param limits of the query
std::string error_of(const KnownPair& pair, const NarrowAnswer& answer, const NarrowLimits& limits);

SelfTest self_test_lanes(const LaneKernel& kernel);
SelfTest self_test_alone(bool reference);

/// Tests all implementations on this machine's CPU. Runs at the first call, once in a process: some milliseconds.
const std::vector<SelfTest>& self_tests();

/// lane_kernel() among those that passed. Throws std::runtime_error, with the name, for one that failed, and if an
/// implementation that all of them depend on failed.
const LaneKernel& passed_lane_kernel(std::string_view name, std::span<const LaneKernel> kernels = lane_kernels(),
                                     std::span<const SelfTest> tests = self_tests());

}  // namespace clearance
