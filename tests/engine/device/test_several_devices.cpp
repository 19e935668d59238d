// Several devices used as one: chunks in turn, and failures of single devices. Fake devices leave all rows to the CPU
// and need no GPU; a machine with several GPUs must give the CPU's bits.
#include <array>

#include "tests/engine/cuda/same_answer.h"
#include "tests/engine/device/fake_device.h"

namespace clearance::test {
namespace {

using cuda::DeviceError;

constexpr std::uint32_t kFourChunks = 1300;  // of 157 pairs: four chunks

class SeveralDevices : public testing::Test {
 protected:
  std::array<Fault, 3> faults_;
  cuda::FakeDevice fake_device_{{true, "a stand-in", "", 3}, [this](const engine::Scene&, int number, std::uint64_t) {
                                  Fault& fault = faults_[static_cast<std::size_t>(number)];
                                  fault.call("opening");
                                  return std::make_shared<IdleDevice>(fault);
                                }};

  static engine::Engine::Options options(std::vector<int> devices, bool fallback = true) {
    engine::Engine::Options o;
    o.backend = "cuda";
    o.threads = 2;
    o.device_fallback = fallback;
    o.devices = std::move(devices);
    return o;
  }
};

TEST_F(SeveralDevices, ShareAQueryOutAndAnswerAsOne) {
  const engine::Engine cpu(spheres(80), {"cpu", 2}), device(spheres(80), options({2, 0}));
  DeviceTestQuery device_query(30'000);  // more chunks than two devices have in flight
  device_query.q.fields = kDefaultFields;
  const Answer expected = evaluate(cpu, device_query.q);
  int most = 0;
  for (Fault& fault : faults_) fault.launches = 0;
  const Answer a = evaluate(device, device_query.q);
  EXPECT_EQ(a.info.backend, "cuda");
  expect_same(a, expected, "on two devices");
  for (const Fault& fault : {faults_[0], faults_[2]}) {
    EXPECT_NEAR(fault.launches, 5, 1) << "shared out evenly";
    most = std::max(most, fault.launches);
    EXPECT_EQ(fault.bodies, faults_[0].bodies);
  }
  EXPECT_GT(most, cuda::kChunksUnderWay) << "slots are used again";
  EXPECT_NE(faults_[0].bodies[9 * 80], 0) << "a body's place";
  EXPECT_EQ(counter(device, "cuda.queries"), 1u);
  EXPECT_EQ(counter(device, "cuda.2.usable"), 1u);
}

TEST_F(SeveralDevices, TakeTurnsWithSmallQueries) {
  const engine::Engine cpu(spheres(20), {"cpu", 2}), device(spheres(20), options({0, 1, 2}));
  for (Fault& fault : faults_) fault.launches = 0;
  for (int i = 0; i < 6; ++i) expect_same(evaluate(device, {}), evaluate(cpu, {}), "one chunk");
  for (const Fault& fault : faults_) EXPECT_EQ(fault.launches, 2);
}

TEST_F(SeveralDevices, ThatAreLostLeaveTheirShareToTheOthers) {
  const engine::Engine cpu(spheres(80), {"cpu", 2});
  for (const Reduce reduce : {Reduce::kNone, Reduce::kMin}) {
    const DeviceTestQuery device_query(kFourChunks, reduce);
    const Answer expected = evaluate(cpu, device_query.q);
    int at = 1;  // call 0 opens it
    for (bool failed = true; failed; ++at) {
      faults_ = {};
      faults_[1].at = at;
      const engine::Engine device(spheres(80), options({0, 1}, reduce != Reduce::kNone));
      const Answer a = evaluate(device, device_query.q, std::chrono::nanoseconds(1));
      failed = faults_[1].calls > at;
      expect_same(a, expected, "fault at call " + std::to_string(at), reduce != Reduce::kNone);
      EXPECT_EQ(a.info.backend, reduce == Reduce::kNone ? "cuda" : "cpu") << "the stand-in cannot reduce";
      if (!failed) break;
      if (reduce == Reduce::kNone) {
        EXPECT_EQ(device.device_error().find("device 1: a planted fault while "), 0u) << device.device_error();
      }
      EXPECT_EQ(counter(device, "cuda.usable"), 1u);
      EXPECT_EQ(counter(device, "cuda.0.usable"), 1u);
      EXPECT_EQ(counter(device, "cuda.1.usable"), 0u);
      const int calls = faults_[1].calls;
      expect_same(evaluate(device, device_query.q), expected, "the next query", reduce != Reduce::kNone);
      EXPECT_EQ(faults_[1].calls, calls) << "a lost device is not asked again";
    }
    EXPECT_GE(at, reduce == Reduce::kNone ? 8 : 5);
  }
}

TEST_F(SeveralDevices, AllLostLeaveItToTheCpu) {
  const engine::Engine cpu(spheres(80), {"cpu", 2}), device(spheres(80), options({0, 1, 2})),
      strict(spheres(80), options({0, 1, 2}, false));
  const DeviceTestQuery device_query(kFourChunks);
  const Answer expected = evaluate(cpu, device_query.q);
  evaluate(device, device_query.q);
  for (Fault& fault : faults_) fault.at = fault.calls + 5;
  const Answer a = evaluate(device, device_query.q);
  expect_same(a, expected, "none is left");
  EXPECT_EQ(a.info.backend, "cpu");
  EXPECT_EQ(counter(device, "cuda.usable"), 0u);
  EXPECT_EQ(device.backend(), "cpu");
  EXPECT_THROW(evaluate(strict, device_query.q), engine::QueryError);
  EXPECT_THROW(evaluate(strict, device_query.q), engine::QueryError) << "again";
}

TEST_F(SeveralDevices, WithoutMemoryLeaveOneQueryToTheCpu) {
  const engine::Engine cpu(spheres(80), {"cpu", 2}), device(spheres(80), options({0, 1}));
  const DeviceTestQuery device_query(kFourChunks);
  const Answer expected = evaluate(cpu, device_query.q);
  faults_[1] = {6, DeviceError::kNoMemory, faults_[1].calls};
  expect_memory_for_the_second(device, device_query, expected);
  EXPECT_EQ(counter(device, "cuda.1.usable"), 1u);
}

TEST_F(SeveralDevices, OneThatCannotBeOpenedIsLeftOutOrRejected) {
  faults_[1].at = 0;
  const engine::Engine cpu(spheres(20), {"cpu", 2}), device(spheres(20), options({0, 1}));
  expect_same(evaluate(device, {}), evaluate(cpu, {}), "with the one that is left");
  EXPECT_EQ(device.backend(), "cuda");
  EXPECT_EQ(device.device_error(), "device 1: a planted fault while opening");
  EXPECT_EQ(counter(device, "cuda.1.usable"), 0u);
  EXPECT_THROW(engine::Engine(spheres(20), options({0, 1}, false)), DeviceError);
}

TEST_F(SeveralDevices, AreNamedOnceAndAreThere) {
  const auto rejection = [](const engine::Engine::Options& o) -> std::string {
    try {
      engine::Engine engine(spheres(2), o);
    } catch (const std::exception& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_EQ(rejection(options({0, 3})), "devices: 3 is not there; there are 3, 0 to 2");
  EXPECT_EQ(rejection(options({-1})), "devices: -1 is not there; there are 3, 0 to 2");
  EXPECT_EQ(rejection(options({2, 1, 2})), "devices: 2 is named twice");
  engine::Engine::Options on_cpu = options({0});
  on_cpu.backend = "cpu";
  EXPECT_EQ(rejection(on_cpu), "devices: backend 'cpu' uses none");
  for (const Fault& fault : faults_) EXPECT_EQ(fault.calls, 0);
  EXPECT_EQ(rejection(options({1})), "");
  EXPECT_EQ(faults_[1].calls, 1) << "that one was opened";
}

TEST(RealDevices, AnswerWithTheBitsOfTheCpuHoweverManyThereAre) {
  SKIP_WITHOUT_DEVICE();
  const int count = cuda::device_info().count;
  if (count < 2) GTEST_SKIP() << "there is one CUDA device alone";
  engine::Engine::Options all{"cuda"}, last{"cuda"};
  for (int i = 0; i < count; ++i) all.devices.push_back(i);
  last.devices = {count - 1};
  const auto scene = [] {
    engine::Scene s;
    Random random(3);
    for (int i = 0; i < 900; ++i) s.add_uv_sphere("s" + std::to_string(i), 0.5, 5, {.pose = random.pose(12)});
    return s;
  };
  const engine::Engine cpu(scene(), {"cpu"}), several(scene(), all), other(scene(), last);
  DeviceTestQuery with_poses(kFourChunks);
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest, Reduce::kMin, Reduce::kWithin}) {
    QueryView q, posed = with_poses.q;
    q.reduce = posed.reduce = reduce;
    if (reduce == Reduce::kWithin) q.max_distance = posed.max_distance = 0.5;
    if (reduce == Reduce::kNearest)
      posed.configuration_count = 200, posed.configurations = posed.configurations.first(400);
    posed.fields = kDefaultFields | kFieldFlags;
    for (const QueryView& query : {q, posed}) {
      const Answer expected = evaluate(cpu, query), a = evaluate(several, query), b = evaluate(other, query);
      expect_same(a, expected, "all devices", reduce != Reduce::kNone);
      expect_same(b, expected, "the last device", reduce != Reduce::kNone);
      EXPECT_EQ(a.info.backend, "cuda");
    }
  }
  for (int i = 0; i < count; ++i) EXPECT_GT(counter(several, "cuda." + std::to_string(i) + ".chunks"), 5u) << i;
  EXPECT_EQ(counter(several, "cuda.queries_on_cpu"), 0u);
}

}  // namespace
}  // namespace clearance::test
