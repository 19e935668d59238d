// Backend auto: who answers, why, and what is kept of it. Needs no GPU: a stand-in for the device leaves all rows to
// the CPU.
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <limits>
#include <optional>

#include "engine/cache/cache.h"
#include "engine/calibrate.h"
#include "same_answer.h"
#include "stand_in_device.h"

namespace clearance::test {
namespace {

using cuda::Calibration;
using cuda::CostSample;
using cuda::QueryKind;

constexpr std::uint64_t kNever = ~std::uint64_t{0};

// What takes so long at 10, 100, 1000, 10,000 and 100,000 pairs.
using Costs = std::array<double, cuda::kCostSamples>;
Calibration same_for_all(const Costs& cpu_ns, const Costs& device_ns) {
  Calibration c;
  for (auto& kind : c.samples)
    for (auto& hulls : kind) {
      double pairs = 1;
      for (std::size_t i = 0; i < hulls.size(); ++i) hulls[i] = {pairs *= 10, cpu_ns[i], device_ns[i]};
    }
  return c;
}

TEST(Calibration, SaysFromHowManyPairsOnTheDeviceIsFaster) {
  const auto from = [](const Costs& cpu, const Costs& device, double open_share = 0) {
    return same_for_all(cpu, device).device_from(QueryKind::kDense, 1, open_share);
  };
  EXPECT_EQ(from({1, 10, 100, 1000, 10000}, {55, 55, 55, 55, 55}), 550);
  EXPECT_EQ(from({1, 10, 100, 1000, 10000}, {55, 55, 55, 55, 55}, 0.5), 1100);
  EXPECT_EQ(from({1, 10, 100, 1000, 10000}, {55, 55, 55, 55, 55}, 1), std::nullopt);
  EXPECT_EQ(from({1, 10, 100, 1000, 10000}, {1, 55, 55, 55, 10001}), std::nullopt) << "the largest counts";
  EXPECT_EQ(from({10, 60, 100, 70, 10000}, {55, 55, 55, 130, 130}), 10544) << "not where it lost again";
  EXPECT_EQ(from({2, 2, 2, 2, 2}, {1, 1, 1, 1, 1}), 0);
  EXPECT_EQ(from({1, 1, 1, 1, 3}, {2, 2, 2, 2, 2}), 55000);
  Calibration c = same_for_all({1, 1, 1, 1, 1}, {2, 2, 2, 2, 2});
  for (auto& s : c.samples[std::size_t(QueryKind::kConfigurations)][0]) s.device_ns = 0.5;
  EXPECT_EQ(c.device_from(QueryKind::kConfigurations, 0, 0), 0);
  EXPECT_EQ(c.device_from(QueryKind::kConfigurations, 1, 0), std::nullopt);
}

class RouterTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = testing::TempDir() + "clearance-router-XXXXXX";
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    setenv("CLEARANCE_CACHE", folder_.c_str(), 1);
    cache_.emplace(folder_.string());
    ASSERT_TRUE(cache_->is_on()) << cache_->why_off();
  }
  void TearDown() override {
    unsetenv("CLEARANCE_CACHE");
    std::filesystem::remove_all(folder_);
  }

  static Scene scene(int bodies) {
    Scene s;
    Random random(7);
    for (int i = 0; i < bodies; ++i) s.add_sphere("s" + std::to_string(i), 0.3, {.pose = random.pose(3)});
    return s;
  }
  // Of bodies of two spheres each.
  static Scene scene_of_several(int bodies) {
    Scene s, one = scene(2);
    for (int i = 0; i < bodies; ++i) {
      Body body = one.bodies()[0];
      body.name = "s" + std::to_string(i);
      body.pieces.push_back(one.bodies()[1].pieces[0]);
      s.add_body(std::move(body));
    }
    return s;
  }
  static std::string key(cuda::Bodies bodies = cuda::Bodies::kOfOnePiece) {
    return cuda::calibration_key("a stand-in", 2, Engine(Scene{}).instruction_set(), bodies);
  }
  static Engine::Options options(const std::string& calibration = "auto") {
    Engine::Options o;
    o.threads = 2;
    o.calibration = calibration;
    return o;
  }

  std::filesystem::path folder_;
  std::optional<Cache> cache_;
  Fault fault_;
  cuda::DeviceStandIn stand_in_{{true, "a stand-in", ""}, [this](const Scene&, int, std::uint64_t) {
                                  fault_.call("opening");
                                  return std::make_shared<IdleDevice>(fault_);
                                }};
};

