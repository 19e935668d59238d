// The process clearanced on an LCM network: the example planners as a user runs them, with the same bits as over
// ZeroMQ.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <thread>

#include "client/client.h"
#include "tests/lcm/lcm_fixture.h"
#include "tests/server/daemon_fixture.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

const std::string kExamples = source_file("client/examples/");
const std::string kPlannerCpp = std::string(CLEARANCE_BINARY_DIR) + "/examples/lcm_planner";
const std::vector<std::string> kPythonPath{"PYTHONPATH=" CLEARANCE_BINARY_DIR "/python"};

/// One line of the table that a planner prints.
struct Line {
  int configuration = -1;
  std::string pair, status;
  double distance = NAN, lower = NAN, upper = NAN;
};

std::vector<Line> table_of(const std::string& out) {
  std::vector<Line> lines;
  std::istringstream all(out);
  for (std::string text; std::getline(all, text);) {
    std::istringstream words(text);
    Line line;
    std::string a, dash, b;
    if (words >> line.configuration >> a >> dash >> b >> line.distance >> line.lower >> line.upper >> line.status) {
      line.pair = a + " - " + b;
      lines.push_back(line);
    }
  }
  return lines;
}

class LcmDaemonTest : public LcmTest {
 protected:
  std::string scene_file() const { return folder_.write("scene.yaml", kSmallSceneYaml); }
  TestFolder folder_;
};

/// The planners query cup on a circle of 0.5 m about (0, 0, 0.3). Of the small scene's other bodies the planner has
/// moved link2 to x = 3; the table's top is at z = 0.05, the capsule link1 is at x = 0.5.
void expect_circle(const Finished& planner, int count) {
  ASSERT_EQ(planner.code, 0) << planner.out << planner.err;
  const auto lines = table_of(planner.out);
  ASSERT_EQ(lines.size(), static_cast<std::size_t>(count)) << planner.out;
  int near_link = 0, near_table = 0;
  for (int k = 0; k < count; ++k) {
    const Line& line = lines[k];
    EXPECT_EQ(line.configuration, k);
    const double a = 2 * M_PI * k / count, x = 0.5 * std::cos(a), y = 0.5 * std::sin(a);
    // The sphere (0.1) above the table (2 x 1, top at 0.05) and next to the capsule: axis z from 0.3 to 0.7, radius
    // 0.05.
    const double to_table = std::hypot(std::max(0.0, std::abs(x) - 1), std::max(0.0, std::abs(y) - 0.5), 0.25) - 0.1;
    const double to_link = std::hypot(x - 0.5, y) - 0.15;
    const double expected = std::min(to_table, to_link);
    if (expected > 0) {
      EXPECT_NEAR(line.distance, expected, 2e-6) << k;
      EXPECT_EQ(line.status, "ok");
    } else {
      EXPECT_EQ(line.status, "overlap");
    }
    EXPECT_LE(line.lower, line.upper);
    const bool link = to_link < to_table;
    EXPECT_EQ(line.pair, link ? "cup - link1" : "table - cup") << k;
    ++(link ? near_link : near_table);
  }
  EXPECT_GT(near_link, 0);
  EXPECT_GT(near_table, 0);
}

TEST_F(LcmDaemonTest, PlannerInPython) {
  Daemon daemon({"--scene", scene_file(), "--lcm", url()});
  EXPECT_EQ(daemon.url(), url());
  expect_circle(
      run({CLEARANCE_PYTHON, kExamples + "lcm_planner.py", "--url", url(), "--configurations", "16"}, kPythonPath), 16);
  EXPECT_EQ(daemon.stop(SIGTERM), 0) << daemon.log();
}

TEST_F(LcmDaemonTest, PlannerInCpp) {
  Daemon daemon({"--scene", scene_file(), "--lcm", url("&prefix=cell/")});
  expect_circle(run({kPlannerCpp, url(), "cell/", "16"}), 16);
  const Finished nobody = run({kPlannerCpp, url(), "other/"});
  EXPECT_EQ(nobody.code, 1);
  EXPECT_EQ(nobody.err, "lcm_planner: the scene did not come within 5 s; is clearanced running with this --lcm url?\n");
}

TEST_F(LcmDaemonTest, PlannersTakeNoAnswerOfOtherPosesThanTheirs) {
  Daemon daemon({"--scene", scene_file(), "--lcm", url(), "--lcm-poses", "off"});  // so that theirs never arrive
  for (const Finished& planner : {run({CLEARANCE_PYTHON, kExamples + "lcm_planner.py", "--url", url()}, kPythonPath),
                                  run({kPlannerCpp, url()})}) {
    EXPECT_EQ(planner.code, 1) << planner.out;
    EXPECT_EQ(planner.err.find("lcm_planner: the daemon rejected the query: no poses with stamp "), 0u) << planner.err;
    EXPECT_NE(planner.err.find(" or newer came within 500.000000 ms"), std::string::npos) << planner.err;
  }
}

