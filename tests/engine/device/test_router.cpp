// Backend auto: the choice of backend and its reasons. Needs no GPU: the costs are synthetic, and a fake device leaves
// all rows to the CPU.
#include <functional>

#include "engine/device/router.h"
#include "tests/engine/cuda/same_answer.h"
#include "tests/engine/device/fake_device.h"

namespace clearance::test {
namespace {

using cuda::QueryKind;
using cuda::Router;

// A machine: time in ns of a query with this many pairs.
struct Machine {
  std::function<double(double)> cpu, device;
  double best(double pairs) const { return std::min(cpu(pairs), device(pairs)); }
};
double line(double fixed, double each, double pairs) {
  return fixed + each * pairs;
}
Machine machine(double cpu_each, double device_fixed, double device_each) {
  return {[=](double p) { return line(1'000, cpu_each, p); },
          [=](double p) { return line(device_fixed, device_each, p); }};
}

struct Ran {
  double took = 0, best = 0;
  int on_device = 0;
};
Ran run(Router& router, const Machine& machine, std::uint64_t pairs, int queries, QueryKind kind = QueryKind::kDense) {
  Ran ran;
  for (int i = 0; i < queries; ++i) {
    const bool device = router.to_device(kind, pairs);
    const double took = device ? machine.device(static_cast<double>(pairs)) : machine.cpu(static_cast<double>(pairs));
    router.learn(kind, pairs, device, std::chrono::nanoseconds(static_cast<std::int64_t>(took)));
    ran.took += took;
    ran.best += machine.best(static_cast<double>(pairs));
    ran.on_device += device;
  }
  return ran;
}

TEST(Router, FindsTheFasterBackendOfEachSizeOnVeryDifferentMachines) {
  const Machine machines[] = {machine(30, 30'000, 0.7), machine(400, 30'000, 5), machine(2, 200'000, 0.5),
                              machine(5'000, 10'000, 50)};
  int to_cpu = 0, to_device = 0;
  for (const Machine& m : machines)
    for (const std::uint64_t pairs : {1u, 30u, 1'000u, 30'000u, 1'000'000u}) {
      Router router(16);
      const Ran ran = run(router, m, pairs, 1'000);
      EXPECT_LT(ran.took, 1.15 * ran.best) << pairs << " pairs";
      const double cpu = m.cpu(static_cast<double>(pairs)), device = m.device(static_cast<double>(pairs));
      (cpu < device ? to_cpu : to_device) += 1;
      if (cpu < 0.5 * device) {
        EXPECT_LT(ran.on_device, 20) << pairs << " pairs";
      } else if (device < 0.5 * cpu) {
        EXPECT_GT(ran.on_device, 980) << pairs << " pairs";
      }
    }
  EXPECT_GT(to_cpu, 3);
  EXPECT_GT(to_device, 3);
}

TEST(Router, GuessesASizeFromTheNearestThatItHasSeen) {
  // A CPU whose boxes answer most pairs, a hundred times faster than the initial estimate.
  const Machine m = machine(0.05, 30'000, 1);
  Router router(1);
  run(router, m, 1 << 16, 100, QueryKind::kNear);
  EXPECT_FALSE(router.to_device(QueryKind::kNear, 1 << 18)) << "the first query of that size";
  EXPECT_TRUE(router.to_device(QueryKind::kDense, 1 << 18)) << "another kind knows nothing of it";
}

TEST(Router, OneQueryThatWasHeldUpChangesLittle) {
  const Machine m = machine(400, 30'000, 1);
  Router router(4);
  run(router, m, 100'000, 100);
  router.learn(QueryKind::kDense, 100'000, true, std::chrono::milliseconds(20));
  EXPECT_TRUE(router.to_device(QueryKind::kDense, 100'000));
}

TEST(Router, AColdFirstAnswerDoesNotStay) {
  // One or a few motions: the CPU is twice as fast, but its first query takes ten times as long as the device's.
  const Machine m = machine(30'000, 600'000, 1);
  for (const bool is_cpu_cold : {true, false}) {
    Router router(16);
    const Machine cold = is_cpu_cold ? machine(600'000, 600'000, 1) : machine(30'000, 6'000'000, 1);
    router.learn(QueryKind::kMotion, 10, true, std::chrono::nanoseconds(static_cast<std::int64_t>(cold.device(10))));
    router.learn(QueryKind::kMotion, 10, false, std::chrono::nanoseconds(static_cast<std::int64_t>(cold.cpu(10))));
    const Ran ran = run(router, m, 10, 100, QueryKind::kMotion);
    EXPECT_LT(ran.on_device, 15) << is_cpu_cold;
    EXPECT_LT(ran.took, 1.3 * ran.best);
  }
}

TEST(Router, FollowsAMachineThatChanges) {
  Router router(4);
  run(router, machine(400, 30'000, 1), 10'000, 1'000);
  // Other load slows the device by a factor of a hundred.
  const Ran after = run(router, machine(400, 30'000, 1'000), 10'000, 1'000);
  EXPECT_LT(after.on_device, 100);
}

TEST(Router, FindsOutSoonThatTheOtherBackendHasRecovered) {
  Router router(4);
  const double cpu = 700;  // ns a pair; the device is first slower, since other load holds it up, then much faster
  run(router, machine(cpu, 8'000'000, 1), 10'000, 1'100);
  const Ran after = run(router, machine(cpu, 400'000, 1), 10'000, 300);
  EXPECT_GT(after.on_device, 100);
}

TEST(Router, DistinguishesKindsByTheirOptions) {
  QueryView q;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kDense);
  q.max_distance = 1;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kNear);
  q.signed_distance = true;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kDepth);
  q.reduce = Reduce::kMin;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kTable);
  q.reduce = Reduce::kNearest;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kTable);
  q.reduce = Reduce::kWithin;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kWithin);
  q.configuration_count = 4;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kConfigurations);
  q.reduce = Reduce::kAny;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kDecision);
  q.max_evaluations = 1;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kMotion);
  q.reduce = Reduce::kMin;
  EXPECT_EQ(cuda::kind_of(q), QueryKind::kLeastMotion);
}

class RoutedEngine : public testing::Test {
 protected:
  static engine::Scene scene(int bodies) {
    engine::Scene s;
    Random random(7);
    for (int i = 0; i < bodies; ++i) s.add_sphere("s" + std::to_string(i), 0.3, {.pose = random.pose(3)});
    return s;
  }
  static engine::Engine::Options options() {
    engine::Engine::Options o;
    o.threads = 2;
    return o;
  }

  Fault fault_;
  cuda::FakeDevice fake_device_{{true, "a stand-in", ""}, [this](const engine::Scene&, int, std::uint64_t) {
                                  fault_.call("opening");
                                  return std::make_shared<IdleDevice>(fault_);
                                }};
};

TEST_F(RoutedEngine, AnswersTheSameOnEachBackend) {
  const engine::Engine engine(scene(60), options()), cpu(scene(60), {"cpu", 2});
  EXPECT_EQ(engine.backend(), "auto");
  const std::vector<BodyPair> all = engine.pairs({});
  for (const std::size_t count : {std::size_t{1}, all.size()})
    for (int i = 0; i < 20; ++i) {
      QueryView q;
      q.fields = kAllFields;
      q.all_pairs = false;
      q.pairs = std::span(all).first(count);
      const Answer a = evaluate(engine, q);
      expect_same(a, evaluate(cpu, q), std::to_string(count) + " pairs");
      if (count == 1 && i == 0) {
        EXPECT_EQ(a.info.backend, "cpu") << "a device takes longer than one pair, as a first guess";
      }
    }
  EXPECT_EQ(counter(engine, "route.dense.to_cpu") + counter(engine, "route.dense.to_cuda"), 40u);
  EXPECT_GT(counter(engine, "route.dense.to_cuda"), 0u);
  EXPECT_EQ(counter(engine, "route.within.to_cpu") + counter(engine, "route.within.to_cuda"), 0u);
}

TEST_F(RoutedEngine, GoesOnWithTheCpuWhereTheDeviceFails) {
  fault_ = {3};
  const engine::Engine engine(scene(60), options()), cpu(scene(60), {"cpu", 2});
  EXPECT_EQ(engine.backend(), "auto");
  Answer a;
  for (int i = 0; i < 20; ++i) {
    a = evaluate(engine, {});
    expect_same(a, evaluate(cpu, {}), "after a fault");
  }
  EXPECT_GE(fault_.calls, 3) << "the device was asked";
  EXPECT_EQ(a.info.backend, "cpu");
  EXPECT_EQ(engine.backend(), "cpu");
}

}  // namespace
}  // namespace clearance::test
