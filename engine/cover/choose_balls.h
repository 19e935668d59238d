// Choice of the balls of a level: few that stand out little from the body. Any choice is valid; only their number and
// width depend on it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/cover/ball_candidates.h"

namespace clearance {

struct ChosenBall {
  Vec3d centre;   ///< of float32
  double radius;  ///< enough for the samples, perhaps not for the simplices between them
};

/// Chooses candidates that together hold all samples and stand out by about the least common length.
class BallChooser {
 public:
  /// \param most number of balls
  BallChooser(const BallCandidates& candidates, std::size_t most) : candidates_(candidates), most_(most) {}

  /// May be repeated with more samples.
  std::vector<ChosenBall> choose();

 private:
  /// Lower bound on the common stand-out: some candidate has to hold each sample.
  float least_need() const;
  /// The candidate that holds all samples best, of some.
  std::size_t single_best() const;
  /// Chooses candidates that hold all samples with a stand-out of at most `limit`, if few enough do.
  bool cover_greedily(float limit);
  /// Replaces each candidate by the one that holds its samples best. Returns false if that gains nothing.
  bool improve();
  /// Adds candidates while there may be more, each the best one for the sample that is held worst.
  void spend(std::vector<std::size_t>& selected) const;

  /// The selected candidate that holds each sample best, and the sample that is held worst.
  struct Owners {
    std::vector<std::size_t> of;
    float greatest;  ///< stand-out for any sample
    std::size_t worst;
  };
  Owners owners(std::span<const std::size_t> selected) const;

  const BallCandidates& candidates_;
  std::size_t most_;
  std::vector<std::size_t> chosen_;
  /// Bounds on the samples that each candidate holds, for limits below all that have succeeded.
  std::vector<std::int32_t> most_held_;
};

}  // namespace clearance
