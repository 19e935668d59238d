// Device queries of the installed C++ engine, Prepared::on_device(), compared with the same prepared query on the CPU.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "engine/api/engine.h"
#include "tests/engine/engine_test_util.h"
#include "tests/gpu/device_memory.h"
#include "tests/gpu/skip_without_device.h"
#include "tests/source_file.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kFields = kFieldDistance | kFieldLower | kFieldUpper | kFieldStatus;

Pose7 pose_of(Random& random, double box) {
  const Pose pose = random.pose(box);
  return {pose.translation.x, pose.translation.y, pose.translation.z, pose.qw, pose.qx, pose.qy, pose.qz};
}

/// An arm on a table among bodies of several kinds.
Scene scene_of_an_arm() {
  Random random(5);
  Scene scene;
  scene.add_box("table", {1, 1, 0.1}, {.is_static = true, .X_parent_body = Pose7{0.5, 0, -0.1, 1, 0, 0, 0}});
  for (int i = 0; i < 12; ++i) {
    const std::string name = "b" + std::to_string(i);
    const BodyOptions options{.radius = i % 4 == 0 ? 0.01 : 0, .X_parent_body = pose_of(random, 1)};
    if (i % 3 == 0) scene.add_box(name, {0.1, 0.2, 0.05}, options);
    if (i % 3 == 1) scene.add_capsule(name, 0.05, 0.2, options);
    if (i % 3 == 2) scene.add_box(name, {0.15, 0.04, 0.2}, options);
  }
  std::vector<std::array<double, 3>> stone(400);
  for (auto& p : stone) p = {random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1)};
  scene.add_hull("stone", stone, {.X_parent_body = pose_of(random, 1)});
  scene.add_robot("arm", {.urdf = source_file("tests/engine/robot/arm.urdf"), .home = {{{"joint4", -1.5}}}});
  for (const BodyInfo& body : scene.bodies())  // a cylinder, which devices do not hold
    if (body.name != "arm/base") scene.ignore("arm/base", body.name);
  return scene;
}

/// Bodies, joints and K inputs of a query.
struct Inputs {
  std::vector<std::uint32_t> bodies, joints;
  std::vector<Pose7> poses;
  std::vector<double> positions;

  Inputs(const Engine& engine, bool by_joints, std::uint32_t configurations, std::uint64_t seed) {
    for (const char* name : {"b0", "b1", "b2", "b4"}) bodies.push_back(engine.body(name));
    Joints arm;
    if (by_joints) arm = engine.joints("arm");
    joints = arm.ids;
    Random random(seed);
    for (std::size_t i = 0; i < configurations * bodies.size(); ++i) poses.push_back(pose_of(random, 0.5));
    for (std::uint32_t k = 0; k < configurations; ++k)
      for (const JointLimits& limits : arm.limits)
        positions.push_back(random.uniform(std::max(limits.lower, -1.5), std::min(limits.upper, 1.5)));
  }
  Prepared::Inputs spans() const { return {positions, poses}; }
};

/// The columns of the last run.
struct Rows {
  std::vector<double> lower, upper;
  std::vector<Status> status;

  explicit Rows(const DeviceQueryInfo& info) : lower(info.rows), upper(info.rows), status(info.rows) {
    const auto copy = [&](Field field, auto& column) {
      ASSERT_EQ(info.column(field).row_bytes, sizeof column[0]);
      copy_from_device(column.data(), info.memory + info.column(field).offset, column.size() * sizeof column[0]);
    };
    copy(kFieldLower, lower);
    copy(kFieldUpper, upper);
    copy(kFieldStatus, status);
  }
  explicit Rows(const Result& result)
      : lower(result.lower().begin(), result.lower().end()),
        upper(result.upper().begin(), result.upper().end()),
        status(result.status().begin(), result.status().end()) {}
  bool operator==(const Rows&) const = default;
};

void put(const DeviceQueryInfo& info, const Inputs& inputs) {
  copy_to_device(info.memory + info.poses_offset, inputs.poses.data(), inputs.poses.size() * sizeof(Pose7));
  if (info.joints > 0)
    copy_to_device(info.memory + info.positions_offset, inputs.positions.data(),
                   inputs.positions.size() * sizeof(double));
}

