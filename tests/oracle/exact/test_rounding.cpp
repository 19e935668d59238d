// Compares the rounding terms of certify() with actual rounding: for each class of cases, the error of the computed gap
// and of the computed witness distance, before the terms are added, in units of 2^-53 S. docs/trust/bounds.md derives
// the terms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "engine/narrow/certify.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/narrow_phase.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 6;
constexpr std::uint64_t kSeedF32 = 3;  // of six tried, the one with the largest errors
constexpr int kCases = 150;

Vec3d to_doubles(const Vec3z& v) {
  mpz_class largest = 0;
  for (int k = 0; k < 3; ++k) largest = std::max(largest, mpz_class(abs(v[k])));
  Vec3d n;
  for (int k = 0; k < 3; ++k) n[k] = mpf_class(mpf_class(v[k], 128) / mpf_class(largest, 128)).get_d();
  return n;
}

struct Placed {
  ConvexPartPtr a, b;
  PlacedPair<double> pair;
  PlacedPair<DoubleDouble> fine;

  explicit Placed(const Case& c)
      : a(make_convex_part(c.a->vertices, c.a->radius)),
        b(make_convex_part(c.b->vertices, c.b->radius)),
        pair(*a, rotation_of(c.X_wa), c.X_wa.translation, *b, rotation_of(c.X_wb), c.X_wb.translation),
        fine(*a, rotation_of_double_double(c.X_wa), c.X_wa.translation, *b, rotation_of_double_double(c.X_wb),
             c.X_wb.translation) {}
};

/// (x - exact) / (2^-53 S), for a value x computed in doubles.
double units(double x, const Value& exact, double scale) {
  const double error = exact.compare(x) < 0 ? x - exact.lower() : x - exact.upper();
  return error / (0x1p-53 * scale);
}

TEST(Rounding, TheLowerTermCoversEveryErrorAndIsOfItsSize) {
  double worst = 0;
  std::string where;
  for (const CaseClass& cls : case_classes()) {
    Random random(kSeed);
    for (int i = 0; i < kCases; ++i) {
      const Case c = make_case(cls, kSeed, static_cast<std::uint64_t>(i));
      const Placed p(c);
      const Result exact_value = exact_answer(c);
      std::vector<Vec3d> directions = {to_doubles(exact_value.direction), random.direction(), {1, 0, 0}, {0, -1, 1}};
      directions.push_back(directions[0] * random.log_uniform(1e-9, 1e9));
      for (const Vec3d& n : directions) {
        const Value gap = exact_support_gap(view(*c.a), c.X_wa, view(*c.b), c.X_wb, n);
        // Bounds take directions in a's axes; rounding this one to double costs less than two of the units.
        const Vec3<DoubleDouble> n_a = p.fine.R_wa.transpose_times(cast<DoubleDouble>(n));
        const double lower = certify_lower(p.pair, cast<double>(n_a)), fine = certify_lower(p.fine, n_a);
        ASSERT_GE(gap.compare(lower), 0) << cls.name << ' ' << i;
        ASSERT_GE(gap.compare(fine), 0) << cls.name << ' ' << i;
        ASSERT_LE(gap.lower() - fine, 0x1p-51 * std::abs(fine) + 0x1p-95 * p.pair.scale) << cls.name << ' ' << i;
        const double error = std::abs(units(lower + p.pair.lower_error(), gap, p.pair.scale));
        if (error > worst) worst = error, where = cls.name;
      }
    }
  }
  std::printf("lower: worst error %.3g x 2^-53 S (%s), allowed %g\n", worst, where.c_str(),
              RoundingUnits<double>::kLower);
  EXPECT_LE(worst, RoundingUnits<double>::kLower);
  EXPECT_GE(worst, RoundingUnits<double>::kLower / 10);
}

