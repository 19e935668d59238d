// Tests that the checker detects every error of an answer, down to a last bit.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Two unit boxes 1/3 apart (rounded), and the best possible answer for them.
struct Apart {
  Case c;
  Result exact_value;
  Setting setting;
  Answer answer;

  explicit Apart(double gap = 1.0 / 3) {
    std::vector<Vec3d> box;
    for (int i = 0; i < 8; ++i) box.push_back({i & 1 ? 0.5 : -0.5, i & 2 ? 0.5 : -0.5, i & 4 ? 0.5 : -0.5});
    c.a = c.b = std::make_shared<const Solid>(Solid{box, 0});
    c.X_wb.translation = {1 + gap, 0, 0};
    exact_value = exact_answer(c);
    const double exact = exact_value.distance.lower();
    setting.signed_distance = true;
    answer.distance = answer.lower = answer.upper = exact;
    answer.status = exact > 0 ? Status::kOk : exact < 0 ? Status::kOverlap : Status::kContact;
    answer.point_a = {0.5, 0, 0};
    answer.point_b = {0.5 + exact, 0, 0};
    answer.normal = {1, 0, 0};
  }
  CheckResult verdict() const { return hold_against(c, exact_value, setting, answer); }
};

TEST(CheckResult, AcceptsTheExactAnswer) {
  for (const double gap : {1.0 / 3, 0.0, -0.25, 1e-16}) {
    const Apart a(gap);
    EXPECT_TRUE(a.verdict().good()) << gap << ": " << a.verdict().violation << a.verdict().inaccuracy;
    EXPECT_EQ(a.verdict().error, 0) << gap;
    EXPECT_EQ(a.verdict().width, 0) << gap;
  }
}

struct Lie {
  const char* what;
  double gap;
  std::function<void(Apart&)> tell;
  bool is_violation = true;
};

TEST(CheckResult, SeesEveryLie) {
  const auto up = [](double x) { return std::nextafter(x, kInf); };
  const auto down = [](double x) { return std::nextafter(x, -kInf); };
  const std::vector<Lie> lies = {
      {"lower a bit too high", 1.0 / 3,
       [&](Apart& a) { a.answer.lower = a.answer.upper = a.answer.distance = up(a.answer.lower); }},
      {"upper a bit too low", 1.0 / 3,
       [&](Apart& a) { a.answer.lower = a.answer.upper = a.answer.distance = down(a.answer.upper); }},
      {"a depth a bit too small", -0.25,
       [&](Apart& a) { a.answer.lower = a.answer.upper = a.answer.distance = up(-0.25); }},
      {"a depth a bit too large", -0.25,
       [&](Apart& a) { a.answer.lower = a.answer.upper = a.answer.distance = down(-0.25); }},
      {"NaN", 1.0 / 3, [](Apart& a) { a.answer.lower = std::nan(""); }},
      {"bounds crossed", 1.0 / 3,
       [&](Apart& a) { std::swap(a.answer.lower, a.answer.upper), a.answer.lower = up(a.answer.upper); }},
      {"overlap though apart", 1.0 / 3, [](Apart& a) { a.answer.status = Status::kOverlap; }},
      {"contact though apart", 1.0 / 3, [](Apart& a) { a.answer.status = Status::kContact; }},
      {"ok though overlapping", -0.25, [](Apart& a) { a.answer.status = Status::kOk; }},
      {"ok though touching", 0.0, [](Apart& a) { a.answer.status = Status::kOk; }},
      {"beyond though near", 1.0 / 3, [](Apart& a) { a.answer.status = Status::kBeyond, a.setting.max_distance = 1; }},
      {"no pose", 1.0 / 3, [](Apart& a) { a.answer.status = Status::kNoPose; }},
      {"ok but wide", 1.0 / 3, [](Apart& a) { a.answer.lower *= 0.99; }},
      {"not clipped", -0.25, [](Apart& a) { a.setting.signed_distance = false; }},
      {"distance is not a bound", 1.0 / 3, [&](Apart& a) { a.answer.distance = up(a.answer.distance); }},
      {"normal of length 2", 1.0 / 3, [](Apart& a) { a.answer.normal = {2, 0, 0}; }},
      {"a point that is NaN", 1.0 / 3, [](Apart& a) { a.answer.point_a.x = std::nan(""); }},
      {"normal that proves nothing", 1.0 / 3, [](Apart& a) { a.answer.normal = {0, 1, 0}; }, false},
      {"normal reversed", 1.0 / 3, [](Apart& a) { a.answer.normal = {-1, 0, 0}; }, false},
      {"point_a outside", 1.0 / 3, [](Apart& a) { a.answer.point_a.x += 1e-13; }, false},
      {"point_b outside", 1.0 / 3, [](Apart& a) { a.answer.point_b.x -= 1e-13; }, false},
      {"points too far apart", 1.0 / 3, [](Apart& a) { a.answer.point_b.x += 0.1; }, false},
      {"wide and unconverged", 1.0 / 3,
       [](Apart& a) {
         a.answer.upper = a.answer.distance = 0.4, a.answer.point_b.x = 0.9, a.answer.status = Status::kUnconverged;
       },
       false},
  };
  for (const Lie& lie : lies) {
    Apart a(lie.gap);
    ASSERT_TRUE(a.verdict().good());
    lie.tell(a);
    const CheckResult v = a.verdict();
    EXPECT_FALSE(v.good()) << lie.what;
    EXPECT_EQ(!v.violation.empty(), lie.is_violation) << lie.what << ": " << v.violation;
  }
}

// The engine's own bounds, each moved past the exact value by a last bit.
TEST(CheckResult, SeesALastBitOnEveryClass) {
  for (const CaseClass& cls : case_classes()) {
    int seen = 0;
    for (int i = 0; i < 10; ++i) {
      const Case c = make_case(cls, 9, static_cast<std::uint64_t>(i));
      const Result exact_value = exact_answer(c);
      Setting s;
      s.signed_distance = true;
      Answer a;
      a.status = Status::kUnconverged;
      a.lower = exact_value.distance.lower(), a.upper = exact_value.distance.upper(), a.distance = a.upper;
      ASSERT_TRUE(hold_against(c, exact_value, s, a, false).violation.empty()) << cls.name;
      Answer high = a, low = a;
      high.lower = high.upper = std::nextafter(a.upper, kInf);
      low.lower = low.upper = std::nextafter(a.lower, -kInf);
      seen += !hold_against(c, exact_value, s, high, false).violation.empty() &&
              !hold_against(c, exact_value, s, low, false).violation.empty();
    }
    EXPECT_EQ(seen, 10) << cls.name;
  }
}

}  // namespace
}  // namespace clearance::exact