/// Expects the CPU's bounds and statuses, except for a few rows that a device leaves open, whose intervals intersect
/// the CPU's and whose verdicts do not contradict it.
void expect_the_cpus(const Rows& got, const Rows& cpu, Reduce reduce = Reduce::kNone) {
  const bool any = reduce == Reduce::kAny;
  ASSERT_EQ(got.lower.size(), cpu.lower.size());
  std::size_t others = 0, beyond = 0;
  const auto is_hit = [](Status s) { return s == Status::kOk || s == Status::kOverlap || s == Status::kContact; };
  for (std::size_t i = 0; i < got.lower.size(); ++i) {
    beyond += got.status[i] == Status::kBeyond;
    if (got.lower[i] == cpu.lower[i] && got.upper[i] == cpu.upper[i] && got.status[i] == cpu.status[i]) continue;
    ++others;
    if (any) {  // another pair may be reported
      EXPECT_FALSE(got.status[i] == Status::kBeyond && is_hit(cpu.status[i])) << i;
      EXPECT_FALSE(cpu.status[i] == Status::kBeyond && is_hit(got.status[i])) << i;
    } else {
      EXPECT_TRUE(got.lower[i] <= cpu.upper[i] && cpu.lower[i] <= got.upper[i])
          << i << ": [" << got.lower[i] << ", " << got.upper[i] << "] and [" << cpu.lower[i] << ", " << cpu.upper[i]
          << "]";
    }
  }
  EXPECT_LE(others, got.lower.size() / (reduce == Reduce::kNone ? 10 : 4) + 2);
  if (any) {
    EXPECT_GT(beyond, 0u);
    EXPECT_LT(beyond, got.lower.size());
  }
}

class EngineOnDevice : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_WITHOUT_DEVICE();
    device_.emplace(scene_of_an_arm(), EngineOptions{.backend = "cuda"});
    cpu_.emplace(scene_of_an_arm(), EngineOptions{.backend = "cpu", .covers = "off"});
  }
  Query query(const Inputs& inputs, Reduce reduce = Reduce::kNone) const {
    Query query{.bodies = inputs.bodies, .joints = inputs.joints, .reduce = reduce, .fields = kFields};
    if (reduce == Reduce::kAny) query.margin = 0.001;
    if (reduce == Reduce::kAny) query.pairs = pairs_;
    return query;
  }

  /// Expects the CPU's rows in the present scene.
  void expect_now(Prepared& prepared, const Inputs& inputs) {
    DeviceQuery now = prepared.on_device(16);
    put(now.info(), inputs);
    now.run();
    expect_the_cpus(Rows(now.info()), Rows(cpu_->prepare(query(inputs)).run(inputs.spans())));
  }
  std::uint64_t counter(const std::string& wanted) const {
    for (const auto& [name, value] : device_->stats())
      if (name == wanted) return value;
    ADD_FAILURE() << wanted;
    return 0;
  }

  std::optional<Engine> device_, cpu_;
  std::vector<IdPair> pairs_;
};

TEST_F(EngineOnDevice, GivesTheRowsOfTheCpu) {
  constexpr std::uint32_t kConfigurations = 300;
  for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny})
    for (const bool by_joints : {false, true}) {
      SCOPED_TRACE("reduce " + std::to_string(static_cast<int>(reduce)) + (by_joints ? ", joints" : ""));
      pairs_ = {{device_->body("b1"), by_joints ? device_->group("arm") : device_->body("b2")}};
      Inputs inputs(*device_, by_joints, kConfigurations, 3);
      Prepared prepared = device_->prepare(query(inputs, reduce)), on_cpu = cpu_->prepare(query(inputs, reduce));
      DeviceQuery on_device = prepared.on_device(kConfigurations);
      const DeviceQueryInfo& info = on_device.info();
      ASSERT_EQ(info.joints, inputs.joints.size());
      ASSERT_EQ(info.configurations, kConfigurations);
      for (const std::uint64_t seed : {4, 5}) {
        inputs = Inputs(*device_, by_joints, kConfigurations, seed);
        put(info, inputs);
        EXPECT_GT(on_device.run().took.count(), 0);
        expect_the_cpus(Rows(info), Rows(on_cpu.run(inputs.spans())), reduce);
      }
    }
}

TEST_F(EngineOnDevice, AnswersForTheCurrentPoses) {
  Query query{.fields = kFields};
  DeviceQuery on_device = device_->prepare(query).on_device();
  on_device.run();
  ASSERT_EQ(on_device.info().configurations, 1u);
  expect_the_cpus(Rows(on_device.info()), Rows(cpu_->distances(query)));
}

