// Device queries of the installed C++ engine, with a fake device in host memory.
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "engine/api/engine.h"
#include "tests/server/tasks/plan_device.h"

namespace clearance {
namespace {

constexpr std::uint64_t kPairs = 21;  // of two moved bodies among twelve
const std::vector<std::uint32_t> kMoved{3, 7};

Scene twelve_spheres() {
  Scene scene;
  for (int i = 0; i < 12; ++i)
    scene.add_sphere("s" + std::to_string(i), 0.3, {.X_parent_body = Pose7{1.0 * i, 0, 0, 1, 0, 0, 0}});
  return scene;
}

class EngineDeviceQueries : public testing::Test {
 protected:
  static Query query() { return {.bodies = kMoved, .fields = kFieldLower | kFieldStatus}; }
  static std::uint16_t code_of(const std::function<void()>& call) {
    try {
      call();
    } catch (const QueryError& error) {
      return error.code;
    }
    ADD_FAILURE() << "not rejected";
    return 0;
  }
  void place(const DeviceQueryInfo& info, double x) const {
    auto* const poses = reinterpret_cast<Pose7*>(info.memory + info.poses_offset);
    for (std::uint64_t k = 0; k < info.configurations; ++k)
      poses[k * kMoved.size()] = {x + 0.5 * static_cast<double>(k), 0, 0, 1, 0, 0, 0};
  }
  void expect_rows(const DeviceQueryInfo& info, double x) const {
    const auto* const lower = reinterpret_cast<const double*>(info.memory + info.column(kFieldLower).offset);
    for (std::uint64_t k = 0; k < info.configurations; ++k)
      for (std::uint64_t p = 0; p < kPairs; ++p)
        ASSERT_EQ(lower[k * kPairs + p], test::planned(x + 0.5 * static_cast<double>(k), 0, p));
  }

  test::FakePlanDevice fake_;
  Engine engine_{twelve_spheres(), {.backend = "cuda", .threads = 1}};
};

TEST_F(EngineDeviceQueries, ReadAndWriteTheirMemory) {
  Prepared prepared = engine_.prepare(query());
  DeviceQuery on_device = prepared.on_device(4);
  const DeviceQueryInfo& info = on_device.info();
  EXPECT_EQ(info.configurations, 4u);
  EXPECT_EQ(info.bodies, 2u);
  EXPECT_EQ(info.joints, 0u);
  EXPECT_EQ(info.pairs, kPairs);
  EXPECT_EQ(info.rows, 4 * kPairs);
  EXPECT_EQ(info.columns.size(), 2u);
  EXPECT_EQ(info.column(kFieldStatus).row_bytes, 1u);
  EXPECT_THROW(info.column(kFieldUpper), std::invalid_argument);
  EXPECT_EQ(info.scene_revision, engine_.scene().revision);
  for (const double x : {1.0, 7.0}) {
    place(info, x);
    EXPECT_GE(on_device.run().took.count(), 0);
    expect_rows(info, x);
  }
  place(info, 3);
  on_device.enqueue(info.stream);
  expect_rows(info, 3);
  DeviceQuery other = prepared.on_device(2);
  EXPECT_NE(other.info().memory, info.memory);
  EXPECT_EQ(other.info().rows, 2 * kPairs);
}

TEST_F(EngineDeviceQueries, EndByCloseAndByTheirDestructor) {
  Prepared prepared = engine_.prepare(query());
  {
    DeviceQuery first = prepared.on_device(4);
    const DeviceQuery second = prepared.on_device(5);
    EXPECT_EQ(fake_.device.shared, 2);
    first.close();
    EXPECT_EQ(fake_.device.shared, 1);
    EXPECT_THROW(first.run(), std::logic_error);
    EXPECT_THROW(first.enqueue(nullptr), std::logic_error);
    EXPECT_THROW(first.close(), std::logic_error);
  }
  EXPECT_EQ(fake_.device.shared, 0);
}

TEST_F(EngineDeviceQueries, KeepTheirScene) {
  Prepared prepared = engine_.prepare(query());
  DeviceQuery on_device = prepared.on_device(1);
  engine_.attach(4, 5);
  EXPECT_EQ(code_of([&] { on_device.run(); }), static_cast<std::uint16_t>(QueryErrorCode::kWrongScene));
  place(on_device.info(), 2);
  on_device.run({}, false);
  expect_rows(on_device.info(), 2);
  DeviceQuery now = prepared.on_device(1);
  place(now.info(), 5);
  now.run();
  expect_rows(now.info(), 5);
}

TEST_F(EngineDeviceQueries, AreRejectedWithTheReason) {
  const auto not_supported = static_cast<std::uint16_t>(QueryErrorCode::kNotSupported),
             too_large = static_cast<std::uint16_t>(QueryErrorCode::kTooLarge);
  Query within = query();
  within.reduce = Reduce::kWithin;
  EXPECT_EQ(code_of([&] { engine_.prepare(within).on_device(4); }), not_supported);
  EXPECT_EQ(code_of([&] { engine_.prepare(query()).on_device(4'000'000'000); }), too_large);
  fake_.device.has_room = false;
  EXPECT_EQ(code_of([&] { engine_.prepare(query()).on_device(4); }), too_large);
  fake_.device.has_room = true;
  const Engine on_cpu(twelve_spheres(), {.backend = "cpu"});
  EXPECT_EQ(code_of([&] { on_cpu.prepare(query()).on_device(4); }), not_supported);
}

}  // namespace
}  // namespace clearance
