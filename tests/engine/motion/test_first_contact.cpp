// First contact of motions: where the proof ends, where a contact is found, and at what cost.
#include <gtest/gtest.h>

#include "engine/motion/motion_step.h"
#include "tests/engine/motion/motion_test.h"

namespace clearance::test {
namespace {

// A ball that hits another at a known time.
TEST(FirstContact, IsNarrowed) {
  Flight flight;
  Random random(7);
  constexpr double kMargin = 0.02;
  std::vector<double> exact;
  while (exact.size() < 60) {
    const Vec3d from{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    const Vec3d to = Vec3d{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)} * 0.3;
    const Vec3d d = to - from;
    const double a = dot(d, d), b = dot(from, d), c = dot(from, from) - 0.17 * 0.17;
    if (c < 0.01 || b * b - a * c < 1e-4) continue;
    const double t = (-b - std::sqrt(b * b - a * c)) / a;
    if (t < 0 || t > 1) continue;
    flight.add(from, to);
    exact.push_back(t);
  }
  const engine::Engine engine = engine_of(std::move(flight.scene));
  for (const Reduce reduce : {Reduce::kAny, Reduce::kMin, Reduce::kNone}) {
    QueryView query = flight.motions.view(reduce, 1000);
    query.margin = kMargin;
    const Answer answer = evaluate(engine, query);
    for (std::size_t i = 0; i < exact.size(); ++i) {
      const double from = answer.view.first_contact[2 * i], to = answer.view.first_contact[2 * i + 1];
      EXPECT_LE(from, exact[i] + 1e-12);
      EXPECT_GE(to, exact[i] - 1e-12);
      EXPECT_LE(to - from, 2e-3);
      if (reduce == Reduce::kAny) {
        EXPECT_EQ(answer.view.time[i], to);
      }
    }
  }
}

// A ball whose uncertain angle widens the interval of its distance from another one by `width`.
struct UncertainFlight {
  static constexpr double kTouching = 0.15;  // distance of the centres
  engine::Scene scene;
  Motions motions;
  double width = 0;

  UncertainFlight() {
    scene.add_sphere("still", 0.1, {.is_static = true, .pose = Pose{}});
    motions.bodies = {scene.add_sphere("ball", 0.05, {.pose = Pose{{0.5, 0, 0}}, .uncertainty = {.angle = 0.2}})};
    const Answer answer = evaluate(engine_of(scene), QueryView{});
    width = answer.view.upper[0] - answer.view.lower[0];
  }
  void add(const Vec3d& from, const Vec3d& to) {
    motions.poses.push_back(Pose{from});
    motions.poses.push_back(Pose{to});
  }
};

// For tenths of the motion the pair is neither proved beyond its margin nor within it. The search goes on behind that
// time, and ends by itself: with more evaluations each row is the same.
TEST(FirstContact, IsFoundBehindATimeThatCannotBeProved) {
  constexpr double kMargin = 0.02, kSlack = 1e-9;
  UncertainFlight flight;
  ASSERT_GT(flight.width, 0.009);
  Random random(3);
  std::vector<double> unproved, hit;
  for (int i = 0; i < 40; ++i) {
    const double near = UncertainFlight::kTouching + kMargin;
    const double from = near + flight.width * random.uniform(1.5, 6), to = near - flight.width * random.uniform(1.5, 6);
    flight.add({from, 0, 0}, {to, 0, 0});
    unproved.push_back((from - near - flight.width) / (from - to));
    hit.push_back((from - near) / (from - to));
    ASSERT_GT(hit.back() - unproved.back(), 80 * kContactTime);
  }
  const engine::Engine engine = engine_of(flight.scene);
  for (const Reduce reduce : {Reduce::kAny, Reduce::kMin, Reduce::kNone}) {
    QueryView query = flight.motions.view(reduce, 64), longer = flight.motions.view(reduce, 4096);
    query.margin = longer.margin = kMargin;
    if (reduce != Reduce::kAny) query.abs_tol = longer.abs_tol = 1e-4;
    const Answer answer = evaluate(engine, query), same = evaluate(engine, longer);
    for (std::size_t i = 0; i < hit.size(); ++i) {
      const double from = answer.view.first_contact[2 * i], to = answer.view.first_contact[2 * i + 1];
      // Intervals of the least distance are as wide as an eighth of its tolerance.
      const double wide = kSlack + (reduce == Reduce::kAny ? 0 : 1.25e-5 / (0.1 * flight.width));
      EXPECT_LE(from, unproved[i] + kSlack) << i;
      EXPECT_GE(from, unproved[i] - kContactTime - wide) << i;
      EXPECT_GE(to, hit[i] - kSlack) << i;
      EXPECT_LE(to, hit[i] + kContactTime + wide) << i;
      EXPECT_LT(answer.view.steps[i], 64u) << i;
      EXPECT_EQ(from, same.view.first_contact[2 * i]) << i;
      EXPECT_EQ(to, same.view.first_contact[2 * i + 1]) << i;
      EXPECT_EQ(answer.view.status[i], same.view.status[i]) << i;
      EXPECT_EQ(answer.view.lower[i], same.view.lower[i]) << i;
      EXPECT_EQ(answer.view.upper[i], same.view.upper[i]) << i;
      EXPECT_EQ(answer.view.steps[i], same.view.steps[i]) << i;
    }
  }
}

// The pair is neither proved beyond its margin nor within it at any time.
TEST(FirstContact, OfAMotionThatCannotBeProvedAnywhereIsSoonUndecided) {
  UncertainFlight flight;
  const double between = UncertainFlight::kTouching + 0.5 * flight.width;
  flight.add({-0.01, between, 0}, {0.01, between, 0});
  flight.add({0, between, 0}, {0, between, 0});
  const engine::Engine engine = engine_of(flight.scene);
  const Answer answer = evaluate(engine, flight.motions.view(Reduce::kAny));
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(static_cast<Status>(answer.view.status[i]), Status::kUnconverged);
    EXPECT_EQ(answer.view.first_contact[2 * i], 0);
    EXPECT_EQ(answer.view.first_contact[2 * i + 1], kInf);
    EXPECT_LE(answer.view.lower[i], 0);
    EXPECT_NEAR(answer.view.upper[i], between - UncertainFlight::kTouching, 1e-3);
    EXPECT_LE(answer.view.steps[i], i == 0 ? 48u : 1u);
  }
}

}  // namespace
}  // namespace clearance::test
