// Tests of the oracle itself: known rational answers, its own proofs (the direction attains the value), and all
// degenerate inputs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>

#include "tests/oracle/exact/exact_distance.h"

namespace clearance::exact {
namespace {

using Vertices = std::vector<Vec3d>;

Vertices box(Vec3d low, Vec3d high) {
  Vertices v;
  for (int i = 0; i < 8; ++i) v.push_back({i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z});
  return v;
}

/// The oracle's answer, after checks that hold for every pair: the bracket is a tight one, and the direction attains
/// the value.
Result exact_answer(const Vertices& a, double ra, const Pose& Xa, const Vertices& b, double rb, const Pose& Xb) {
  const Result r = exact_distance({a, ra}, Xa, {b, rb}, Xb);
  const double low = r.distance.lower(), high = r.distance.upper();
  EXPECT_GE(r.distance.compare(low), 0);
  EXPECT_LE(r.distance.compare(high), 0);
  EXPECT_TRUE(low == high || std::nextafter(low, 1e300) == high) << low << " " << high;
  EXPECT_FALSE(r.direction.x == 0 && r.direction.y == 0 && r.direction.z == 0);
  return r;
}
Result exact_answer(const Vertices& a, const Vertices& b) {
  return exact_answer(a, 0, {}, b, 0, {});
}

const double kInf = std::numeric_limits<double>::infinity();

TEST(ExactDistance, Points) {
  EXPECT_EQ(exact_answer({{1, 2, 3}}, {{1 + 3, 2 + 4, 3 + 12}}).distance.compare(13), 0);
  const Result same = exact_answer({{1, 2, 3}}, 0.5, {}, {{1, 2, 3}}, 0.25, {});
  EXPECT_TRUE(same.cores_overlap);
  EXPECT_EQ(same.distance.compare(-0.75), 0);
  // Irrational: sqrt(2) lies strictly between two neighbouring doubles.
  const Value v = exact_answer({{0, 0, 0}}, {{1, 1, 0}}).distance;
  EXPECT_EQ(v.lower(), std::nextafter(std::sqrt(2.0), 0.0));
  EXPECT_EQ(v.upper(), std::sqrt(2.0));
}

TEST(ExactDistance, SkewSegmentsAndTriangles) {
  EXPECT_EQ(exact_answer({{-1, 0, 0}, {1, 0, 0}}, {{0, -1, 2.5}, {0, 1, 2.5}}).distance.compare(2.5), 0);
  // From the triangle in x + y + z = 3 to the origin: sqrt(3), squared exactly 3.
  const Result r = exact_answer({{0, 0, 0}}, {{3, 0, 0}, {0, 3, 0}, {0, 0, 3}});
  EXPECT_EQ(r.distance.numerator, 3 * r.distance.denominator);
  ASSERT_EQ(r.simplex.size(), 3u);
  EXPECT_EQ(r.weights[0], r.weights[1]);
  EXPECT_EQ(r.weights[0], r.weights[2]);
  // Parallel overlapping segments, collinear segments, crossing segments.
  EXPECT_EQ(exact_answer({{0, 0, 0}, {4, 0, 0}}, {{1, 3, 4}, {2, 3, 4}}).distance.compare(5), 0);
  EXPECT_EQ(exact_answer({{0, 0, 0}, {4, 0, 0}}, {{5, 0, 0}, {9, 0, 0}}).distance.compare(1), 0);
  EXPECT_EQ(exact_answer({{0, 0, 0}, {4, 0, 0}}, {{2, -1, 0}, {2, 1, 0}}).distance.compare(0), 0);
}

TEST(ExactDistance, Boxes) {
  const Vertices unit = box({0, 0, 0}, {1, 1, 1});
  EXPECT_EQ(exact_answer(unit, box({2, 0, 0}, {3, 1, 1})).distance.compare(1), 0);
  EXPECT_EQ(exact_answer(unit, box({4, 5, 13}, {5, 6, 14})).distance.compare(13), 0);           // corners: 3, 4, 12
  EXPECT_EQ(exact_answer(unit, box({1, 0, 0}, {2, 1, 1})).distance.compare(0), 0);              // faces touch
  EXPECT_EQ(exact_answer(unit, box({1, 1, 1}, {2, 2, 2})).distance.compare(0), 0);              // corners touch
  EXPECT_EQ(exact_answer(unit, box({0.75, 0.5, 0.25}, {2, 2, 2})).distance.compare(-0.25), 0);  // depth
  EXPECT_EQ(exact_answer(unit, unit).distance.compare(-1), 0);                                  // coincident
  EXPECT_EQ(exact_answer(unit, box({0.25, 0.25, 0.25}, {0.75, 0.75, 0.75})).distance.compare(-0.75), 0);  // inside
  EXPECT_EQ(exact_answer(unit, 0.5, {}, box({0.5, 0, 0}, {2, 1, 1}), 0.25, {}).distance.compare(-1.25), 0);
  // The last bit of a gap, and of a depth.
  const double more = std::nextafter(1.0, 2.0), less = std::nextafter(1.0, 0.0);
  EXPECT_EQ(exact_answer(unit, box({more, 0, 0}, {2, 1, 1})).distance.compare(more - 1), 0);
  EXPECT_EQ(exact_answer(unit, box({less, 0, 0}, {2, 1, 1})).distance.compare(less - 1), 0);
}

TEST(ExactDistance, RotationsAreExactAndOfAnyNorm) {
  // (w, x, y, z) = (2, 0, 0, 1): cos = 3/5, sin = 4/5, about z.
  for (const double s : {1.0, 1e-6, 3.0, 1e6}) {
    const Result r = exact_answer({{0, 0, 0}}, 0, {}, {{5, 0, 0}}, 0, {{0, 0, 0}, 2 * s, 0, 0, s});
    EXPECT_EQ(r.distance.compare(5), 0) << s;
    const Result shifted = exact_answer({{3, 4, 0}}, 0, {}, {{5, 0, 0}}, 0, {{0, 0, 7}, 2 * s, 0, 0, s});
    if (s == 1.0 || s == 3.0)
      EXPECT_EQ(shifted.distance.compare(7), 0) << s;
    else
      EXPECT_NEAR(shifted.distance.lower(), 7, 1e-14);  // 2 s and s round differently
  }
  // Both have the same rotation, which does not change the distance.
  const Pose X{{1e9, -1e9, 1e8}, 2, 0, 0, 1};
  EXPECT_EQ(exact_answer(box({0, 0, 0}, {1, 1, 1}), 0, X, box({4, 5, 13}, {5, 6, 14}), 0, X).distance.compare(13), 0);
  EXPECT_EQ(exact_answer(box({0, 0, 0}, {1, 1, 1}), 0, X, box({0, 0, 0.75}, {1, 1, 14}), 0, X).distance.compare(-0.25),
            0);
}

TEST(ExactDistance, FlatDifferencesHaveDepthZero) {
  const Vertices square = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  for (const Vertices& other :
       {square, Vertices{{1, 1, 0}}, Vertices{{1, -1, 0}, {1, 5, 0}}, Vertices{{1, 1, 0}, {1, 1, 0}}}) {
    const Result r = exact_answer(square, other);
    EXPECT_TRUE(r.cores_overlap);
    EXPECT_EQ(r.distance.compare(0), 0);
    EXPECT_EQ(exact_answer(square, 1, {}, other, 2, {}).distance.compare(-3), 0);
  }
  EXPECT_EQ(exact_answer({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {{1, 1, 1}, {3, 3, 3}}).distance.compare(0), 0);
  // A flat part through a solid one, and a segment through a flat one, have depth.
  EXPECT_EQ(exact_answer(box({0, 0, -1}, {2, 2, 3}), square).distance.compare(-1), 0);
  EXPECT_EQ(exact_answer(square, {{1, 1, -0.5}, {1, 1, 4}}).distance.compare(-0.5), 0);
}

TEST(ExactDistance, DuplicatedAndInnerVerticesChangeNothing) {
  Vertices a = box({0, 0, 0}, {1, 1, 1}), b = box({0.5, 0.5, 2}, {1, 1, 3});
  const Result plain = exact_answer(a, b);
  a.insert(a.end(), {{0.5, 0.5, 0.5}, {0.5, 0.5, 1}, {1, 1, 1}, {1, 1, 1}});
  b.insert(b.end(), {{0.75, 0.75, 2}, {0.5, 0.5, 2}});
  EXPECT_EQ(exact_answer(a, b).distance.compare(plain.distance), 0);
}

TEST(ExactDistance, HugeTinyAndMixedScales) {
  const double tiny = 0x1p-400, huge = 0x1p190;
  EXPECT_EQ(exact_answer({{0, 0, 0}}, {{3 * tiny, 4 * tiny, 0}}).distance.compare(5 * tiny), 0);
  EXPECT_EQ(exact_answer({{0, 0, 0}}, {{3 * huge, 4 * huge, 0}}).distance.compare(5 * huge), 0);
  EXPECT_EQ(exact_answer(box({-huge, -huge, -huge}, {huge, huge, 0}), {{0, 0, tiny}}).distance.compare(tiny), 0);
  const double denormal = std::numeric_limits<double>::denorm_min();
  EXPECT_EQ(exact_answer({{0, 0, 0}}, {{0, 0, denormal}}).distance.compare(denormal), 0);
}

// The first face of the polytope is 1e-324 from the origin, the answer 1: found by clearance-mine, when the two did not
// fit into one range of doubles.
TEST(ExactDistance, DepthNextToADenormal) {
  const double denormal = std::numeric_limits<double>::denorm_min();
  const Vertices cube = box({0, 0, 0}, {1, 1, 1});
  for (int k = 0; k < 3; ++k) {
    Pose X;
    X.translation[k] = denormal;
    const Value v = exact_answer(cube, 0, {}, cube, 0, X).distance;
    EXPECT_EQ(v.compare(-1), 1);
    EXPECT_EQ(v.lower(), -1);
  }
  std::mt19937_64 random(14);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    Vertices a;
    for (int k = 0; k < 10; ++k) a.push_back({normal(random), normal(random), normal(random)});
    Pose X{{0, 0, 0}, normal(random), normal(random), normal(random), normal(random)}, Y = X;
    Y.translation.y = denormal;
    const Value same = exact_distance({a, 0}, X, {a, 0}, X).distance,
                moved = exact_distance({a, 0}, X, {a, 0}, Y).distance;
    ASSERT_NEAR(moved.lower(), same.lower(), 1e-15 * std::abs(same.lower())) << i;
  }
}

TEST(ExactDistance, BadInputIsRejected) {
  const Vertices p = {{0, 0, 0}};
  EXPECT_THROW(exact_distance({{}, 0}, {}, {p, 0}, {}), std::invalid_argument);
  EXPECT_THROW(exact_distance({p, 0}, {}, {p, 0}, {{0, 0, 0}, 0, 0, 0, 0}), std::invalid_argument);
  EXPECT_THROW(exact_distance({p, 0}, {{kInf, 0, 0}}, {p, 0}, {}), std::invalid_argument);
  EXPECT_THROW(exact_distance({p, std::nan("")}, {}, {p, 0}, {}), std::invalid_argument);
  EXPECT_THROW(exact_support_gap({p, 0}, {}, {p, 0}, {}, {0, 0, 0}), std::invalid_argument);
}

TEST(ExactSupportGap, IsTheGapOfBoxesAlongAnAxis) {
  const Vertices a = box({0, 0, 0}, {1, 1, 1}), b = box({3, 0, 0}, {4, 1, 1});
  EXPECT_EQ(exact_support_gap({a, 0}, {}, {b, 0}, {}, {1, 0, 0}).compare(2), 0);
  EXPECT_EQ(exact_support_gap({a, 0.5}, {}, {b, 0.25}, {}, {7, 0, 0}).compare(1.25), 0);
  EXPECT_EQ(exact_support_gap({a, 0}, {}, {b, 0}, {}, {-1, 0, 0}).compare(-4), 0);
  EXPECT_EQ(exact_support_gap({a, 0}, {}, {b, 0}, {}, {0, 1, 0}).compare(-1), 0);
  const Vertices c = box({4, 0, 0}, {5, 1, 1});
  EXPECT_EQ(exact_support_gap({a, 0}, {}, {c, 0}, {}, {3, 4, 0}).compare(1), 0);  // (3 * 4 - 3 - 4) / 5
}

// ---- comparison with enumeration

/// All differences b - a, as integers in the unit that the cases use.
std::vector<Vec3z> differences(const Vertices& a, const Vertices& b) {
  std::vector<Vec3z> c;
  for (const Vec3d& p : a)
    for (const Vec3d& q : b) c.push_back({mpz_class(q.x - p.x), mpz_class(q.y - p.y), mpz_class(q.z - p.z)});
  return c;
}

/// The largest support gap over every direction that can matter, by brute force over all points, pairs and triples of
/// C: squared, with its sign, as a rational. The textbook definition, without any of the oracle's optimisations.
mpq_class signed_squared_gap_by_enumeration(const std::vector<Vec3z>& c) {
  std::vector<Vec3z> directions = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const Vec3z& p : c) {
    directions.push_back(p);
    for (const Vec3z& q : c) {
      const Vec3z e = q - p;
      directions.push_back(cross(cross(e, p), e));  // nearest point of a line
      for (int k = 0; k < 3; ++k) directions.push_back(cross(e, Vec3z{k == 0, k == 1, k == 2}));  // flat sets
    }
  }
  for (std::size_t i = 0; i < c.size(); ++i)
    for (std::size_t j = i + 1; j < c.size(); ++j)
      for (std::size_t k = j + 1; k < c.size(); ++k) directions.push_back(cross(c[j] - c[i], c[k] - c[i]));
  std::optional<mpq_class> best;
  for (const Vec3z& direction : directions)
    for (const Vec3z& n : {direction, Vec3z(-direction)}) {
      const mpz_class nn = squared_norm(n);
      if (nn == 0) continue;
      mpz_class low = dot(n, c[0]);
      for (const Vec3z& p : c) low = std::min(low, dot(n, p));
      mpq_class squared(low * low * sgn(low), nn);
      squared.canonicalize();
      if (!best || squared > *best) best = squared;
    }
  return *best;
}

// Small integer lattices: every tie and degeneracy, in exact agreement with the definition.
TEST(ExactDistance, AgreesWithEnumerationOnLattices) {
  std::mt19937_64 random(11);
  int apart = 0, touching = 0, deep = 0;
  for (int i = 0; i < 1000; ++i) {
    const int range = 1 + static_cast<int>(random() % 3), shift = static_cast<int>(random() % 5);
    const auto points = [&](int count, double offset) {
      Vertices v;
      for (int k = 0; k < count; ++k) {
        const auto coordinate = [&] { return static_cast<double>(random() % (2 * range + 1)) - range; };
        const double x = coordinate(), y = coordinate(), z = coordinate();
        v.push_back({x + offset, y, z});
      }
      return v;
    };
    const Vertices a = points(1 + random() % 5, 0), b = points(1 + random() % 5, shift);
    const Value v = exact_answer(a, b).distance;
    const mpq_class expected = signed_squared_gap_by_enumeration(differences(a, b));
    mpq_class found(v.sign * v.numerator, v.denominator);
    found.canonicalize();
    ASSERT_EQ(found, expected) << "case " << i;
    (v.sign > 0 ? apart : v.sign == 0 ? touching : deep)++;
  }
  EXPECT_GT(apart, 200);
  EXPECT_GT(touching, 50);
  EXPECT_GT(deep, 50);
}

// On random pairs the value is attained by its own direction (a lower bound) and, apart, by its own witness (an upper
// bound). It stays the same with swapped bodies and in other frames.
TEST(ExactDistance, ValueIsAttainedAndSymmetric) {
  std::mt19937_64 random(12);
  std::normal_distribution<double> normal;
  int overlaps = 0;
  for (int i = 0; i < 300; ++i) {
    const auto cloud = [&] {
      Vertices v;
      for (int k = 0; k < 42; ++k) v.push_back({normal(random), normal(random), normal(random)});
      return v;
    };
    const auto pose = [&] {
      return Pose{{2 * normal(random), 2 * normal(random), 2 * normal(random)},
                  normal(random),
                  normal(random),
                  normal(random),
                  normal(random)};
    };
    const Vertices a = cloud(), b = cloud();
    const Pose Xa = pose(), Xb = pose();
    const Result r = exact_answer(a, 0.125, Xa, b, 0, Xb);
    overlaps += r.cores_overlap;
    ASSERT_EQ(exact_distance({b, 0}, Xb, {a, 0.125}, Xa).distance.compare(r.distance), 0);
    // The direction rounded to doubles loses about 2^-53 of the extent, not more.
    mpz_class largest =
        std::max({mpz_class(abs(r.direction.x)), mpz_class(abs(r.direction.y)), mpz_class(abs(r.direction.z))});
    Vec3d n;
    for (int k = 0; k < 3; ++k) n[k] = mpf_class(mpf_class(r.direction[k], 128) / mpf_class(largest, 128)).get_d();
    const Value gap = exact_support_gap({a, 0.125}, Xa, {b, 0}, Xb, n);
    ASSERT_LE(gap.compare(r.distance), 0);
    ASSERT_NEAR(gap.lower(), r.distance.lower(), 1e-13);
    // No other direction gives a larger gap.
    for (int k = 0; k < 20; ++k)
      ASSERT_LE(exact_support_gap({a, 0.125}, Xa, {b, 0}, Xb, {normal(random), normal(random), normal(random)})
                    .compare(r.distance),
                0);
  }
  EXPECT_GT(overlaps, 50);
  EXPECT_LT(overlaps, 250);
}

}  // namespace
}  // namespace clearance::exact
