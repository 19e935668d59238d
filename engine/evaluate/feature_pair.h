// Two features that meet: the second derivative of their distance. Derived in docs/trust/bounds_robots.md, second
// order.
#pragma once

#include <cstdint>
#include <optional>

#include "engine/evaluate/feature.h"

namespace clearance {

/// A point of each core, world axes from the pair's origin.
struct WitnessPoints {
  Vec3d a, b;
};

/// First-order motion of a pair by one variable, in world axes.
struct FeatureMotion {
  Vec3d spin_a, spin_b;  ///< angular velocities of the parts
  Vec3d shift;           ///< velocity of b's witness point relative to that of a
};

/// Nearest features of two separated cores.
class FeaturePair {
 public:
  /// Units of work of find().
  static std::uint64_t units_to_find(const ConvexPart& a, const ConvexPart& b) {
    constexpr std::uint64_t kScans = 16, kVerticesPerUnit = 64;  // scans of the vertices of both parts
    return kScans * (1 + (a.vertices.size() + b.vertices.size()) / kVerticesPerUnit);
  }
  /// Returns nothing for cores that overlap, or touch within rounding.
  /// \param start nearest points of the cores up to a tolerance
  /// \param toward direction from a towards b, not zero: where the search begins
  /// \param wants_radius whether smooth_radius() is needed
  static std::optional<FeaturePair> find(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                         const PoseMatrix& pose_b, const WitnessPoints& start, const Vec3d& toward,
                                         bool wants_radius);

  double distance() const { return distance_; }      ///< of the cores, metres
  const Vec3d& normal() const { return normal_; }    ///< unit, from a towards b
  const Vec3d& point_a() const { return point_a_; }  ///< on a's core, world axes from a's origin
  const Vec3d& point_b() const { return point_b_; }  ///< on b's core, world axes from a's origin
  /// Lower bound on the translation of one part, in metres, over which the features stay the nearest; 0 if they change
  /// within rounding. For parts that turn, an estimate of how far their points may move.
  double smooth_radius() const { return smooth_radius_; }

  /// How fast the normal of the nearest points turns if the parts' supporting directions lean: a vector across the
  /// normal whose sum with `lean_a` is normal to a's tangents, and with `lean_b` to b's. Where tangents of both depend
  /// on one another, those of one part count.
  Vec3d lean(const Vec3d& lean_a, const Vec3d& lean_b, bool begin_with_a) const;

  /// A motion, reduced to the numbers that curvature() combines.
  struct Term {
    Vec3d across;     // shift without its part along the normal, over the root of the distance
    double slide[4];  // of the witness points along the features
  };
  Term term(const FeatureMotion& motion) const;
  /// Second derivative of the distance by two motions, without the acceleration of the points along the normal.
  static double curvature(const Term& x, const Term& y) {
    double sum = dot(x.across, y.across);
    for (int k = 0; k < 4; ++k) sum -= x.slide[k] * y.slide[k];
    return sum;
  }

 private:
  struct Side;
  FeaturePair() = default;
  static std::optional<FeaturePair> find_flat(const Side& a, const Side& b, const Vec3d& toward, bool wants_radius);
  static std::optional<FeaturePair> find_round(Side& a, Side& b, const WitnessPoints& start, const Vec3d& toward);
  static bool find_patches(Side& a, Side& b, const WitnessPoints& start, const Vec3d& toward,
                           std::optional<FeaturePair>& found);
  static std::optional<WitnessPoints> flat_points(const Side& a, const Side& b, const Vec3d& toward);
  bool meet_round(const Side& a, const Side& b);
  void take_points(const Vec3d& a, const Vec3d& b);
  double polish();
  void factorise();
  double bend(int i, int j) const;
  void set_radius(const Side& a, const Side& b, double tolerance);
  int slides() const { return a_.size + b_.size; }
  /// Velocity of the difference of the points by slide k.
  Vec3d along(int k) const { return k < b_.size ? b_.tangent[k] : -a_.tangent[k - b_.size]; }

  double distance_ = 0, smooth_radius_ = 0;
  Vec3d normal_{0, 0, 0}, point_a_{0, 0, 0}, point_b_{0, 0, 0};
  Feature a_, b_;
  double factor_[4][4]{};  // lower triangle L of the slides' matrix; a slide that depends on others has a 0 diagonal
};

}  // namespace clearance