TEST(Rounding, TheUpperTermCoversEveryErrorAndIsOfItsSize) {
  double worst = 0;
  std::string where;
  int solved = 0;
  for (const CaseClass& cls : case_classes())
    for (int i = 0; i < kCases; ++i) {
      const Case c = make_case(cls, kSeed, static_cast<std::uint64_t>(i));
      const Result exact_value = exact_answer(c, false);
      if (exact_value.cores_overlap) continue;
      ++solved;
      const Placed p(c);
      // The exact witness, its weights rounded: to first order the error of the computed distance is rounding alone.
      Simplex<double> s;
      mpz_class sum = 0;
      for (const mpz_class& w : exact_value.weights) sum += w;
      for (std::size_t k = 0; k < exact_value.simplex.size(); ++k) {
        s.vertex[s.size].a = exact_value.simplex[k].a;
        s.vertex[s.size].b = exact_value.simplex[k].b;
        s.weight[s.size++] = mpf_class(mpf_class(exact_value.weights[k], 128) / mpf_class(sum, 128)).get_d();
      }
      const double upper = certify_upper(p.pair, s).upper;
      ASSERT_LE(exact_value.distance.compare(upper), 0) << cls.name << ' ' << i;
      const double error = std::abs(units(upper - p.pair.upper_error(), exact_value.distance, p.pair.scale));
      if (error > worst) worst = error, where = cls.name;
      // Poor witnesses must give valid bounds, too.
      for (int k = 0; k < s.size; ++k) s.weight[k] = 1.0 / (k + 1);
      ASSERT_LE(exact_value.distance.compare(certify_upper(p.pair, s).upper), 0) << cls.name << ' ' << i;
    }
  std::printf("upper: worst error %.3g x 2^-53 S (%s), allowed %g\n", worst, where.c_str(),
              RoundingUnits<double>::kUpper);
  EXPECT_GT(solved, 1000);
  EXPECT_LE(worst, RoundingUnits<double>::kUpper);
  EXPECT_GE(worst, RoundingUnits<double>::kUpper / 10);
}

// Float32 lanes: the bounds that they prove, without their terms. Loose tolerances end GJK at its first directions.
TEST(Rounding, TheFloat32TermsCoverEveryErrorAndAreOfItsSize) {
  double worst_lower = 0, worst_upper = 0;
  int proved = 0;
  for (const CaseClass& cls : case_classes())
    for (int i = 0; i < 30; ++i) {
      const Case c = make_case(cls, kSeedF32, static_cast<std::uint64_t>(i));
      const Placed p(c);
      if (!fits_f32(*p.a, *p.b)) continue;
      for (const double rel_tol : {1.0, 0.1, 1e-2, 1e-3, 1e-4}) {
        const LaneHull hull_a(*p.a), hull_b(*p.b);
        const LanePair placed{&hull_a, &hull_b, &p.pair.R_wa, &p.pair.R_wb, &c.X_wa.translation, &c.X_wb.translation};
        LaneAnswer answer;
        CoreWitness witness;
        Gjk<double> unused;
        lane_kernel("auto").run_f32({&placed, 1, true, 0, rel_tol, 64, &answer, &witness, &unused});
        if (!answer.converged) continue;
        ++proved;
        const Vec3d centres = p.a->centre - p.pair.R * p.b->centre - p.pair.D;
        const double scale = norm(centres) + p.a->spread + p.b->spread + p.pair.radius, unit = 0x1p-24 * scale;
        const double extra = 24 * 0x1p-53 * (norm(p.pair.D) + p.a->rho + p.b->rho + p.pair.radius);
        const Value gap = exact_support_gap(view(*c.a), c.X_wa, view(*c.b), c.X_wb, witness.n);
        ASSERT_GE(gap.compare(answer.lower), 0) << cls.name << ' ' << i;
        const double error = std::abs(answer.lower + RoundingUnits<float>::kLower * unit + extra - gap.lower()) / unit;
        worst_lower = std::max(worst_lower, error);
        Vec3d point_a, point_b, normal;
        take_lane_witness(*p.a, p.pair.R_wa, *p.b, p.pair.R_wb, witness, point_a, point_b, normal);
        const double between = norm(point_b - point_a + (c.X_wb.translation - c.X_wa.translation));
        ASSERT_LE(between, answer.upper + 0x1p-49 * p.pair.scale) << cls.name << ' ' << i;
        worst_upper = std::max(worst_upper,
                               std::abs(answer.upper - RoundingUnits<float>::kUpper * unit - extra - between) / unit);
      }
    }
  std::printf("float32, %d answers: worst errors %.3g and %.3g x 2^-24 S, allowed %g and %g\n", proved, worst_lower,
              worst_upper, RoundingUnits<float>::kLower, RoundingUnits<float>::kUpper);
  EXPECT_GT(proved, 500);
  EXPECT_LE(worst_lower, RoundingUnits<float>::kLower);
  EXPECT_GE(worst_lower, RoundingUnits<float>::kLower / 16);
  EXPECT_LE(worst_upper, RoundingUnits<float>::kUpper);
  EXPECT_GE(worst_upper, RoundingUnits<float>::kUpper / 16);
}

}  // namespace
}  // namespace clearance::exact