TEST_F(RouterTest, GivesLargeQueriesToTheDeviceAndSmallOnesToTheCpu) {
  save_calibration(*cache_, key(), same_for_all({1, 10, 100, 1000, 10000}, {100, 100, 100, 100, 100}));
  const Engine engine(scene(60), options()), cpu(scene(60), {"cpu", 2});
  EXPECT_EQ(engine.backend(), "auto");
  EXPECT_EQ(counter(engine, "route.dense.cuda_from_pairs"), 1000u);
  const std::vector<BodyPair> all = engine.pairs({});
  for (const std::size_t count : {1u, 999u, 1000u, 1770u}) {
    QueryView q;
    q.fields = kAllFields;
    q.all_pairs = false;
    q.pairs = std::span(all).first(count);
    const Answer a = ask(engine, q);
    expect_same(a, ask(cpu, q), std::to_string(count) + " pairs");
    EXPECT_EQ(a.info.backend, count < 1000 ? "cpu" : "cuda") << count;
  }
  EXPECT_EQ(counter(engine, "route.dense.to_cpu"), 2u);
  EXPECT_EQ(counter(engine, "route.dense.to_cuda"), 2u);
}

TEST_F(RouterTest, KnowsKindsOfQueries) {
  Calibration c = same_for_all({1, 1, 1, 1, 1}, {2, 2, 2, 2, 2});
  for (auto& hulls : c.samples[std::size_t(QueryKind::kConfigurations)])
    for (CostSample& sample : hulls) sample.device_ns = 0.5;
  save_calibration(*cache_, key(), c);
  const Engine engine(scene(20), options());
  const std::vector<std::uint32_t> bodies{3};
  const std::vector<Pose> poses(4);
  QueryView q;
  q.reduce = Reduce::kMin;
  ask(engine, q);
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = 4;
  ask(engine, q);
  EXPECT_EQ(counter(engine, "route.table.to_cpu"), 1u);
  EXPECT_EQ(counter(engine, "route.table.cuda_from_pairs"), kNever);
  EXPECT_EQ(counter(engine, "route.configurations.to_cuda"), 1u);
  EXPECT_EQ(counter(engine, "route.configurations.cuda_from_pairs"), 0u);
}

TEST_F(RouterTest, TellsKindsApartByWhatIsAsked) {
  Calibration c = same_for_all({1, 1, 1, 1, 1}, {2, 2, 2, 2, 2});
  const auto wins = [&](QueryKind kind) {
    for (auto& hulls : c.samples[std::size_t(kind)])
      for (CostSample& sample : hulls) sample.device_ns = 0.5;
  };
  for (const QueryKind kind : {QueryKind::kWarm, QueryKind::kDepth, QueryKind::kWithin}) wins(kind);
  save_calibration(*cache_, key(), c);
  const Engine engine(scene(20), options());
  struct Case {
    std::string name;
    bool to_device;
    QueryView q;
  };
  std::vector<Case> cases{{"dense", false, {}}, {"warm", true, {}},   {"near", false, {}},
                          {"depth", true, {}},  {"depth", true, {}},  {"near", false, {}},
                          {"table", false, {}}, {"table", false, {}}, {"within", true, {}}};
  cases[1].q.warm_slot = 1;
  cases[2].q.max_distance = 1;
  cases[3].q.signed_distance = true;
  cases[4].q.signed_distance = true, cases[4].q.max_distance = 1, cases[4].q.warm_slot = 1;
  cases[5].q.max_distance = 1, cases[5].q.warm_slot = 1;
  cases[6].q.reduce = Reduce::kMin;
  cases[7].q.reduce = Reduce::kNearest, cases[7].q.max_distance = 1;
  cases[8].q.reduce = Reduce::kWithin, cases[8].q.max_distance = 1;
  for (const auto& [name, to_device, q] : cases) {
    const std::string counted = "route." + name + (to_device ? ".to_cuda" : ".to_cpu");
    const std::uint64_t before = counter(engine, counted);
    const Answer a = ask(engine, q);
    EXPECT_EQ(counter(engine, counted), before + 1) << name;
    if (q.reduce == Reduce::kNone) {
      EXPECT_EQ(a.info.backend, to_device ? "cuda" : "cpu") << name;  // the stand-in cannot reduce
    }
  }
}

