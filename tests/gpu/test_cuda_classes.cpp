// Every class of hard cases through the cuda backend: accepted by the exact oracle, with the CPU's bits.
#include "tests/engine/cuda/same_answer.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

class CudaClasses : public testing::TestWithParam<std::size_t> {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

std::vector<Case> cases_of(const CaseClass& c, int count, std::uint64_t seed) {
  std::vector<Case> cases;
  for (int i = 0; i < count; ++i) cases.push_back(make_case(c, seed, static_cast<std::uint64_t>(i)));
  return cases;
}

TEST_P(CudaClasses, AreContained) {
  const CaseClass& c = case_classes()[GetParam()];
  const std::vector<Case> cases = cases_of(c, 60, 21);
  const std::vector<Setting> settings = standard_settings({"cuda"});
  int shown = 0;
  const std::vector<Tally> tallies = try_cases(
      cases, settings, 1, true, [&](std::size_t i, const Setting& s, const CheckResult& v, const std::string& answer) {
        if (++shown <= 5)
          ADD_FAILURE() << c.name << " case " << i << ", " << s.name() << ": " << v.violation << ' ' << v.inaccuracy
                        << "\n  " << answer;
      });
  for (const Tally& t : tallies) {
    EXPECT_EQ(t.cases, 60);
    EXPECT_EQ(t.violations, 0);
    EXPECT_EQ(t.inaccurate, 0);
    EXPECT_EQ(t.unconverged, 0);
  }
}

// The cases' bodies in many configurations: at the case's poses, then moved a little and a lot, so that pairs that
// share both hulls fill blocks.
TEST_P(CudaClasses, HaveTheBitsOfTheCpuInConfigurations) {
  constexpr std::uint32_t kCases = 8, kConfigurations = 96;
  const CaseClass& c = case_classes()[GetParam()];
  const std::vector<Case> cases = cases_of(c, kCases, 22);
  const auto make_scene = [&] {
    engine::Scene scene;
    for (std::uint32_t i = 0; i < kCases; ++i)
      for (const bool is_b : {false, true}) {
        Body body;
        const Solid& solid = is_b ? *cases[i].b : *cases[i].a;
        body.name = (is_b ? "b" : "a") + std::to_string(i);
        body.parts = {make_convex_part(solid.vertices, solid.radius)};
        body.pose = is_b ? cases[i].X_wb : cases[i].X_wa;
        scene.add_body(std::move(body));
      }
    return scene;
  };
  const engine::Engine device(make_scene(), {"cuda"}),
      cpu(make_scene(), {.backend = "cpu", .covers = engine::Covers::kOff});
  std::vector<std::uint32_t> bodies;
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 0; i < kCases; ++i) {
    bodies.push_back(2 * i);
    bodies.push_back(2 * i + 1);
    pairs.push_back({2 * i, 2 * i + 1});
  }
  Random random(23);
  std::vector<Pose> poses;
  for (std::uint32_t k = 0; k < kConfigurations; ++k)
    for (const Case& one : cases) {
      Pose X_wa = one.X_wa, X_wb = one.X_wb;
      if (k % 3 == 1)
        X_wb.translation += random.direction() * (random.uniform() * norm(X_wb.translation - X_wa.translation));
      if (k % 3 == 2) X_wa = random.rotation(X_wa.translation);
      poses.push_back(X_wa);
      poses.push_back(X_wb);
    }
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = kConfigurations;
  q.fields = test::kAllFields;
  for (int kind = 0; kind < 3; ++kind) {
    if (kind == 1) q.rel_tol = 0;
    if (kind == 2) q.rel_tol = -1, q.max_distance = 0.5 * norm(cases[0].X_wb.translation - cases[0].X_wa.translation);
    test::expect_same(test::evaluate(device, q), test::evaluate(cpu, q), c.name + " kind " + std::to_string(kind));
    for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin, Reduce::kWithin}) {
      QueryView reduced = q;
      reduced.reduce = reduce;
      test::expect_same(test::evaluate(device, reduced), test::evaluate(cpu, reduced),
                        c.name + " kind " + std::to_string(kind) + " reduction " + std::to_string(int(reduce)), true);
    }
    if (HasFailure()) return;
  }
}

INSTANTIATE_TEST_SUITE_P(Classes, CudaClasses, testing::Range<std::size_t>(0, case_classes().size()),
                         [](const auto& param) { return case_classes()[param.param].name; });

}  // namespace
}  // namespace clearance::exact
