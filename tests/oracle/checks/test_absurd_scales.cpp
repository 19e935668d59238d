// Sizes from denormals to the largest accepted coordinate: an answer may be wide there, but never wrong. Larger sizes
// are rejected.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/hull/convex_part.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

/// The case times 2^exponent, as far as doubles can represent it.
Case scaled(const Case& c, int exponent) {
  const auto scale = [&](const SolidPtr& from) {
    Solid s = *from;
    for (Vec3d& v : s.vertices)
      for (int k = 0; k < 3; ++k) v[k] = std::ldexp(v[k], exponent);
    s.radius = std::ldexp(s.radius, exponent);
    return std::make_shared<const Solid>(std::move(s));
  };
  Case out{scale(c.a), scale(c.b), c.X_wa, c.X_wb};
  for (Pose* X : {&out.X_wa, &out.X_wb})
    for (int k = 0; k < 3; ++k) X->translation[k] = std::ldexp(X->translation[k], exponent);
  return out;
}

TEST(AbsurdScales, AreNeverAnsweredWrongly) {
  std::vector<Setting> settings = standard_settings();
  std::int64_t answers = 0, undecided = 0;
  for (const int exponent : {-1070, -1000, -700, -540, -530, -520, -510, -500, -490, -480, -400, -350, -300,
                             -280,  -270,  -260, -240, -200, -180, -160, -140, -120, -100, 100,  150,  160}) {
    std::vector<Case> cases;
    for (const CaseClass& cls : case_classes()) {
      if (cls.name.starts_with("size_") || cls.name.starts_with("place_") || cls.name == "gap_far" || cls.cost > 10)
        continue;
      for (std::uint64_t i = 0; i < 12; ++i) {
        const Case c = make_case(cls, 41, i);
        if (exponent > 0 && scale_of(c) > 1e3) continue;
        cases.push_back(scaled(c, exponent));
      }
    }
    const std::vector<Tally> tallies =
        try_cases(cases, settings, 1, false,
                  [&](std::size_t i, const Setting& s, const CheckResult& v, const std::string& answer) {
                    if (v.violation.empty()) return;
                    ADD_FAILURE() << "2^" << exponent << " case " << i << ", " << s.name() << ": " << v.violation
                                  << "\n  " << answer << "\n"
                                  << as_initialiser(cases[i]);
                  });
    for (const Tally& t : tallies) answers += t.cases, undecided += t.contact;
  }
  EXPECT_GT(answers, 20000);
  EXPECT_GT(undecided, 1000);  // below 1e-150 m everything is contact
}

TEST(AbsurdScales, BeyondTheLimitAreRejected) {
  for (const double x : {1e61, 1e200, 1e308}) {
    EXPECT_THROW(make_convex_part({{x, 0, 0}}), std::invalid_argument);
    EXPECT_THROW(make_convex_part({{0, 0, 0}}, x), std::invalid_argument);
    EXPECT_EQ(check({{0, x, 0}}), PoseQuality::kBad);
  }
}

}  // namespace
}  // namespace clearance::exact
