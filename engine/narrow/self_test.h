// Whether this build computes rightly on this machine: pairs of bodies whose distances are known, asked of every way to
// answer that there is. A compiler, an emulator or a worn-out core may make one instruction set wrong and leave the
// others right.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/hull/piece.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

/// Two pieces in several places whose signed distance is known from how they were made, in integers: float64 holds
/// their vertices, and where they are, exactly.
struct KnownPair {
  std::string_view kind;
  PiecePtr a, b;
  double exact;                              ///< metres; the same in all places
  std::vector<std::pair<Pose, Pose>> poses;  ///< X_wa and X_wb
};
/// Vertex, edge and face on each other, apart, touching and overlapping; round, far from the origin, of many vertices.
const std::vector<KnownPair>& known_pairs();

/// What one way to answer made of them.
struct SelfTest {
  std::string name;  ///< "reference", "scalar" (one pair after another), or of an instruction set
  std::size_t answers = 0, wrong = 0;
  std::string first_wrong = {};  ///< a sentence about it; empty: there is none
  double seconds = 0;

  /// Takes an answer into account. \param error what is wrong about it; empty: nothing.
  void count(const std::string& error);
  bool passed() const { return wrong == 0; }
};

/// What is not true of an answer; empty: all is. \param limits what was asked.
std::string error_of(const KnownPair& pair, const NarrowAnswer& answer, const NarrowLimits& limits);

SelfTest self_test_lanes(const LaneKernel& kernel);
SelfTest self_test_alone(bool reference);

/// Of all ways to answer on this machine's CPU. Run when first asked for, once in a process: some milliseconds.
const std::vector<SelfTest>& self_tests();

/// lane_kernel() among those that passed. Throws std::runtime_error for one that did not, naming it, and where what all
/// of them rest on did not.
const LaneKernel& passed_lane_kernel(std::string_view name, std::span<const LaneKernel> kernels = lane_kernels(),
                                     std::span<const SelfTest> tests = self_tests());

}  // namespace clearance