TEST_F(EngineOnDevice, RunsInTheCallersStreamAndInGraphs) {
  const Inputs first(*device_, true, 64, 6), second(*device_, true, 64, 7);
  DeviceQuery on_device = device_->prepare(query(first)).on_device(64);
  const DeviceQueryInfo& info = on_device.info();
  std::vector<Rows> expected;
  for (const Inputs* inputs : {&first, &second}) {
    put(info, *inputs);
    on_device.run();
    expected.emplace_back(info);
  }
  EXPECT_FALSE(expected[0] == expected[1]);

  DeviceStream stream;
  put(info, first);
  on_device.enqueue(stream.get());
  stream.wait();
  EXPECT_TRUE(Rows(info) == expected[0]) << "in the caller's stream";
  put(info, second);
  stream.capture([&] { on_device.enqueue(stream.get()); });
  for (const std::size_t turn : {0, 1, 0}) {
    put(info, turn == 0 ? first : second);
    stream.launch();
    stream.wait();
    EXPECT_TRUE(Rows(info) == expected[turn]) << "a graph reads its input again";
  }
}

TEST_F(EngineOnDevice, QueriesHaveMemoryOfTheirOwn) {
  const Inputs first(*device_, false, 16, 8), second(*device_, false, 32, 9);
  Prepared prepared = device_->prepare(query(first));
  DeviceQuery one = prepared.on_device(16);
  std::optional<DeviceQuery> other = prepared.on_device(32);
  EXPECT_NE(one.info().memory, other->info().memory);
  put(one.info(), first);
  put(other->info(), second);
  one.run();
  const Rows before(one.info());
  other->run();
  EXPECT_TRUE(Rows(one.info()) == before);
  other.reset();
  one.run();
  EXPECT_TRUE(Rows(one.info()) == before) << "the other one has ended";
  one.close();
  EXPECT_THROW(one.run(), std::logic_error);
}

TEST_F(EngineOnDevice, ChangedScenesAreNoticed) {
  const Inputs inputs(*device_, false, 16, 10);
  Prepared prepared = device_->prepare(query(inputs));
  DeviceQuery before = prepared.on_device(16);
  put(before.info(), inputs);
  before.run();
  const Rows rows(before.info());
  for (Engine* engine : {&*device_, &*cpu_}) engine->add_body({.name = "added", .box = std::array{0.4, 0.4, 0.4}});
  EXPECT_LT(counter("cuda.scene_bytes_uploaded"), counter("cuda.scene_bytes") / 2) << "the other hulls were there";
  EXPECT_THROW(before.run(), QueryError);
  before.run({}, false);
  EXPECT_TRUE(Rows(before.info()) == rows) << "of the query's scene";

  const std::pair<std::uint32_t, Pose7> moved{device_->body("added"), {0.2, 0, 0.4, 1, 0, 0, 0}};
  for (Engine* engine : {&*device_, &*cpu_}) engine->set_poses(std::span(&moved, 1));
  expect_now(prepared, inputs);
  for (Engine* engine : {&*device_, &*cpu_}) engine->remove_body("added");
  expect_now(prepared, inputs);
  EXPECT_TRUE(Rows(before.info()) == rows);
}

// Each device numbers the hulls of its scene: in any history, all must number them alike.
TEST_F(EngineOnDevice, SeveralDevicesAnswerAlikeAfterChanges) {
  if (device_count() < 2) GTEST_SKIP() << "needs two GPUs, this machine has " << device_count();
  const Engine before(scene_of_an_arm(), EngineOptions{.backend = "cuda", .devices = {0}});
  device_->add_body({.name = "first", .box = std::array{0.3, 0.2, 0.1}});  // devices have different histories now
  Engine both(scene_of_an_arm(), EngineOptions{.backend = "cuda", .devices = {0, 1}});
  const Inputs inputs(both, false, 3000, 12);
  const auto expect_alike = [&](const char* what) {
    SCOPED_TRACE(what);
    expect_the_cpus(Rows(both.prepare(query(inputs)).run(inputs.spans())),
                    Rows(cpu_->prepare(query(inputs)).run(inputs.spans())));
  };
  expect_alike("at first");
  for (Engine* engine : {&both, &*cpu_}) engine->add_body({.name = "added", .box = std::array{0.4, 0.4, 0.4}});
  const std::pair<std::uint32_t, Pose7> moved{both.body("added"), {0.2, 0, 0.4, 1, 0, 0, 0}};
  for (Engine* engine : {&both, &*cpu_}) engine->set_poses(std::span(&moved, 1));
  expect_alike("with another body");
  for (Engine* engine : {&both, &*cpu_}) engine->remove_body("added");
  expect_alike("without it");
}

TEST_F(EngineOnDevice, WhatTheCpuAloneAnswersIsRejected) {
  const Inputs inputs(*device_, false, 4, 11);
  Query within = query(inputs);
  within.reduce = Reduce::kWithin;
  EXPECT_THROW(device_->prepare(within).on_device(4), QueryError);
  EXPECT_THROW(cpu_->prepare(query(inputs)).on_device(4), QueryError);
}

}  // namespace
}  // namespace clearance::test
