// Device queries through the loop: memory that the client maps, runs alongside other requests, quotas of a client, and
// cleanup after it disconnects. Uses a fake device in host memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <vector>

#include "tests/engine/cuda/uncertain_scene.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/server/tasks/plan_device.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

/// A device query as seen by its client.
struct Mapped {
  wire::PlanHeader header;
  std::vector<wire::PlanColumnRecord> columns;

  std::byte* at(std::uint64_t offset) const { return test::mapped(header.memory_handle) + offset; }
  Pose* poses() const { return reinterpret_cast<Pose*>(at(header.poses_offset)); }
  double* positions() const { return reinterpret_cast<double*>(at(header.positions_offset)); }
  template <class T>
  const T* column(Field field) const {
    for (const auto& column : columns)
      if (column.field == field) return reinterpret_cast<const T*>(at(column.offset));
    ADD_FAILURE() << "no column " << field;
    return nullptr;
  }
};

class DevicePlansTest : public LoopTest {
 protected:
  void begin(engine::Scene scene, Loop::Options options = {}, const char* backend = "cuda") {
    loop_.reset();
    options.worker_thread = with_worker_;
    engine::Engine::Options of_engine;
    of_engine.backend = backend;
    of_engine.threads = 1;
    engine_ = std::make_unique<engine::Engine>(std::move(scene), of_engine);
    loop_ = std::make_unique<Loop>(*engine_, options);
    auto transport = std::make_unique<MemoryTransport>();
    transport_ = transport.get();
    loop_->add(std::move(transport));
  }
  void begin(Loop::Options options = {}) { begin(test::spheres(12), options); }
  void TearDown() override {
    loop_.reset();  // before the fake device
    engine_.reset();
    EXPECT_EQ(device_.shared, 0) << "all memory was given back";
  }

  static TestQuery plan_query(std::uint32_t configurations = 5) {
    TestQuery query;
    query.bodies = {3, 7};
    query.header.fields = kFieldLower | kFieldUpper | kFieldStatus;
    query.plan_configurations = configurations;
    return query;
  }
  static std::vector<std::byte> plan_frame(FrameType type, std::uint64_t plan, std::uint64_t scene = 0) {
    const wire::PlanRecord record{plan, 0};
    return wire::FrameBuilder(wire::make_header(type, 9, 0, scene)).add(record).take();
  }
  std::unique_ptr<MemoryFrame> await(MemoryClient& client) {
    while (client.replies.empty()) loop_->turn();
    return take(client);
  }
  std::unique_ptr<MemoryFrame> tell(MemoryClient& client, std::vector<std::byte> frame) {
    transport_->send(client, std::move(frame));
    return await(client);
  }
  static Mapped mapped(const MemoryFrame& frame) {
    EXPECT_EQ(frame.type(), FrameType::kPlan);
    if (frame.type() != FrameType::kPlan) return {};
    const auto parts = wire::parse_plan(frame.body());
    Mapped plan{parts.header, {}};
    for (std::uint64_t i = 0; i < parts.columns.size(); ++i) plan.columns.push_back(parts.columns[i]);
    return plan;
  }
  Mapped open(MemoryClient& client, const TestQuery& query) {
    return mapped(*tell(client, query.frame(1, FrameType::kOpenPlan)));
  }
  Mapped open(MemoryClient& client) { return open(client, plan_query()); }
  wire::PlanResult run(MemoryClient& client, std::uint64_t plan) {
    const auto frame = tell(client, plan_frame(FrameType::kRunPlan, plan));
    EXPECT_EQ(frame->type(), FrameType::kPlanDone);
    return frame->type() == FrameType::kPlanDone ? wire::parse_plan_done(frame->body()) : wire::PlanResult();
  }
  void expect_rejected(const std::unique_ptr<MemoryFrame>& frame, ErrorCode code, const std::string& text) {
    const auto error = error_of(frame);
    EXPECT_EQ(static_cast<ErrorCode>(error.header.code), code);
    EXPECT_EQ(error.text, text);
  }
  std::uint64_t counter(const std::string& name) {
    const auto frame = tell(c_, simple_frame(FrameType::kGetStats, 1));
    const auto all = wire::parse_stats(frame->body());
    for (std::uint64_t i = 0; i < all.size(); ++i)
      if (wire::name_of(all[i].name) == name) return all[i].value;
    ADD_FAILURE() << name;
    return 0;
  }
  /// Runs the loop until device queries use this many bytes: a worker frees them.
  void turn_until_shared(int blocks) {
    while (device_.shared != blocks) loop_->turn();
  }

  test::FakePlanDevice fake_device_;
  test::PlanDevice& device_ = fake_device_.device;
};

