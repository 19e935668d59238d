// Points of a body that the balls of a level have to hold, and candidates for these balls.
#pragma once

#include <span>
#include <vector>

#include "engine/cover/cover_shape.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// A point that a ball has to hold with all that is within `growth` of it.
struct CoverSample {
  Vec3d point;
  double growth;
};

struct BallChoice {
  std::size_t most;                 ///< number of balls
  std::size_t candidates, samples;  ///< centres tried, and points of the body that balls have to hold
  double edge;                      ///< longest edge of most simplices, in metres
};

/// Corners and face centres of simplices, most of them near the body's surface, which needs the most balls.
std::vector<CoverSample> sample_shares(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                                       const BallChoice& choice, PortableRandom& random);

/// Centres, and by how much a ball about each has to stand out to hold each sample. Float32 is enough for a choice.
class BallCandidates {
 public:
  BallCandidates(const CoverShape& shape, std::span<const CoverSimplex> simplices, const BallChoice& choice,
                 PortableRandom& random);

  void add(std::span<const CoverSample> samples);

  std::size_t count() const { return centres_.size(); }
  std::size_t samples() const { return x_.size(); }
  const Vec3d& centre(std::size_t i) const { return centres_[i]; }
  double inside(std::size_t i) const { return inside_[i]; }
  /// Of one candidate, for each sample.
  const float* needs(std::size_t i) const { return needs_.data() + i * stride_; }

 private:
  void add(const CoverShape& shape, const Vec3d& c, bool must_be_inside);

  Vec3d origin_{0, 0, 0};  ///< near the samples
  std::vector<float> x_, y_, z_, growth_;
  std::vector<Vec3d> centres_;
  std::vector<double> inside_;
  std::size_t stride_ = 0;
  std::vector<float> needs_;
};

}  // namespace clearance
