// A real device that is lost during a query. In a program of its own, since the device stays unusable afterwards.
#include "tests/engine/cuda/same_answer.h"
#include "tests/gpu/break_device.h"

namespace clearance::test {
namespace {

TEST(CudaLoss, LeavesTheQueryAndAllThatFollowToTheCpu) {
  SKIP_WITHOUT_DEVICE();
  const auto scene = [] {
    engine::Scene s;
    Random random(3);
    for (int i = 0; i < 900; ++i) s.add_uv_sphere("s" + std::to_string(i), 0.5, 5, {.pose = random.pose(12)});
    return s;
  };
  const engine::Engine device(scene(), {"cuda"}), cpu(scene(), {.backend = "cpu", .covers = engine::Covers::kOff});
  engine::Engine::Options strict{"cuda"};
  strict.device_fallback = false;
  const engine::Engine rejecting(scene(), strict);
  const Answer expected = evaluate(cpu, {}), room = evaluate(device, {});
  expect_same(room, expected, "while all is well");
  Job job = device.start({}, room.view), doomed = rejecting.start({}, room.view);
  ASSERT_FALSE(job.advance(std::chrono::nanoseconds(1))) << "a chunk came, and there are more";
  break_device();
  EXPECT_THROW(doomed.advance(), engine::QueryError);
  while (!job.advance()) {
  }
  EXPECT_EQ(job.info().backend, "cpu");
  Answer rest;
  rest.size = expected.size;
  rest.view = room.view;
  rest.info = job.info();
  expect_same(rest, expected, "begun on the device");
  EXPECT_FALSE(device.device_error().empty());
  EXPECT_EQ(counter(device, "cuda.usable"), 0u);
  QueryView q;
  q.reduce = Reduce::kNearest;
  expect_same(evaluate(device, q), evaluate(cpu, q), "afterwards", true);
  EXPECT_THROW(evaluate(rejecting, {}), engine::QueryError);
  EXPECT_THROW(engine::Engine(scene(), strict), std::runtime_error);
  EXPECT_EQ(engine::Engine(scene(), {"cuda"}).backend(), "cpu");
}

}  // namespace
}  // namespace clearance::test
