// Device queries of the C++ client over real transports, with a fake device in host memory that this process "maps".
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <string>
#include <thread>
#include <vector>

#include "server/core/loop.h"
#include "server/shm/shm_transport.h"
#include "tests/patience.h"
#include "tests/server/shm/shm_echo.h"
#include "tests/server/tasks/plan_device.h"

namespace clearance {
namespace {

class RemotePlans : public testing::Test {
 protected:
  /// Call after forking: the child of a process with threads has only one.
  void serve() {
    Loop::Options options;
    options.tick = 5ms;
    options.max_plans_of_client = 3;
    engine_ =
        std::make_unique<engine::Engine>(test::spheres(12), engine::Engine::Options{.backend = "cuda", .threads = 1});
    loop_ = std::make_unique<Loop>(*engine_, options);
    loop_->add(make_shm_transport(folder_ / "c.sock"));
    loop_->add(make_zmq_transport("ipc://" + (folder_ / "c.ipc")));
    loop_->add(make_zmq_transport("tcp://127.0.0.1:*"));
    for (const auto& transport : loop_->transports()) urls_.push_back(transport->url());
    thread_ = std::thread([this] { loop_->run(); });
  }
  void TearDown() override {
    if (!loop_) return;
    loop_->stop();
    thread_.join();
    loop_.reset();
    engine_.reset();
    EXPECT_EQ(fake_device_.device.shared, 0);
  }
  void wait_for_blocks(int blocks) const {
    while (fake_device_.device.shared != blocks) std::this_thread::yield();
  }
  static Query query() {
    static constexpr std::uint32_t kBodies[] = {3, 7};
    Query query;
    query.bodies = kBodies;
    query.fields = kFieldLower | kFieldStatus;
    return query;
  }
  template <class Call>
  static RequestError rejected(Call call) {
    try {
      call();
    } catch (const RequestError& error) {
      return error;
    }
    ADD_FAILURE() << "not refused";
    return {0, ""};
  }
  static std::uint16_t code(wire::ErrorCode code) { return static_cast<std::uint16_t>(code); }

