// Two bodies of which one is not convex, by the convex pieces that stand for it (engine/hull/decomposition.h): whether
// these alone prove that no element of one body comes near the other's.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/pose/placed.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Each pair of pieces is asked whether it is farther apart than it has to be for that. The first that is not ends it,
/// and triangles have to answer.
class DecomposedPair {
 public:
  static constexpr std::size_t kMostOfRound = 32;

  /// A pair of pieces, and beyond which distance of theirs the elements that they stand for are beyond the cut-off.
  struct Asked {
    const Piece *a, *b;
    double gap;      // of their boxes
    double inner;    // how much nearer the elements may be
    double cut_off;  // metres
  };

  /// Begins with a pair of bodies. False: pieces cannot help, and nothing is to be asked. \param cut_off metres: up to
  /// which the elements are of interest
  bool begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b, double cut_off);
  /// What is asked next, side by side; empty: nothing more.
  std::span<const Asked> round() const;
  /// The proved lower bound of pair i of the round, metres.
  void take(std::size_t i, double lower);
  void end_round();
  /// Whether a pair was not proved beyond.
  bool has_failed() const { return has_failed_; }
  /// No element of one body is nearer to one of the other, metres: once nothing more is asked and none has failed.
  double lower() const { return lower_; }

 private:
  // A convex set that holds elements, grown by `inner`.
  struct Holder {
    const Piece* piece;
    double inner;
    Aabb box;
  };
  static void hold(const Body& body, const PoseMatrix& pose, std::vector<Holder>& holders, Aabb& around);

  std::vector<Holder> a_, b_;
  std::vector<Asked> asked_;
  std::size_t next_ = 0, round_ = 2;
  double cut_off_ = 0, lower_ = std::numeric_limits<double>::infinity();
  bool has_failed_ = false;
};

/// Whether pieces stand for a part of a body.
bool has_decomposition(const Body& body);

}  // namespace clearance
