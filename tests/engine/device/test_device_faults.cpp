// Consequences of device faults at any point: correct answers from the CPU, or a clear error. A fake device leaves all
// rows to the CPU, so no GPU is needed.
#include "tests/engine/cuda/same_answer.h"
#include "tests/engine/device/fake_device.h"

namespace clearance::test {
namespace {

using cuda::DeviceError;

class DeviceFaults : public testing::Test {
 protected:
  Fault fault_;
  cuda::FakeDevice fake_device_{{true, "a stand-in", ""},
                                [this](const engine::Scene&, int, std::uint64_t memory_limit) {
                                  fault_.call("opening");
                                  if (memory_limit < 1000)
                                    throw DeviceError(DeviceError::kNoMemory, "1000 bytes would be needed");
                                  return std::make_shared<IdleDevice>(fault_);
                                }};

  static engine::Engine::Options options(bool fallback = true) {
    engine::Engine::Options o;
    o.backend = "cuda";
    o.threads = 2;
    o.device_fallback = fallback;
    return o;
  }
};

constexpr std::uint32_t kSeveralChunks = 900;  // several chunks
DeviceTestQuery query_about(Reduce reduce) {
  return DeviceTestQuery(kSeveralChunks, reduce);
}
// A whole table at the current poses.
DeviceTestQuery query_of_table(Reduce reduce) {
  DeviceTestQuery device_query(0, reduce);
  device_query.q.configurations = {};
  device_query.q.bodies = {};
  device_query.q.max_distance = 0.5;
  return device_query;
}
engine::Scene scene() {
  return spheres(80);
}

TEST_F(DeviceFaults, OfNoneTheDeviceAnswers) {
  const engine::Engine device(scene(), options()), cpu(scene(), {"cpu", 2});
  const DeviceTestQuery dense = query_about(Reduce::kNone);
  const Answer a = evaluate(device, dense.q);
  expect_same(a, evaluate(cpu, dense.q), "all rows left to the CPU");
  EXPECT_EQ(a.info.backend, "cuda");
  EXPECT_EQ(device.backend(), "cuda");
  EXPECT_GT(fault_.calls, 8) << "several chunks";
}

TEST_F(DeviceFaults, AnywhereInAQueryLeaveItToTheCpu) {
  const engine::Engine cpu(scene(), {"cpu", 2});
  const DeviceTestQuery device_query = query_about(Reduce::kNone);
  const Answer expected = evaluate(cpu, device_query.q);
  bool failed = true;
  int tried = 0;
  for (int at = 0; failed; ++at, ++tried) {
    fault_ = {at};
    const engine::Engine device(scene(), options());
    const Answer a = evaluate(device, device_query.q, std::chrono::nanoseconds(1));
    failed = fault_.calls > at;  // else there is no such call
    expect_same(a, expected, "fault at call " + std::to_string(at));
    EXPECT_EQ(a.info.backend, failed ? "cpu" : "cuda");
    if (!failed) break;
    EXPECT_EQ(device.backend(), "cpu");
    EXPECT_NE(device.device_error().find("a planted fault while "), std::string::npos) << device.device_error();
    EXPECT_EQ(counter(device, "cuda.usable"), 0u);
    // A lost device is not used again.
    const int calls = fault_.calls;
    expect_same(evaluate(device, device_query.q), expected, "the next query");
    EXPECT_EQ(fault_.calls, calls);
  }
  EXPECT_GT(tried, 8);
}

TEST_F(DeviceFaults, AnywhereInAReductionLeaveItToTheCpu) {
  const engine::Engine cpu(scene(), {"cpu", 2});
  const DeviceTestQuery queries[] = {query_about(Reduce::kNearest), query_about(Reduce::kMin),
                                     query_about(Reduce::kWithin), query_of_table(Reduce::kWithin)};
  for (const DeviceTestQuery& device_query : queries) {
    const Answer expected = evaluate(cpu, device_query.q);
    int at = 0;
    for (bool failed = true; failed; ++at) {
      fault_ = {at};
      const engine::Engine device(scene(), options());
      const Answer a = evaluate(device, device_query.q);
      failed = fault_.calls > at;
      expect_same(a, expected, "fault at call " + std::to_string(at), true);
      EXPECT_EQ(a.info.backend, "cpu");
    }
    EXPECT_GT(at, 3);
  }
}

TEST_F(DeviceFaults, AreRejectionsWhereTheCpuMayNotTakeOver) {
  const DeviceTestQuery device_query = query_about(Reduce::kNone);
  int rejected = 0;
  for (int at = 0;; ++at) {
    fault_ = {at};
    try {
      const engine::Engine device(scene(), options(false));
      try {
        evaluate(device, device_query.q);
        break;  // no such call
      } catch (const engine::QueryError& e) {
        EXPECT_EQ(e.code, QueryErrorCode::kNotSupported);
        EXPECT_NE(std::string(e.what()).find("a planted fault while "), std::string::npos) << e.what();
        ++rejected;
      }
      EXPECT_THROW(evaluate(device, device_query.q), engine::QueryError) << "the device is lost";
    } catch (const DeviceError& e) {
      EXPECT_EQ(at, 0) << "where it is opened: " << e.what();
    }
  }
  EXPECT_GT(rejected, 8);
}

TEST_F(DeviceFaults, MotionsOfBodiesThatGrowAreTheCpusOrRejectedByName) {
  DeviceTestQuery motions(4);
  const std::vector<double> growths(8, 0.1);
  motions.q.growths = growths;
  motions.q.max_evaluations = 16;
  motions.q.reduce = Reduce::kMin;
  motions.q.fields = kDefaultFields;
  const std::string of_bodies = "motions of bodies by their poses", of_curves = "more than two control_points";
  for (const std::string& reason : {of_bodies, of_curves}) {
    if (reason == of_curves) {
      motions.q.control_points = 4;
      for (std::size_t i = 0; i < motions.poses.size(); ++i) {
        motions.poses[i].qw = 1;
        motions.poses[i].qx = motions.poses[i].qy = motions.poses[i].qz = 0;
      }
    }
    const engine::Engine device(scene(), options()), alone(scene(), options(false)), cpu(scene(), {"cpu", 2});
    const int calls = fault_.calls;
    const Answer a = evaluate(device, motions.q), expected = evaluate(cpu, motions.q);
    expect_same(a, expected, reason);
    EXPECT_EQ(a.info.backend, "cpu");
    EXPECT_LT(expected.view.upper[0], 1e3);
    try {
      evaluate(alone, motions.q);
      ADD_FAILURE() << "answered: " << reason;
    } catch (const engine::QueryError& e) {
      EXPECT_EQ(e.code, QueryErrorCode::kNotSupported);
      EXPECT_EQ(std::string(e.what()), reason + ": backend cuda does not answer it, and the CPU may not");
    }
    EXPECT_EQ(fault_.calls, calls) << "no work on the device";
  }
}

TEST_F(DeviceFaults, OfMemoryConcernOneQuery) {
  const engine::Engine cpu(scene(), {"cpu", 2});
  const DeviceTestQuery device_query = query_about(Reduce::kNone);
  const Answer expected = evaluate(cpu, device_query.q);
  fault_ = {5, DeviceError::kNoMemory};
  const engine::Engine device(scene(), options());
  expect_memory_for_the_second(device, device_query, expected);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 1u);
  EXPECT_EQ(counter(device, "cuda.usable"), 1u);
}

TEST_F(DeviceFaults, SceneThatDoesNotFitGoesToTheCpuOrIsRejected) {
  engine::Engine::Options small = options();
  small.device_memory = 999;
  const engine::Engine device(scene(), small), cpu(scene(), {"cpu", 2});
  EXPECT_EQ(device.backend(), "cpu");
  EXPECT_EQ(device.device_error(), "1000 bytes would be needed");
  expect_same(evaluate(device, {}), evaluate(cpu, {}), "on the CPU");
  small.device_fallback = false;
  EXPECT_THROW(engine::Engine(scene(), small), DeviceError);
}

}  // namespace
}  // namespace clearance::test