TEST_F(LcmDaemonTest, PlannerInJointSpace) {
  std::ifstream urdf(source_file("tests/engine/robot/arm.urdf"));
  folder_.write("arm.urdf", {std::istreambuf_iterator<char>(urdf), {}});
  const std::string scene = folder_.write("arm.yaml",
                                          "bodies: [{name: table, box: [1, 1, 0.1], static: true}]\n"
                                          "robots: [{name: arm, urdf: arm.urdf, home: {joint4: -1.5}}]\n");
  Daemon daemon({"--scene", scene, "--lcm", url()});
  const Finished planner = run({CLEARANCE_PYTHON, kExamples + "lcm_joint_planner.py", "--url", url(), "--joint",
                                "arm/joint2=0,1.7", "--joint", "arm/joint4=-1.5,-0.1", "--steps", "40"},
                               kPythonPath);
  ASSERT_EQ(planner.code, 0) << planner.out << planner.err;
  const auto lines = table_of(planner.out);
  ASSERT_EQ(lines.size(), 40u) << planner.out;
  for (int k = 0; k < 40; ++k) {
    EXPECT_EQ(lines[k].configuration, k);
    EXPECT_LE(lines[k].lower, lines[k].upper);
    EXPECT_TRUE(lines[k].status == "ok" || lines[k].status == "overlap") << lines[k].status;
  }
  const Finished wrong = run(
      {CLEARANCE_PYTHON, kExamples + "lcm_joint_planner.py", "--url", url(), "--joint", "arm/joint9=0,1"}, kPythonPath);
  EXPECT_EQ(wrong.code, 1);
  EXPECT_NE(wrong.err.find("joints[0]: there is no joint 'arm/joint9'"), std::string::npos) << wrong.err;
}

TEST_F(LcmDaemonTest, ManyConfigurationsOverLcmAlone) {
  Daemon daemon({"--scene", scene_file(), "--lcm", url()});
  expect_circle(
      run({CLEARANCE_PYTHON, kExamples + "lcm_planner.py", "--url", url(), "--configurations", "600"}, kPythonPath),
      600);
}

