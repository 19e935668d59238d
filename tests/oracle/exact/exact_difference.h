// The difference C = B - A of two posed convex parts, in integers, on which both stages of the oracle work.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "tests/oracle/exact/exact_distance.h"

namespace clearance::exact {

/// The least exponent among some numbers, so that each is an integer times 2^exponent.
struct LeastExponent {
  int value = std::numeric_limits<int>::max();
  void include(double v);  ///< throws std::invalid_argument for NaN and infinity
  void include(const Vec3d& v) {
    for (int k = 0; k < 3; ++k) include(v[k]);
  }
  int get() const { return value == std::numeric_limits<int>::max() ? 0 : value; }
};

/// v / 2^unit, which must be an integer.
mpz_class integer(double v, int unit);
Vec3z integer(const Vec3d& v, int unit);
/// The double as a rational. Throws std::invalid_argument for NaN and infinity.
mpq_class rational(double v);

/// A part with its rotation M / n in integers.
class PosedPart {
 public:
  PosedPart(const ConvexPartView& part, const Pose& X);

  const LeastExponent& exponent() const { return exponent_; }
  /// M v, as integers of the unit 2^unit.
  Vec3z rotated(std::uint32_t i, int unit) const { return M * integer(vertices_[i], unit); }
  /// The index of a vertex v with the largest direction . (M v). Exact: doubles only discard vertices that are lower by
  /// more than any rounding could account for; the rest are compared as integers.
  std::uint32_t highest(const Vec3z& direction) const;

  Mat3<mpz_class> M;
  mpz_class n;

 private:
  void add_product(mpz_class& sum, const mpz_class& m, double v) const;

  std::span<const Vec3d> vertices_;
  Vec3d largest_{0, 0, 0};  // of each coordinate's magnitudes
  LeastExponent exponent_;
  mutable std::vector<double> approximate_;
  mutable std::vector<std::uint32_t> candidates_;
  mutable mpz_class product_;
};

template <class T>
struct Vertex {
  VertexPair index;
  Vec3<T> c;  // a vertex of the difference B - A
};

/// The difference C = B - A, in integers: c * 2^unit / (n_a n_b) is in metres, in the world's axes.
class Difference {
 public:
  using Scalar = mpz_class;

  Difference(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb);

  Vertex<mpz_class> at(VertexPair i) const {
    return {i, a_.n * b_.rotated(i.b, unit_) + offset_ - b_.n * a_.rotated(i.a, unit_)};
  }
  /// The vertex of C lowest along a direction.
  Vertex<mpz_class> lowest(const Vec3z& direction) const { return at({a_.highest(direction), b_.highest(-direction)}); }

  /// A core distance sign * |height| / |direction| in units of C, as a value in metres minus the radii.
  Value value(int sign, const mpz_class& height, const Vec3z& direction) const;

 private:
  PosedPart a_, b_;
  int unit_ = 0;
  Vec3z offset_;
  mpq_class radius_;
};

}  // namespace clearance::exact