TEST_F(RouterTest, MeasuresOnceAndKeepsIt) {
  ASSERT_FALSE(cuda::load_calibration(*cache_, key()));
  {
    const Engine engine(scene(5), options());
  }
  const auto kept = cuda::load_calibration(*cache_, key());
  ASSERT_TRUE(kept);
  for (const auto& kind : kept->samples)
    for (const auto& hulls : kind) EXPECT_GT(hulls[4].pairs, 10 * hulls[0].pairs);
  const int opened = fault_.calls;
  {
    const Engine engine(scene(5), options());
  }
  EXPECT_EQ(fault_.calls, opened + 1) << "not measured again";
}

TEST_F(RouterTest, MeasuresBodiesOfSeveralPiecesForThemselves) {
  {
    const Engine engine(scene_of_several(5), options());
  }
  EXPECT_TRUE(cuda::load_calibration(*cache_, key(cuda::Bodies::kOfSeveral)));
  EXPECT_FALSE(cuda::load_calibration(*cache_, key()));
}

TEST_F(RouterTest, AsksWhatWasMeasuredWithBodiesLikeTheScenes) {
  save_calibration(*cache_, key(), same_for_all({1, 1, 1, 1, 1}, {2, 2, 2, 2, 2}));
  const std::string several = key(cuda::Bodies::kOfSeveral);
  save_calibration(*cache_, several, same_for_all({2, 2, 2, 2, 2}, {1, 1, 1, 1, 1}));
  EXPECT_EQ(counter(Engine(scene(4), options()), "route.dense.cuda_from_pairs"), kNever);
  EXPECT_EQ(counter(Engine(scene_of_several(4), options()), "route.dense.cuda_from_pairs"), 0u);
  Scene mixed = scene(3), pairs = scene_of_several(2);
  for (Body body : pairs.bodies()) {
    body.name += " of two";
    mixed.add_body(std::move(body));
  }
  EXPECT_EQ(cuda::bodies_of(mixed), cuda::Bodies::kOfOnePiece);
  Body third = pairs.bodies()[0];
  third.name = "one more of two";
  mixed.add_body(std::move(third));
  EXPECT_EQ(cuda::bodies_of(mixed), cuda::Bodies::kOfSeveral);
}

TEST_F(RouterTest, TakesNoEntryThatIsNotItsOwn) {
  const Calibration c = same_for_all({1, 2, 3, 4, 5.5}, {3, 3, 3, 3, 4e-3});
  save_calibration(*cache_, "key", c);
  const auto same = cuda::load_calibration(*cache_, "key");
  ASSERT_TRUE(same);
  EXPECT_EQ(same->samples[2][1][4].cpu_ns, 5.5);
  EXPECT_EQ(same->samples[0][0][4].device_ns, 4e-3);
  EXPECT_FALSE(cuda::load_calibration(*cache_, "another key"));
  for (const double spoilt : {-5.5, 0.0, std::numeric_limits<double>::quiet_NaN()}) {
    save_calibration(*cache_, "key", same_for_all({1, 2, 3, 4, spoilt}, {3, 3, 3, 3, 3}));
    EXPECT_FALSE(cuda::load_calibration(*cache_, "key")) << spoilt;
  }
  Calibration falling = c;
  falling.samples[1][0][2].pairs = 1;
  save_calibration(*cache_, "key", falling);
  EXPECT_FALSE(cuda::load_calibration(*cache_, "key"));
  ASSERT_EQ(cache_->list().size(), 1u);
  cache_->write(cache_->list()[0].name, std::vector<std::byte>(7));
  EXPECT_FALSE(cuda::load_calibration(*cache_, "key"));
}

TEST_F(RouterTest, OffMeansTheCpuAndOpensNoDevice) {
  const Engine engine(scene(5), options("off"));
  EXPECT_EQ(engine.backend(), "cpu");
  EXPECT_EQ(ask(engine, {}).info.backend, "cpu");
  EXPECT_EQ(fault_.calls, 0);
}

TEST_F(RouterTest, GoesOnWithTheCpuWhereTheDeviceFails) {
  save_calibration(*cache_, key(), same_for_all({2, 2, 2, 2, 2}, {1, 1, 1, 1, 1}));
  fault_ = {3};
  const Engine engine(scene(60), options()), cpu(scene(60), {"cpu", 2});
  EXPECT_EQ(engine.backend(), "auto");
  const Answer a = ask(engine, {});
  expect_same(a, ask(cpu, {}), "after a fault");
  EXPECT_EQ(a.info.backend, "cpu");
  EXPECT_EQ(engine.backend(), "cpu");
}

}  // namespace
}  // namespace clearance::test
