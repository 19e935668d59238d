// Collects the bounds of all attempts at a pair. Internal to narrow_phase.cpp.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "engine/hull/primitive.h"
#include "engine/narrow/narrow_phase.h"
#include "engine/narrow/polytope.h"
#include "engine/narrow/proof.h"
#include "engine/narrow/witness.h"

namespace clearance {

/// The narrowest interval of all attempts, the witness of its upper end, the normal of its lower end, and optionally
/// their proof.
class BoundsCollector {
 public:
  /// \param proof null if not needed
  BoundsCollector(const NarrowLimits& limits, const Mat3d& R_wa, double radius_a, double radius_b,
                  NarrowProof* proof = nullptr)
      : limits_(limits), R_wa_(R_wa), radius_a_(radius_a), radius_b_(radius_b), proof_(proof) {}

  /// \param n axes of a
  template <class T>
  void raise_lower(double lower, const Vec3<T>& n) {
    assert(!std::isnan(lower));
    if (!(lower > answer_.bounds.lower)) return;
    answer_.bounds.lower = lower;
    const Vec3d m = rescaled(cast<double>(n));
    answer_.normal = (R_wa_ * m) * (1 / norm(m));
    if (!proof_) return;
    proof_->direction = cast<DoubleDouble>(n);
    proof_->lower_in_double_double = std::is_same_v<T, DoubleDouble>;
  }
  /// Takes the points given by a simplex.
  template <class T>
  void take_witness(const PlacedPair<T>& pair, const Simplex<T>& simplex) {
    const Witness w = certify_upper(pair, simplex);
    assert(!std::isnan(w.upper));
    if (!lower_upper(w.upper, w) || !proof_) return;
    begin_upper_proof<T>();
    const SimplexPoint<T> point(simplex);
    for (int i = 0; i < simplex.size; ++i)
      add_to_proof(pair, simplex.vertex[i].a, simplex.vertex[i].b, DoubleDouble(point.share[i]));
    if (simplex.size == 0) add_to_proof(pair, 0, 0, 1);
  }
  /// Returns whether it is lower than the bound so far.
  bool lower_upper(double upper, const Witness& w) {
    if (!(upper < answer_.bounds.upper)) return false;
    answer_.bounds.upper = upper;
    witness_ = w;
    return true;
  }
  /// Takes an upper bound without a witness of its own (a ball in the overlap), with the nearest points of the surface
  /// in its place.
  template <class T>
  void lower_upper(const PlacedPair<T>& pair, double upper, const Witness& w, std::span<const CsoVertex<T>> vertices,
                   std::span<const CsoFace<T>> faces) {
    if (!lower_upper(upper, w) || !proof_) return;
    begin_upper_proof<T>();
    for (const CsoVertex<T>& v : vertices) add_to_proof(pair, v.a, v.b, 0);
    for (const CsoFace<T>& f : faces)
      proof_->faces.push_back({{f.vertex[0], f.vertex[1], f.vertex[2]}, cast<DoubleDouble>(f.normal)});
  }

  /// Keeps a surface around the origin, from which double-double makes a better common point.
  template <class T>
  void keep_surface(std::span<const CsoVertex<T>> vertices, std::span<const CsoFace<T>> faces) {
    surface_vertices_.clear();
    surface_faces_.clear();
    for (const CsoVertex<T>& v : vertices) surface_vertices_.push_back({{}, v.a, v.b});
    for (const CsoFace<T>& f : faces) surface_faces_.push_back({f.vertex, f.twin, {}});
  }
  bool has_surface() const { return !surface_faces_.empty(); }
  std::vector<CsoVertex<DoubleDouble>>& surface_vertices() { return surface_vertices_; }
  std::span<const CsoFace<DoubleDouble>> surface_faces() const { return surface_faces_; }
  void replace_witness(const Witness& w) { witness_ = w; }

  const Interval& bounds() const { return answer_.bounds; }
  bool wants_depth() const { return limits_.signed_distance; }
  /// An overlap is proved, but less than the limits request.
  bool is_shallow() const { return answer_.bounds.upper <= 0 && answer_.bounds.upper > -limits_.min_penetration; }
  double tolerance(double distance) const { return tolerance_at(distance, limits_.abs_tol, limits_.rel_tol); }

  bool converged() const {
    const auto [lower, upper] = answer_.bounds;
    if (lower > limits_.max_distance) return true;
    if (upper == kInf) return false;
    if (upper <= limits_.stop_below) return true;
    if (!limits_.signed_distance && upper <= 0) return true;
    const double least = limits_.signed_distance ? lower : std::max(lower, 0.0);
    if (least == -kInf) return false;
    if (lower <= 0 && upper > 0) return upper - least <= contact_tolerance(limits_.abs_tol);
    return upper - least <= tolerance(lower > 0 ? upper : lower);
  }

  NarrowAnswer finish() {
    answer_.converged = converged();
    answer_.beyond = answer_.bounds.lower > limits_.max_distance;
    // Without signed distance the separating direction may be unknown. The witnesses' own line replaces it.
    const double length = witness_.length, radius = radius_a_ + radius_b_;
    if (!(norm(answer_.normal) > 0)) answer_.normal = length > 0 ? witness_.separation * (1 / length) : Vec3d{1, 0, 0};
    const bool apart = answer_.bounds.upper > 0 || length > 0;
    const Vec3d outward = apart && length > 0 && !deep_ ? witness_.separation * (1 / length) : answer_.normal;
    answer_.point_a = witness_.core_a + outward * radius_a_;
    answer_.point_b = witness_.core_b - outward * radius_b_;
    if (!limits_.signed_distance && answer_.bounds.upper <= 0) {
      // A common point: on the segment between the cores, within both radii.
      const double share = radius > 0 ? radius_a_ / radius : 0.5;
      answer_.point_a = witness_.core_a + witness_.separation * share;
      answer_.point_b = witness_.core_b - witness_.separation * (1 - share);
    }
    return answer_;
  }
  void mark_deep() { deep_ = true; }

 private:
  static constexpr double kInf = std::numeric_limits<double>::infinity();

  template <class T>
  void begin_upper_proof() {
    proof_->upper_in_double_double = std::is_same_v<T, DoubleDouble>;
    proof_->vertices.clear();
    proof_->faces.clear();
    proof_->points_a.clear();
    proof_->points_b.clear();
  }
  template <class T>
  void add_to_proof(const PlacedPair<T>& pair, std::uint32_t a, std::uint32_t b, const DoubleDouble& share) {
    const auto named = [](const ConvexPart& convex_part, const CorePoints<T>& points, std::uint32_t i, auto& known) {
      if (!is_round(convex_part)) return i;
      known.push_back(cast<DoubleDouble>(points[i]));
      return static_cast<std::uint32_t>(known.size() - 1);
    };
    proof_->vertices.push_back({named(*pair.a, pair.points_a, a, proof_->points_a),
                                named(*pair.b, pair.points_b, b, proof_->points_b), share});
  }

  NarrowLimits limits_;
  Mat3d R_wa_;
  double radius_a_, radius_b_;
  NarrowProof* proof_;
  NarrowAnswer answer_;
  Witness witness_{kInf, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0};
  bool deep_ = false;
  std::vector<CsoVertex<DoubleDouble>> surface_vertices_;
  std::vector<CsoFace<DoubleDouble>> surface_faces_;
};

}  // namespace clearance