TEST_F(DevicePlansTest, AnswerFromMemoryThatTheClientWrites) {
  const std::tuple<Reduce, std::uint8_t> kinds[] = {{Reduce::kNone, 0}, {Reduce::kMin, 0}, {Reduce::kAny, 0},
                                                    {Reduce::kNone, 1}, {Reduce::kMin, 1}, {Reduce::kAny, 1}};
  for (const auto& [reduce, precision] : kinds)
    for (const bool by_joints : {false, true}) {
      SCOPED_TRACE(static_cast<int>(reduce));
      constexpr std::uint32_t K = 7;
      test::UncertainCase c(K, 5);
      TestQuery query;
      for (const BodyPair& pair : c.pairs) query.pairs.push_back({pair.a, pair.b});
      query.bodies = c.bodies;
      if (by_joints) query.joints = c.joints;
      query.header.fields = kFieldLower | kFieldStatus;
      query.header.reduce = static_cast<std::uint8_t>(reduce);
      query.header.precision = precision;
      query.plan_configurations = K;
      begin(std::move(c.scene));
      const Mapped plan = open(a_, query);
      const std::uint64_t M = c.bodies.size(), J = by_joints ? c.joints.size() : 0, P = c.pairs.size();
      const wire::PlanHeader& h = plan.header;
      EXPECT_EQ(h.configurations, K);
      EXPECT_EQ(h.pairs, P);
      EXPECT_EQ(h.rows, reduce == Reduce::kNone ? K * P : K);
      EXPECT_EQ(h.body_count, M);
      EXPECT_EQ(h.joint_count, J);
      EXPECT_EQ(h.scene_revision, engine_->scene_revision());
      EXPECT_EQ(h.snapshot_revision, engine_->pose_revision());
      EXPECT_EQ(h.device_uuid[3], 7);
      EXPECT_TRUE(h.fields & kFieldLower && h.fields & kFieldStatus);
      const auto* lower = plan.column<double>(kFieldLower);
      for (std::uint64_t i = 0; i < h.rows; ++i) ASSERT_EQ(lower[i], 0) << "nothing was answered yet";
      for (int turn = 1; turn <= 2; ++turn) {
        for (std::uint64_t k = 0; k < K; ++k) {
          plan.poses()[k * M] = Pose{{turn * 0.25 + 2.0 * static_cast<double>(k), 0, 0}};
          if (J) plan.positions()[k * J] = -1.0 * turn - static_cast<double>(k);
        }
        EXPECT_EQ(run(a_, h.plan).plan, h.plan);
        for (std::uint64_t k = 0; k < K; ++k)
          for (std::uint64_t p = 0; p < h.rows / K; ++p)
            ASSERT_EQ(lower[k * (h.rows / K) + p], test::planned(turn * 0.25 + 2.0 * static_cast<double>(k),
                                                                 J ? -1.0 * turn - static_cast<double>(k) : 0, p));
      }
      EXPECT_EQ(tell(a_, plan_frame(FrameType::kClosePlan, h.plan))->type(), FrameType::kPlanDone);
      turn_until_shared(0);
    }
}

TEST_F(DevicePlansTest, OfTheCurrentPosesTakeNone) {
  begin();
  TestQuery query;
  query.header.fields = kFieldLower;
  query.plan_configurations = 0;
  const Mapped plan = open(a_, query);
  EXPECT_EQ(plan.header.configurations, 1u);
  EXPECT_EQ(plan.header.body_count, 0u);
  EXPECT_EQ(plan.header.rows, 12u * 11 / 2);
  run(a_, plan.header.plan);
  EXPECT_EQ(plan.column<double>(kFieldLower)[5], test::planned(0, 0, 5));
}

TEST_F(DevicePlansTest, AreLaunchedAFewChunksAtATime) {
  begin();
  TestQuery query = plan_query(3'400'000);  // of 11 pairs, in chunks of 4M pair-configurations
  query.bodies = {3};
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  query.header.fields = kFieldLower;
  const Mapped plan = open(a_, query);
  device_.is_done = false;
  transport_->send(a_, plan_frame(FrameType::kRunPlan, plan.header.plan));
  for (int i = 0; i < 100; ++i) loop_->turn();
  EXPECT_EQ(device_.launches, 4);
  device_.is_done = true;
  EXPECT_EQ(await(a_)->type(), FrameType::kPlanDone);
  EXPECT_EQ(device_.launches, 9);
}

