// Device queries through a daemon: this client maps device memory of the daemon, writes poses there and reads rows,
// which must have the bits of an engine in this process.
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "client/client.h"
#include "engine/device/query/device_plan.h"
#include "tests/engine/cuda/same_answer.h"
#include "tests/gpu/device_memory.h"
#include "tests/gpu/skip_without_device.h"
#include "tests/patience.h"
#include "tests/server/daemon_fixture.h"

namespace clearance::test {
namespace {

constexpr const char* kArm = R"(<robot name="arm">
  <link name="base"><collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0 0 0.5"/><geometry><sphere radius="0.3"/></geometry></collision></link>
  <link name="lower"><collision><origin xyz="0 0 0.4"/><geometry><box size="0.2 0.3 0.6"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.9"/>
    <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>
)";
constexpr const char* kScene = R"(bodies:
  - {name: table, box: [3, 2, 0.1], static: true, pose: [0,0,-0.5, 1,0,0,0]}
  - {name: cup, sphere: 0.2, pose: [0.9,0,0.3, 1,0,0,0]}
  - {name: can, capsule: [0.1, 0.5], pose: [-0.7,0.2,0.3, 1,0,0,0]}
  - {name: box, box: [0.3, 0.2, 0.5], pose: [0.2,0.8,0.6, 1,0,0,0]}
robots:
  - {name: arm, urdf: arm.urdf}
random: {count: 40, shape: {uv_sphere: {radius: 0.2, resolution: 5}}, box: 5, seed: 4}
)";
constexpr std::uint32_t kConfigurations = 50;

class DaemonPlans : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
  void start(const std::string& scene, const std::vector<std::string>& more = {}) {
    folder_.write("arm.urdf", kArm);
    scene_ = folder_.write("scene.yaml", scene);
    std::vector<std::string> options{
        "--scene", scene_, "--backend", "cuda", "--shm", folder_ / "c.sock", "--zmq", "ipc://" + (folder_ / "c.ipc")};
    options.insert(options.end(), more.begin(), more.end());
    daemon_.emplace(options);
  }
  static std::uint64_t counter(Client& client, const std::string& wanted) {
    for (const auto& [name, value] : client.stats())
      if (name == wanted) return value;
    ADD_FAILURE() << wanted;
    return 0;
  }

  TestFolder folder_;
  std::string scene_;
  std::optional<Daemon> daemon_;
};

/// Input of a device query in either process.
struct Requested {
  std::vector<std::uint32_t> bodies, joints;
  std::vector<Pose> poses;
  std::vector<double> positions;

  Requested(const engine::Scene& scene, bool by_joints, std::uint64_t seed) {
    for (const char* name : {"cup", "can", "box"}) bodies.push_back(scene.find_body(name));
    if (by_joints)
      for (std::uint32_t j = 0; j < scene.joints().size(); ++j) joints.push_back(j);
    Random random(seed);
    for (std::size_t i = 0; i < kConfigurations * bodies.size(); ++i) poses.push_back(random.pose(1.2));
    for (std::size_t i = 0; i < kConfigurations * joints.size(); ++i) positions.push_back(random.uniform(-1.9, 1.9));
  }
};

TEST_F(DaemonPlans, GiveTheBitsOfAnEngineHere) {
  start(kScene);
  const engine::Engine engine(engine::Scene::load(scene_, false), {"cuda"});
  int compared = 0, unlike = 0;
  for (const std::string& url : daemon_->urls()) {
    Client client = patient(url);
    for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny})
      for (const Precision precision : {Precision::kF64, Precision::kF32})
        for (const bool by_joints : {false, true}) {
          SCOPED_TRACE(url + ", reduce " + std::to_string(static_cast<int>(reduce)) + ", precision " +
                       std::to_string(static_cast<int>(precision)) + (by_joints ? ", joints" : ""));
          Requested requested(engine.scene(), by_joints, 7);
          QueryView q;
          q.precision = precision;
          q.reduce = reduce;
          q.fields = kDefaultFields | kFieldBounds;
          if (by_joints) q.fields |= kFieldGradientJoints;
          q.margin = reduce == Reduce::kAny ? 0.05 : 0;
          q.configuration_count = kConfigurations;
          q.bodies = requested.bodies;
          q.joints = requested.joints;
          const auto here = engine.plan_on_device(q);
          const QuerySize size = here->size();
          Query query;
          query.precision = precision;
          query.reduce = reduce;
          query.fields = q.fields;
          query.margin = q.margin;
          query.bodies = requested.bodies;
          query.joints = requested.joints;
          DeviceQuery plan = client.prepare(query).on_device(kConfigurations);
          const DeviceQueryInfo& info = plan.info();
          ASSERT_EQ(info.rows, size.rows);
          ASSERT_EQ(info.pairs, size.pairs);
          {
            MappedMemory memory(info.memory_handle, info.device_uuid);
            std::uint64_t bytes = 0;
            reply_view_over(nullptr, size.rows, size.fields, &bytes, size.joints);
            DeviceMemory poses(requested.poses.size() * sizeof(Pose)), rows(bytes),
                positions(std::max<std::size_t>(requested.positions.size() * sizeof(double), 1));
            std::vector<std::byte> before;
            for (int turn = 0; turn < 2; ++turn) {
              requested = Requested(engine.scene(), by_joints, 100 + static_cast<std::uint64_t>(turn));
              memory.put(info.poses_offset, requested.poses.data(), poses.size());
              poses.put(requested.poses.data(), poses.size());
              if (by_joints) {
                memory.put(info.positions_offset, requested.positions.data(), positions.size());
                positions.put(requested.positions.data(), positions.size());
              }
              plan.run();
              rows.fill(0);
              DeviceStream stream;
              here->run({.poses = reinterpret_cast<const Pose*>(poses.data()),
                         .positions = by_joints ? reinterpret_cast<const double*>(positions.data()) : nullptr},
                        reply_view_over(rows.data(), size.rows, size.fields, nullptr, size.joints), stream.get());
              stream.wait();
              const std::vector<std::byte> expected = rows.get();
              const DeviceColumn& first = info.columns.front();
              for (const DeviceColumn& column : info.columns) {
                const std::uint64_t in_block = column.offset - first.offset;
                const std::vector<std::byte> got = memory.get(column.offset, info.rows * column.row_bytes);
                EXPECT_TRUE(
                    std::equal(got.begin(), got.end(), expected.begin() + static_cast<std::ptrdiff_t>(in_block)))
                    << "field " << column.field << ", turn " << turn;
                ++compared;
              }
              const std::vector<std::byte> now = memory.get(first.offset, info.rows * first.row_bytes);
              unlike += now != before;
              before = now;
            }
          }
          plan.close();
        }
    EXPECT_EQ(counter(client, "plans.opened"), counter(client, "plans.closed"));
  }
  EXPECT_GT(compared, 200);
  EXPECT_GE(unlike, 24) << "other poses give other rows";
}