TEST_F(LcmDaemonTest, BeyondThisMachineAProcessOutsideReadsThePackets) {
  LcmAddress address = *own_lcm_address("far");
  address.ttl = 1;
  const std::string ipc = "ipc://" + (folder_ / "socket");
  Daemon daemon({"--scene", scene_file(), "--lcm", address.url(), "--zmq", ipc});
  Client over_zmq = patient(ipc);
  const auto counter = [&](const std::string& name) {
    for (const auto& [known, value] : over_zmq.stats())
      if (known == name) return value;
    return std::uint64_t{0};
  };
  const auto requested = [&] {  // repeated, because packets are lost while that process is gone
    for (;;) try {
        return connect(address.url(), std::chrono::seconds(2)).distances().rows();
      } catch (const ConnectionError&) {  // or TimeoutError
      }
  };
  EXPECT_EQ(requested(), 6u);
  while (counter("gateway.memory_bytes") == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(counter("gateway.restarts"), 0u);
  for (const auto& task : std::filesystem::directory_iterator("/proc")) {
    std::ifstream in(task.path() / "stat");
    std::string pid, command, state;
    int parent = 0;
    if (in >> pid >> command >> state >> parent && parent == daemon.pid()) kill(std::stoi(pid), SIGKILL);
  }
  while (counter("gateway.restarts") < 1) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(requested(), 6u);
}

TEST_F(LcmDaemonTest, PublisherMovesAllBodiesAndEverySnapshotIsTheSameOnEachTransport) {
  const std::string ipc = "ipc://" + (folder_ / "socket");
  Daemon daemon({"--scene", scene_file(), "--lcm", url(), "--zmq", ipc});
  Client over_lcm = connect(url(), kPatience), over_zmq = patient(ipc);
  const std::uint64_t first = over_zmq.distances().snapshot_revision();
  std::set<std::uint64_t> compared;
  std::atomic<bool> enough{false};
  std::thread publisher([&] {
    while (!enough) {  // a busy machine may need more than one run
      const Finished done =
          run({CLEARANCE_PYTHON, kExamples + "pose_publisher.py", "--url", url(), "--rate", "50", "--seconds", "3"},
              kPythonPath);
      EXPECT_EQ(done.code, 0) << done.err;
      EXPECT_NE(done.out.find("moving 3 of 4 bodies"), std::string::npos) << done.out;
    }
  });
  // Queries over both transports while the bodies move; answers at one pose revision must have the same bits.
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (compared.size() < 10 && std::chrono::steady_clock::now() < end) {
    const Result a = patiently(over_lcm, [&] { return over_lcm.distances(); }), b = over_zmq.distances();
    if (a.snapshot_revision() != b.snapshot_revision() || a.snapshot_revision() == first) continue;
    compared.insert(a.snapshot_revision());
    EXPECT_EQ(a.rows(), 6u);
    if (a.rows() != 6) break;
    for (const auto column : {&Result::distance, &Result::lower, &Result::upper}) {
      EXPECT_EQ(std::memcmp((a.*column)().data(), (b.*column)().data(), 6 * sizeof(double)), 0);
    }
    for (std::size_t i = 0; i < 6; ++i) EXPECT_NE(a.status()[i], Status::kNoPose);  // link2 had none until now
  }
  enough = true;
  publisher.join();
  EXPECT_EQ(compared.size(), 10u);
}

TEST_F(LcmDaemonTest, WithoutAMulticastRouteItReportsItAndEnds) {
  if (run({"/bin/sh", "-c", "unshare -n true"}).code != 0) GTEST_SKIP() << "this user may not make a network namespace";
  const Finished daemon = run({"/bin/sh", "-c", "exec unshare -n \"$0\" --scene \"$1\" --lcm \"$2\"",
                               program("clearanced"), scene_file(), url()});
  EXPECT_EQ(daemon.code, 4);
  EXPECT_NE(daemon.err.find(
                "LCM: no multicast route to 239.255.76.67: cannot send there (Network is unreachable); to keep LCM "
                "on this host, run (as root):  ip link set lo up; ip route add 239.255.76.67/32 dev lo"),
            std::string::npos)
      << daemon.err;
  const Finished wrong = run({program("clearanced"), "--scene", scene_file(), "--lcm", "udpm://127.0.0.1:7667"});
  EXPECT_EQ(wrong.code, 4);
  EXPECT_NE(wrong.err.find("group: expected a multicast address"), std::string::npos) << wrong.err;
}

TEST_F(LcmDaemonTest, WhereNotEveryPoseIsTakenClientsMayQueryAlone) {
  for (const std::string how : {"on", "off", "arm"}) {
    Daemon daemon({"--scene", scene_file(), "--lcm", url(), "--lcm-poses", how});
    Client client = connect(url(), kPatience);
    EXPECT_EQ(patiently(client, [&] { return client.scene().bodies.size(); }), 4u);
    const auto rejected = [&](auto call) -> std::string {
      try {
        patiently(client, call);
        return "";
      } catch (const RequestError& error) {
        return error.what();
      }
    };
    const std::string has = how == "on" ? "query,poses" : "query";
    EXPECT_EQ(rejected([&] { client.reload(); }), "kReload needs the right \"admin\"; this client has " + has);
    EXPECT_EQ(rejected([&] { client.set_poses({{"cup", {0, 0, 0.5, 1, 0, 0, 0}}}); }),
              how == "on" ? "" : "kSetPoses needs the right \"poses\"; this client has query");
    EXPECT_EQ(rejected([&] { client.attach(1, 2); }),
              how == "on" ? "" : "kAttach needs the right \"poses\"; this client has query");
  }
}

TEST_F(LcmDaemonTest, PosesOfWhatTheSceneHasNotEndWith2) {
  for (const std::vector<std::string>& whose : {std::vector<std::string>{"cups"}, {"cup", "cups"}, {"cups", "off"}}) {
    std::vector<std::string> options{program("clearanced"), "--scene", scene_file(), "--lcm", url()};
    for (const std::string& name : whose) options.insert(options.end(), {"--lcm-poses", name});
    const Finished ended = run(options);
    EXPECT_EQ(ended.code, 2);
    EXPECT_NE(ended.err.find("--lcm-poses: the scene has no body or group \"cups\""), std::string::npos) << ended.err;
  }
}

TEST_F(LcmDaemonTest, AControlLoopCountsItsCycles) {
  const Daemon daemon({"--scene", scene_file(), "--shm", folder_ / "c.sock", "--lcm", url()});
  const Finished done = run({program("clearance"), "bench", "loop", "--connect", daemon.urls().at(0), "--lcm", url(),
                             "--pairs", "1", "--minutes", "0.01", "--rate", "500", "--csv", folder_ / "loop.csv"});
  ASSERT_EQ(done.code, 0) << done.err;
  std::uint64_t working[2] = {}, idle[2] = {};
  std::istringstream lines(done.out);
  for (std::string line; std::getline(lines, line);) {
    std::sscanf(line.c_str(), "poses out, distances back %lu %lu", &working[0], &working[1]);
    std::sscanf(line.c_str(), "idle, by turns %lu %lu", &idle[0], &idle[1]);
  }
  EXPECT_EQ(working[0], 300u) << "0.6 s at 500 Hz, those that were missed among them\n" << done.out;
  EXPECT_EQ(idle[0], 75u) << "a quarter of it";
  EXPECT_LE(working[1], working[0]);
  std::uint64_t messages = 0;
  Client client = patient(daemon.urls().at(0));
  for (const auto& [name, value] : client.stats())
    if (name == "lcm.pose_messages") messages = value;
  EXPECT_GT(messages, 0u);
}

}  // namespace
}  // namespace clearance