  TemporaryFolder folder_;
  test::FakePlanDevice fake_device_;
  std::unique_ptr<engine::Engine> engine_;
  std::unique_ptr<Loop> loop_;
  std::vector<std::string> urls_;
  std::thread thread_;
};

TEST_F(RemotePlans, AreOpenedRunAndClosed) {
  serve();
  for (const std::string& url : {urls_[0], urls_[1]}) {
    SCOPED_TRACE(url);
    Client client = patient(url);
    DeviceQuery plan = client.prepare(query()).on_device(4);
    const DeviceQueryInfo& info = plan.info();
    EXPECT_EQ(info.configurations, 4u);
    EXPECT_EQ(info.bodies, 2u);
    EXPECT_EQ(info.joints, 0u);
    EXPECT_EQ(info.rows, 4 * info.pairs);
    EXPECT_EQ(info.pairs, 21u);
    EXPECT_EQ(info.columns.size(), 2u);
    EXPECT_EQ(info.scene_revision, client.scene().revision);
    EXPECT_EQ(info.column(kFieldStatus).row_bytes, 1u);
    EXPECT_THROW(info.column(kFieldUpper), std::invalid_argument);
    EXPECT_EQ(static_cast<int>(info.device_uuid[3]), 7);
    std::byte* const memory = test::mapped(info.memory_handle.data());
    auto* const poses = reinterpret_cast<Pose7*>(memory + info.poses_offset);
    const auto* const lower = reinterpret_cast<const double*>(memory + info.column(kFieldLower).offset);
    for (int turn = 0; turn < 30; ++turn) {
      for (int k = 0; k < 4; ++k) poses[2 * k] = {0.5 * k + turn, 0, 0, 1, 0, 0, 0};
      const DeviceRun run = plan.run();
      EXPECT_GE(run.took.count(), 0);
      EXPECT_EQ(run.snapshot_revision, engine_->pose_revision());
      for (int k = 0; k < 4; ++k)
        for (std::uint64_t p = 0; p < 21; ++p)
          ASSERT_EQ(lower[static_cast<std::uint64_t>(k) * 21 + p], test::planned(0.5 * k + turn, 0, p));
    }
    wait_for_blocks(1);
    plan.close();
    wait_for_blocks(0);
    EXPECT_THROW(plan.run(), std::logic_error);
    EXPECT_THROW(plan.close(), std::logic_error);
  }
}

TEST_F(RemotePlans, EndWithWhatHoldsThem) {
  serve();
  for (const std::string& url : {urls_[0], urls_[1]}) {
    SCOPED_TRACE(url);
    Client client = patient(url);
    {
      DeviceQuery first = client.prepare(query()).on_device(4);
      const DeviceQuery second = client.prepare(query()).on_device(5);
      wait_for_blocks(2);
      first = client.prepare(query()).on_device(6);
      EXPECT_EQ(first.info().configurations, 6u);
    }
    wait_for_blocks(0);
    EXPECT_EQ(client.distances().rows(), 66u) << "the connection goes on";
  }
  // The device query keeps the connection alive, and both end together.
  auto client = std::make_unique<Client>(patient(urls_[0]));
  auto plan = std::make_unique<DeviceQuery>(client->prepare(query()).on_device(4));
  client.reset();
  plan->run();
  plan.reset();
  wait_for_blocks(0);
}

TEST_F(RemotePlans, AreRejectedByName) {
  serve();
  Client client = patient(urls_[0]);
  Query wrong = query();
  const std::vector<Pose7> poses(2);
  wrong.configurations = poses;
  EXPECT_THROW(client.prepare(wrong).on_device(1), std::invalid_argument);
  wrong = query();
  wrong.reduce = Reduce::kWithin;
  const RequestError within = rejected([&] { client.prepare(wrong).on_device(4); });
  EXPECT_EQ(within.code, code(wire::ErrorCode::kNotSupported));
  EXPECT_STREQ(within.what(), "a plan on a device: reduce: expected none, min or any");

  std::vector<DeviceQuery> plans;
  for (int i = 0; i < 3; ++i) plans.push_back(client.prepare(query()).on_device(4));
  EXPECT_EQ(rejected([&] { client.prepare(query()).on_device(4); }).code, code(wire::ErrorCode::kBusy));

  client.attach(4, 5);
  const RequestError old = rejected([&] { plans[0].run(); });
  EXPECT_EQ(old.code, code(wire::ErrorCode::kWrongScene)) << old.what();
  plans[0].run({}, false);

  fake_device_.device.is_done = false;
  EXPECT_THROW(plans[1].run(20ms, false), TimeoutError);
  EXPECT_EQ(rejected([&] { plans[1].run({}, false); }).code, code(wire::ErrorCode::kBusy)) << "it goes on over there";
  fake_device_.device.is_done = true;
  for (;;) try {
      plans[1].run({}, false);
      break;
    } catch (const RequestError& error) {
      ASSERT_EQ(error.code, code(wire::ErrorCode::kBusy));
    }

  Client far = patient(urls_[2]);
  const RequestError tcp = rejected([&] { far.prepare(query()).on_device(4); });
  EXPECT_EQ(tcp.code, code(wire::ErrorCode::kNotSupported));
  EXPECT_STREQ(tcp.what(),
               "a plan on a device: its memory is shared only with processes of this machine, over shm:// and "
               "ipc://; this client is not one of them");
}

TEST_F(RemotePlans, OfAProcessThatIsKilledAreFreed) {
  int go[2], opened[2];
  ASSERT_EQ(::pipe(go), 0);
  ASSERT_EQ(::pipe(opened), 0);
  std::vector<pid_t> children;
  for (const std::string& url : {"shm://" + (folder_ / "c.sock"), "ipc://" + (folder_ / "c.ipc")}) {
    const pid_t child = ::fork();
    if (child == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      char byte = 0;
      if (::read(go[0], &byte, 1) != 1) ::_exit(1);
      Client client = patient(url);
      const DeviceQuery one = client.prepare(query()).on_device(4), other = client.prepare(query()).on_device(5);
      if (::write(opened[1], "x", 1) != 1) ::_exit(1);
      for (;;) ::pause();
    }
    children.push_back(child);
  }
  serve();
  ASSERT_EQ(::write(go[1], "xx", 2), 2);
  for (int i = 0; i < 2; ++i) {
    char byte = 0;
    ASSERT_EQ(::read(opened[0], &byte, 1), 1);
  }
  EXPECT_EQ(fake_device_.device.shared, 4);
  int left = 4;
  for (const pid_t child : children) {
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    wait_for_blocks(left -= 2);
  }
  for (const int end : {go[0], go[1], opened[0], opened[1]}) ::close(end);
}

}  // namespace
}  // namespace clearance