/// Not a test: the next test starts it as a separate process, and kills it.
TEST_F(DaemonPlans, Doomed) {
  const char* url = std::getenv("CLEARANCE_TEST_DOOMED");
  if (!url) GTEST_SKIP() << "a process of OfAKilledProcessGoAndLeaveOthersAlone, which starts it itself";
  Client client = patient(url);
  Query query;
  query.fields = kFieldLower;
  DeviceQuery plan = client.prepare(query).on_device(0);
  const MappedMemory memory(plan.info().memory_handle, plan.info().device_uuid);
  plan.run();
  ::raise(SIGKILL);
}

TEST_F(DaemonPlans, OfAKilledProcessGoAndLeaveOthersAlone) {
  start(kScene);
  for (const std::string& url : daemon_->urls()) {
    Client client = patient(url);
    Query query;
    query.fields = kFieldLower;
    DeviceQuery plan = client.prepare(query).on_device(0);
    MappedMemory memory(plan.info().memory_handle, plan.info().device_uuid);
    const DeviceColumn& lower = plan.info().column(kFieldLower);
    plan.run();
    const std::uint64_t before = memory.sum(lower.offset, plan.info().rows * lower.row_bytes);
    const Finished doomed =
        run({std::filesystem::read_symlink("/proc/self/exe").string(), "--gtest_filter=DaemonPlans.Doomed"},
            {"CLEARANCE_TEST_DOOMED=" + url});
    ASSERT_EQ(doomed.code, -SIGKILL) << doomed.out << doomed.err;
    while (counter(client, "plans.open") != 1) std::this_thread::yield();
    plan.run();
    EXPECT_EQ(memory.sum(lower.offset, plan.info().rows * lower.row_bytes), before);
  }
}

TEST_F(DaemonPlans, LongOnesDelayNoOthers) {
  start("random: {count: 300, shape: {uv_sphere: {radius: 0.5, resolution: 5}}, box: 40, seed: 4}\n");
  Client client = patient(daemon_->urls()[0]);
  constexpr std::uint32_t kMany = 10'000'000;
  const std::uint32_t body = 7;
  Query query;
  query.bodies = std::span(&body, 1);
  query.reduce = Reduce::kMin;
  query.fields = kFieldLower;
  DeviceQuery plan = client.prepare(query).on_device(kMany);
  {
    MappedMemory memory(plan.info().memory_handle, plan.info().device_uuid);
    std::vector<Pose> poses(kMany);
    for (std::size_t i = 0; i < poses.size(); ++i) poses[i] = Pose{{1e-6 * static_cast<double>(i % 10'000'000), 0, 0}};
    memory.put(plan.info().poses_offset, poses.data(), poses.size() * sizeof(Pose));
  }
  std::atomic<bool> is_over{false};
  std::chrono::nanoseconds took{0};
  std::thread runner([&] {
    took = plan.run().took;
    is_over = true;
  });
  Client other = patient(daemon_->urls()[1]);
  Query small;
  const IdPair pair{1, 2};
  small.pairs = std::span(&pair, 1);
  DeviceQuery own = other.prepare(Query{.fields = kFieldLower}).on_device(0);
  int queries = 0, runs = 0;
  auto longest = std::chrono::nanoseconds(0);
  while (!is_over) {
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(other.distances(small).rows(), 1u);
    queries += !is_over;
    own.run();
    runs += !is_over;
    longest = std::max<std::chrono::nanoseconds>(longest, std::chrono::steady_clock::now() - begin);
  }
  runner.join();
  EXPECT_GT(queries, 2);
  EXPECT_GT(runs, 2);
  std::printf("a plan of %.0f ms: meanwhile %d queries and %d runs of another, the slowest two %.1f ms\n",
              took.count() / 1e6, queries, runs, static_cast<double>(longest.count()) / 1e6);
}

TEST_F(DaemonPlans, AreRejectedByNameOverTcp) {
  start(kScene, {"--zmq", "tcp://127.0.0.1:*"});
  Client client = patient(daemon_->urls()[2]);
  try {
    client.prepare(Query{}).on_device(0);
    FAIL();
  } catch (const RequestError& error) {
    EXPECT_NE(std::string(error.what()).find("over shm:// and ipc://; this client is not one of them"),
              std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace clearance::test
