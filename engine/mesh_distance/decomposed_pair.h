// Tests two bodies, at least one of them non-convex, by the convex parts of their decompositions
// (engine/hull/decomposition.h): these alone may prove that no element of one body comes near the other's.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/pose/placed.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Tests whether each pair of parts is far enough apart for that proof. The first pair that is not ends the test, and
/// triangles have to be evaluated.
class DecomposedPair {
 public:
  static constexpr std::size_t kMostOfRound = 32;

  /// A pair of parts to test. If they are farther apart than `cut_off`, the elements that they enclose are beyond
  /// the cut-off of the search.
  struct PartTest {
    const ConvexPart *a, *b;
    double gap;      // of their boxes
    double inner;    // by which the elements may be nearer
    double cut_off;  // metres
  };

  /// Begins with a pair of bodies. Returns false if parts cannot help.
  /// \param cut_off distance up to which elements matter, metres
  bool begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b, double cut_off);
  /// The next pairs to evaluate, in parallel; empty at the end.
  std::span<const PartTest> round() const;
  /// Takes the proved lower bound of pair i of the round, metres.
  void take(std::size_t i, double lower);
  void end_round();
  /// Whether a pair was not proved beyond.
  bool has_failed() const { return has_failed_; }
  /// Lower bound on the distance between the bodies' elements, metres. Valid after the last round, unless one has
  /// failed.
  double lower() const { return lower_; }

 private:
  // A convex set that contains elements, grown by `inner`.
  struct Holder {
    const ConvexPart* part;
    double inner;
    Aabb box;
  };
  static void hold(const Body& body, const PoseMatrix& pose, std::vector<Holder>& holders, Aabb& around);

  std::vector<Holder> a_, b_;
  std::vector<PartTest> tests_;
  std::size_t next_ = 0, round_ = 2;
  double cut_off_ = 0, lower_ = std::numeric_limits<double>::infinity();
  bool has_failed_ = false;
};

/// Whether any part of a body has a decomposition.
bool has_decomposition(const Body& body);

}  // namespace clearance