TEST_F(DevicePlansTest, ThatRunForLongDelayNoOthers) {
  begin();
  const Mapped long_one = open(a_), short_one = open(b_);
  device_.is_done = false;
  transport_->send(a_, plan_frame(FrameType::kRunPlan, long_one.header.plan));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(tell(b_, simple_frame(FrameType::kPing, 1))->type(), FrameType::kPong);
    EXPECT_EQ(tell(b_, small_query().frame(2))->type(), FrameType::kReply);
  }
  EXPECT_TRUE(a_.replies.empty());
  // The run owns its memory until it ends.
  expect_rejected(tell(a_, plan_frame(FrameType::kRunPlan, long_one.header.plan)), ErrorCode::kBusy,
                  "a plan on a device: plan 1 is running already; wait for its rows, which are the same memory");
  EXPECT_EQ(tell(a_, small_query().frame(2))->type(), FrameType::kReply) << "its client's other requests";
  EXPECT_EQ(open(c_).header.plan, 3u);
  transport_->send(b_, plan_frame(FrameType::kRunPlan, short_one.header.plan));
  for (int i = 0; i < 50; ++i) loop_->turn();
  device_.is_done = true;
  EXPECT_EQ(await(a_)->type(), FrameType::kPlanDone);
  EXPECT_EQ(await(b_)->type(), FrameType::kPlanDone);
  run(a_, long_one.header.plan);
  EXPECT_EQ(counter("plans.runs"), 3u);
}

TEST_F(DevicePlansTest, AreTheirClientsAlone) {
  begin();
  const Mapped plan = open(a_);
  const std::string unknown = "a plan on a device: this client has no plan 1 open";
  expect_rejected(tell(b_, plan_frame(FrameType::kRunPlan, plan.header.plan)), ErrorCode::kBadQuery, unknown);
  expect_rejected(tell(b_, plan_frame(FrameType::kClosePlan, plan.header.plan)), ErrorCode::kBadQuery, unknown);
  expect_rejected(tell(a_, plan_frame(FrameType::kRunPlan, 2)), ErrorCode::kBadQuery,
                  "a plan on a device: this client has no plan 2 open");
  run(a_, plan.header.plan);
  EXPECT_EQ(tell(a_, plan_frame(FrameType::kClosePlan, plan.header.plan))->type(), FrameType::kPlanDone);
  turn_until_shared(0);
  expect_rejected(tell(a_, plan_frame(FrameType::kRunPlan, plan.header.plan)), ErrorCode::kBadQuery, unknown);
  EXPECT_EQ(counter("plans.open"), 0u);
  EXPECT_EQ(counter("plans.bytes"), 0u);
}

TEST_F(DevicePlansTest, EndWithTheirClient) {
  Loop::Options options;
  options.tick = 1ms;
  begin(options);
  open(a_), open(a_);
  open(b_);
  EXPECT_EQ(counter("plans.open"), 3u);
  a_.alive = false;
  turn_until_shared(1);
  EXPECT_EQ(counter("plans.open"), 1u);
  EXPECT_EQ(counter("plans.closed"), 2u);
  // Including one that runs.
  const Mapped plan = open(c_);
  device_.is_done = false;
  transport_->send(c_, plan_frame(FrameType::kRunPlan, plan.header.plan));
  for (int i = 0; i < 5; ++i) loop_->turn();
  c_.alive = false;
  turn_until_shared(1);
}

TEST_F(DevicePlansTest, ThatAreClosedWhileTheyRunGoOnToTheirEnd) {
  begin();
  const Mapped plan = open(a_);
  device_.is_done = false;
  transport_->send(a_, plan_frame(FrameType::kRunPlan, plan.header.plan));
  for (int i = 0; i < 5; ++i) loop_->turn();
  EXPECT_EQ(tell(a_, plan_frame(FrameType::kClosePlan, plan.header.plan))->type(), FrameType::kPlanDone);
  EXPECT_EQ(device_.shared, 1) << "the device still writes there";
  device_.is_done = true;
  EXPECT_EQ(await(a_)->type(), FrameType::kPlanDone);
  turn_until_shared(0);
}

TEST_F(DevicePlansTest, AreSoManyAndSoLargeAndNoMore) {
  Loop::Options options;
  options.max_plans_of_client = 2;
  options.max_plans = 3;
  constexpr std::uint64_t kOne = cuda::SharedMemory::kConvexPart + test::HostPlans::kOwnBytes;
  options.max_plan_bytes_of_client = 3 * kOne;
  options.max_plan_bytes = 4 * kOne;
  begin(options);
  const auto evaluate_for = [&](MemoryClient& client, const TestQuery& query) {
    return tell(client, query.frame(1, FrameType::kOpenPlan));
  };
  const Mapped first = open(a_);
  open(a_);
  const std::uint64_t bytes = counter("plans.bytes");
  EXPECT_GE(bytes, 2 * kOne);
  EXPECT_LT(bytes, 2 * kOne + 4000) << "and the lists of their few pairs";
  expect_rejected(evaluate_for(a_, plan_query()), ErrorCode::kBusy,
                  "a plan on a device: 2 plans of this client are open already; close one (limit max-client-plans)");
  const TestQuery large = plan_query(100'000);  // 11 MB of poses
  const auto too_large = error_of(evaluate_for(b_, large));
  EXPECT_EQ(static_cast<ErrorCode>(too_large.header.code), ErrorCode::kTooLarge);
  EXPECT_EQ(too_large.text, "a plan on a device: it needs 11200000 bytes of the device's memory; of the " +
                                std::to_string(3 * kOne) +
                                " that this client may take, its plans have 0 already "
                                "(limit max-client-plan-mib)");
  EXPECT_EQ(counter("plans.open"), 2u) << "what was refused takes nothing";
  EXPECT_EQ(counter("plans.bytes"), bytes);
  open(b_);
  expect_rejected(evaluate_for(c_, plan_query()), ErrorCode::kBusy,
                  "a plan on a device: 3 plans of all clients are open already (limit max-plans)");
  tell(a_, plan_frame(FrameType::kClosePlan, first.header.plan));
  turn_until_shared(2);
  const auto all_taken = error_of(evaluate_for(c_, plan_query(12'000)));  // three blocks of 2 MiB
  EXPECT_EQ(static_cast<ErrorCode>(all_taken.header.code), ErrorCode::kBusy);
  EXPECT_NE(all_taken.text.find("are taken already (limit max-plan-mib)"), std::string::npos) << all_taken.text;
  open(c_);

  options.max_plans_of_client = 0;
  begin(options);
  expect_rejected(evaluate_for(a_, plan_query()), ErrorCode::kNotSupported,
                  "a plan on a device: this daemon opens none (limit max-client-plans = 0)");
}

TEST_F(DevicePlansTest, AreRejectedByName) {
  Loop::Options options;
  options.max_pairs = 1000;
  begin(options);
  const auto reject = [&](TestQuery query, ErrorCode code, const std::string& text) {
    expect_rejected(tell(a_, query.frame(1, FrameType::kOpenPlan)), code, text);
  };
  a_.is_local = false;
  reject(plan_query(), ErrorCode::kNotSupported,
         "a plan on a device: its memory is shared only with processes of this machine, over shm:// and "
         "ipc://; this client is not one of them");
  a_.is_local = true;
  TestQuery query = plan_query();
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kNearest);
  reject(query, ErrorCode::kNotSupported, "a plan on a device: reduce: expected none, min or any");
  query = plan_query();
  query.header.min_pose_stamp_ns = 5;
  reject(query, ErrorCode::kNotSupported, "a plan on a device: without min_pose_stamp_ns and deadline_ns");
  query = plan_query();
  query.bodies = {3, 3};
  const auto twice = error_of(tell(a_, query.frame(1, FrameType::kOpenPlan)));
  EXPECT_EQ(static_cast<ErrorCode>(twice.header.code), ErrorCode::kBadQuery) << twice.text;
  reject(plan_query(48), ErrorCode::kTooLarge,
         "48 configurations of 21 pairs are more than the 1000 that one query may have (limit max-pairs): split it");
  query = plan_query(4'000'000'000u);
  query.joints = std::vector<std::uint32_t>(100'000);
  reject(query, ErrorCode::kTooLarge,
         "a plan on a device: 4000000000 configurations of 2 bodies and 100000 joints are more than one has room for");
  device_.has_room = false;
  reject(plan_query(), ErrorCode::kTooLarge,
         "a plan on a device: device memory, " + std::to_string(cuda::SharedMemory::kConvexPart) + " bytes: full");
  device_.has_room = true;
  EXPECT_EQ(counter("plans.open"), 0u);
  EXPECT_EQ(counter("plans.bytes"), 0u);
  query = plan_query();
  query.records = [] {
    std::vector<std::byte> records;
    const double position = 0;
    wire::append_record(records, static_cast<std::uint16_t>(wire::QueryRecord::kPositions), wire::kRecordRequired,
                        std::as_bytes(std::span(&position, 1)));
    return records;
  }();
  reject(query, ErrorCode::kBadQuery, "query: positions are not for kPairs and kOpenPlan");
  for (const FrameType type : {FrameType::kRunPlan, FrameType::kClosePlan}) {
    expect_rejected(tell(a_, simple_frame(type, 1)), ErrorCode::kBadFrame,
                    "plan: the payload has 0 bytes, fewer than its header of 16");
    const std::array<std::uint64_t, 2> odd{1, 1};
    expect_rejected(tell(a_, simple_frame(type, 1, std::as_bytes(std::span(odd)))), ErrorCode::kBadFrame,
                    "plan: reserved words must be 0");
    const std::array<std::uint64_t, 3> longer{1, 0, 0};
    expect_rejected(tell(a_, simple_frame(type, 1, std::as_bytes(std::span(longer)))), ErrorCode::kBadFrame,
                    "plan: its contents need a payload of 16 bytes, got 24");
  }
  begin(test::spheres(12), {}, "cpu");
  reject(plan_query(), ErrorCode::kNotSupported, "a plan on a device: the engine has no device (backend cuda or auto)");
}

TEST_F(DevicePlansTest, OfAnotherSceneAreRejectedWhereTheirClientSaysWhichItKnows) {
  begin();
  const Mapped plan = open(a_);
  const auto in_scene = [&](std::uint64_t scene) {
    return tell(a_, plan_frame(FrameType::kRunPlan, plan.header.plan, scene));
  };
  EXPECT_EQ(in_scene(plan.header.scene_revision)->type(), FrameType::kPlanDone);
  engine_->attach(3, 5, nullptr, {});
  ASSERT_NE(engine_->scene_revision(), plan.header.scene_revision);
  expect_rejected(in_scene(plan.header.scene_revision), ErrorCode::kWrongScene,
                  "a plan on a device: plan 1 was made for an earlier scene; open it again");
  EXPECT_EQ(in_scene(0)->type(), FrameType::kPlanDone) << "it keeps the one that it was made for";
}

TEST_F(DevicePlansTest, OfALostDeviceSaySo) {
  begin();
  const Mapped plan = open(a_);
  device_.is_lost = true;
  expect_rejected(tell(a_, plan_frame(FrameType::kRunPlan, plan.header.plan)), ErrorCode::kNotSupported,
                  "a plan on a device: CUDA: a planted loss");
  expect_rejected(tell(a_, plan_frame(FrameType::kRunPlan, plan.header.plan)), ErrorCode::kNotSupported,
                  "a plan on a device: CUDA: a planted loss");
  EXPECT_EQ(tell(a_, plan_frame(FrameType::kClosePlan, plan.header.plan))->type(), FrameType::kPlanDone);
  EXPECT_EQ(tell(b_, simple_frame(FrameType::kPing, 1))->type(), FrameType::kPong);
}

/// With the workers' threads.
class PlanThreads : public DevicePlansTest {
 protected:
  void SetUp() override { with_worker_ = true; }
};

TEST_F(PlanThreads, AreNeverTheLoops) {
  Loop::Options options;
  options.tick = 1ms;
  begin(options);
  const Mapped first = open(a_), second = open(a_);
  for (int i = 0; i < 20; ++i) run(a_, first.header.plan);
  tell(a_, plan_frame(FrameType::kClosePlan, first.header.plan));
  turn_until_shared(1);
  transport_->send(a_, plan_frame(FrameType::kRunPlan, second.header.plan));
  a_.alive = false;
  turn_until_shared(0);
  const std::lock_guard lock(device_.mutex);
  EXPECT_GE(device_.threads.size(), 2u) << "one makes and frees, another runs";
  EXPECT_FALSE(device_.threads.contains(std::this_thread::get_id()));
}

TEST_F(PlanThreads, OpeningThatTakesLongHoldsUpNobody) {
  begin();
  const Mapped plan = open(b_);
  device_.let_share(false);
  transport_->send(a_, plan_query().frame(1, FrameType::kOpenPlan));
  while (device_.waiting == 0) loop_->turn();
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(tell(b_, small_query().frame(2))->type(), FrameType::kReply);
    run(b_, plan.header.plan);
  }
  EXPECT_TRUE(a_.replies.empty());
  device_.let_share(true);
  mapped(*await(a_));
}

TEST_F(PlanThreads, ThatAreOpenedForAClientWhoHasGoneAreClosed) {
  Loop::Options options;
  options.tick = 1ms;
  begin(options);
  device_.let_share(false);
  transport_->send(a_, plan_query().frame(1, FrameType::kOpenPlan));
  while (device_.waiting == 0) loop_->turn();
  a_.alive = false;
  device_.let_share(true);
  while (a_.sinks > 0) loop_->turn();
  turn_until_shared(0);
  while (counter("plans.open") > 0) loop_->turn();  // the thread that freed it reports a moment later
  EXPECT_TRUE(a_.replies.empty());
}

}  // namespace
}  // namespace clearance
