// clearanced from the user's view: exit codes, output, and files left behind.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <thread>

#include "client/client.h"
#include "tests/patience.h"
#include "tests/server/program_test.h"

namespace clearance {
namespace {

TEST_F(Clearanced, HelpShowsANewcomerWhatToType) {
  const Finished help = clearanced({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_EQ(help.err, "");
  for (const char* part : {"Loads a scene of bodies", "--scene FILE REQUIRED", "Example\n  clearanced --scene",
                           "Exit codes", "3 the scene cannot be loaded", "--ready-fd", "Configuration file"})
    EXPECT_TRUE(contains(help.out, part));
  EXPECT_EQ(clearanced({"--version"}).out.rfind("clearanced 0.", 0), 0u);
}

TEST_F(Clearanced, WrongCommandLinesEndWith2) {
  struct Case {
    std::vector<std::string> options;
    std::string text;
  };
  const Case cases[] = {
      {{}, "clearanced: --scene is required"},
      {{"--scene", scene_, "--threads", "-1"}, "clearanced: --threads: Value -1 not in range 0 to 4096"},
      {{"--scene", scene_, "--frobnicate"}, "clearanced: The following argument was not expected: --frobnicate"},
      {{"--scene", scene_, "--log-level", "loud"}, "clearanced: --log-level: loud not in {"},
      {{"--scene", scene_, "--max-pairs", "5"}, "clearanced: The following arguments were not expected: "},
      {{"--scene", scene_, "--limit", "max-pairs"}, "clearanced: --limit: expected NAME=N, got max-pairs"},
      {{"--scene", scene_, "--limit", "pairs=5"}, "clearanced: --limit: there is no limit \"pairs\""},
      {{"--scene", scene_, "--limit", "max-pairs=-5"}, "clearanced: --limit: max-pairs: expected a number from 1 to "},
      {{"--scene", scene_, "--ready-fd", "99"}, "clearanced: --ready-fd: descriptor 99 is not open"},
      {{"--scene", scene_, "--config", folder_ / "none.toml"},
       "clearanced: " + (folder_ / "none.toml") + " was not readable"},
  };
  for (const Case& c : cases) {
    const Finished finished = clearanced(c.options);
    EXPECT_EQ(finished.code, 2) << finished.err;
    EXPECT_EQ(sentence(finished).rfind(c.text, 0), 0u) << finished.err;
  }
}

TEST_F(Clearanced, WhatIsWrongInAConfigurationFileIsNamedWithItsLine) {
  struct Case {
    std::string text, error;  // of the file; after its name
  };
  const Case cases[] = {
      {"scene = \"x\"\n# a comment\nspeed = 11\n", ":3: there is no option \"speed\""},
      {"scene = \"x\"\nthreads 4\n", ":2: there is no option \"threads 4\""},
      {"scene = \"x\"\n\nthreads = \"many\"\n", ":3: "},
      {"scene = \"x\"\nzmq = [\n  \"a\",\n  \"b\" ]\nlog-level = \"loud\"\n", ":5: --log-level: loud not in {"},
      {"scene = \"x\"\nreal-time = ture\n", ":2: real-time: expected true or false, got ture"},
      {"scene = \"x\nthreads = 1\n", ":1: scene: the text has no end; expected \""},
      {"scene = \"x#y\"\n", ":1: scene: the text has no end; expected \" before #, which begins a comment"},
      {"threads = 1\nzmq = [\"a\",\n\"b\"\nscene = \"x\"\n", ":2: zmq: the list has no end; expected ]"},
      {"scene = \"x\"\nthreads =\n", ":2: threads: expected a value"},
      {"threads = 1\nscene = \"x\"\nthreads = 2\n", ":3: threads is already set in line 1"},
      {"[daemon]\nscene = \"x\"\n", ":1: a section, [daemon]; options stand outside of sections, limits in [limits]"},
      {"scene = \"x\"\n[limits]\nmax-clients = 0\n", ":3: max-clients: expected a number from 1 to 1000000, got 0"},
      {"scene = \"x\"\n[limits]\nmax-clients = 9x\n", ":3: max-clients: expected a number from 1 to 1000000, got 9x"},
      {"scene = \"x\"\n[limits]\nmax-clients = 2\nthreads = 1\n", ":4: there is no limit \"threads\""},
      {"scene = \"x\"\nmax-clients = 2\n", ":2: there is no option \"max-clients\""},
      {"[limits]\nmax-pairs = 1\nmax-pairs = 2\n[default]\nscene = \"x\"\n", ":3: max-pairs is already set in line 2"},
      {"scene = \"x\"\nlimit = \"max-pairs=1\"\n", ":2: limit is for the command line alone"},
      {"scene = \"x\"\nhelp = true\n", ":2: help is for the command line alone"},
  };
  for (const Case& c : cases) {
    const std::string file = folder_.write("bad.toml", c.text);
    const Finished finished = clearanced({"--config", file});
    EXPECT_EQ(finished.code, 2) << c.text << finished.err;
    EXPECT_TRUE(sentence(finished).starts_with("clearanced: " + file + c.error)) << c.text << finished.err;
  }
  const Finished line = clearanced({"--config", folder_.write("good.toml", "threads = 1\n"), "--threads", "-1"});
  EXPECT_EQ(sentence(line), "clearanced: --threads: Value -1 not in range 0 to 4096") << "of the command line";
}

// Clients run in other folders.
TEST_F(Clearanced, ServesRelativePathsAsAbsoluteOnes) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(std::filesystem::path(folder_ / "c.ipc").parent_path());
  Daemon daemon({"--scene", scene_, "--shm", "./rel.sock", "--metrics", "metrics.sock"});
  std::filesystem::current_path(before);
  EXPECT_EQ(daemon.url(), "shm://" + (folder_ / "rel.sock"));
  EXPECT_EQ(patient(daemon.url()).scene().bodies.size(), 4u);
  EXPECT_TRUE(contains(daemon.log(), "event=metrics url=unix:" + (folder_ / "metrics.sock"))) << daemon.log();
  for (const char* number : {"9100", "127.0.0.1", "localhost", "localhost:9100"}) {
    const Finished finished = clearanced({"--scene", scene_, "--zmq", ipc_, "--metrics", number});
    EXPECT_TRUE(contains(finished.err, "expected 127.0.0.1:PORT, [::1]:PORT or the path of a Unix socket"))
        << finished.err;
  }
}

TEST_F(Clearanced, ServesAUrdfAndLogsWhatIsSuspicious) {
  const std::string urdf = folder_.write(
      "arm.urdf",
      "<robot name='panda'><link name='a'/><link name='b'><collision><geometry><sphere radius='1'/></geometry>"
      "</collision></link>\n<joint name='j' type='revolute'><parent link='a'/><child link='b'/><limit "
      "effort='1'/></joint>"
      "</robot>");
  const Daemon daemon({"--scene", urdf, "--zmq", ipc_});
  std::vector<std::string> names;
  const auto scene = patient(ipc_).scene();
  for (const auto& body : scene.bodies) names.push_back(body.name);
  EXPECT_EQ(names, (std::vector<std::string>{"panda", "panda/a", "panda/b"}));
  EXPECT_TRUE(contains(daemon.log(), "arm.urdf:2: joint")) << daemon.log();
  const std::string yaml = folder_.write("s.yaml", "bodies:\n  - {name: a, box: 1, pose: [0, 0, 0, 0, 0, 0, 1]}\n");
  const Daemon other({"--scene", yaml, "--zmq", "tcp://127.0.0.1:*"});
  EXPECT_TRUE(contains(other.log(), "event=scene_suspicious text=\"" + yaml + ":2: bodies[0].pose: ")) << other.log();
}

TEST_F(Clearanced, ABadSceneEndsWith3AndItsSentence) {
  const Finished missing = clearanced({"--scene", folder_ / "none.yaml"});
  EXPECT_EQ(missing.code, 3);
  EXPECT_EQ(sentence(missing), "clearanced: " + (folder_ / "none.yaml") + ": No such file or directory");
  const std::string wrong = folder_.write("wrong.yaml", "bodies:\n  - {name: cup, sphere: -1}\n");
  const Finished bad = clearanced({"--scene", wrong});
  EXPECT_EQ(bad.code, 3);
  EXPECT_TRUE(contains(sentence(bad), "clearanced: " + wrong + ":2: bodies[0]"));
}

TEST_F(Clearanced, AnUnknownBackendEndsWith5BeforeTheSceneIsLoaded) {
  const Finished unknown = clearanced({"--scene", folder_ / "none.yaml", "--backend", "quantum"});
  EXPECT_EQ(unknown.code, 5);
  EXPECT_EQ(sentence(unknown), "clearanced: backend: expected auto, cpu, cuda or reference, got 'quantum'");
  const Finished no_gpu = clearanced({"--scene", folder_ / "none.yaml", "--devices", "0,77"});
  EXPECT_EQ(no_gpu.code, 5);
  EXPECT_TRUE(sentence(no_gpu).starts_with("clearanced: devices: ")) << sentence(no_gpu);
  EXPECT_TRUE(contains(sentence(no_gpu), " is not there")) << sentence(no_gpu);
  const Finished word = clearanced({"--scene", folder_ / "none.yaml", "--devices", "all"});
  EXPECT_EQ(word.code, 2);
  EXPECT_TRUE(contains(word.err, "--devices")) << word.err;
}

TEST_F(Clearanced, AnEndpointThatCannotBeOpenedEndsWith4) {
  const std::string file = folder_.write("a-file", ""), none = folder_ / "none";
  struct Case {
    std::string endpoint, text;
  };
  const Case cases[] = {
      {"tcp://0.0.0.0:5555", "tcp://0.0.0.0:5555: anyone who reaches this address could move bodies"},
      {"tcp://*:5555", "tcp://*:5555: anyone who reaches this address could move bodies"},
      {"tcp://127.0.0.1", "tcp://127.0.0.1: the port is missing"},
      {"tcp://127.0.0.1:99999",
       "tcp://127.0.0.1:99999: the port must be 1 to 65535, or * for a free one; got \"99999\""},
      {"ipc://relative.ipc", "ipc://relative.ipc: the path of the socket must be absolute"},
      {"ipc://@name", "ipc://@name: the path of the socket must be absolute"},
      {"ipc://" + none + "/c.ipc", "ipc://" + none + "/c.ipc: there is no folder " + none},
      {"ipc://" + file, "ipc://" + file + ": the path is taken by something that is not a socket"},
      {"ipc:///" + std::string(200, 'x'), "ipc:///" + std::string(200, 'x') + ": a socket's path may have 107 bytes"},
      {"inproc://x", "inproc://x: expected ipc:///path or tcp://127.0.0.1:PORT"},
  };
  for (const Case& c : cases) {
    const Finished finished = clearanced({"--scene", scene_, "--zmq", c.endpoint});
    EXPECT_EQ(finished.code, 4) << finished.err;
    EXPECT_EQ(sentence(finished).rfind("clearanced: " + c.text, 0), 0u) << finished.err;
  }
}

TEST_F(Clearanced, SignalsEndItCleanly) {
  for (const int signal : {SIGTERM, SIGINT}) {
    Daemon daemon({"--scene", scene_, "--zmq", ipc_});
    EXPECT_EQ(daemon.url(), ipc_);
    struct stat info{};
    ASSERT_EQ(stat((folder_ / "c.ipc").c_str(), &info), 0);
    EXPECT_EQ(info.st_mode & 0077, 0u) << "nobody else may connect";
    EXPECT_EQ(patient(ipc_).scene().bodies.size(), 4u);
    EXPECT_EQ(daemon.stop(signal), 0);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "c.ipc"));
    EXPECT_TRUE(contains(daemon.log(), "event=end signal=" + std::to_string(signal)));
  }
}

TEST_F(Clearanced, ASignalEndsItWhateverItWorksOn) {
  // Hours of work: waiting for its end, or for the end of its listing, would never return.
  const std::string scene = folder_.write(
      "many.yaml", "random: {count: 300, shape: {uv_sphere: {radius: 2, resolution: 5}}, box: 1, seed: 1}\n");
  const std::string shm = "shm://" + (folder_ / "c.shm");
  Daemon daemon({"--scene", scene, "--shm", folder_ / "c.shm"});
  Client client = patient(shm), other = patient(shm);
  Query query;
  query.reduce = Reduce::kMin;
  query.signed_distance = true;
  const std::vector<std::uint32_t> bodies{0};
  const std::vector<IdPair> pairs{{kEveryBody, kEveryBody}};
  query.bodies = bodies;
  query.pairs = pairs;
  query.all_pairs = false;
  const std::vector<Pose7> configurations(4000, Pose7{0, 0, 0, 1, 0, 0, 0});
  query.configurations = configurations;
  std::thread asking([&] { EXPECT_THROW(client.distances(query), std::exception); });
  const auto waiting = [&] {
    for (const auto& [name, value] : other.stats())
      if (name == "queries.waiting") return value;
    return std::uint64_t{0};
  };
  while (waiting() == 0) std::this_thread::yield();
  EXPECT_EQ(daemon.stop(SIGTERM), 0);
  EXPECT_TRUE(contains(daemon.log(), "event=end signal=15"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c.shm"));
  asking.join();
}

TEST_F(Clearanced, LogSaysWhenAndWhereItServes) {
  Daemon daemon({"--scene", scene_, "--zmq", ipc_});
  const std::string log = daemon.log();
  EXPECT_TRUE(
      contains(log, "level=info event=scene_loaded scene=\"" + scene_ + "\" bodies=4 pieces=4 vertices=13 revision="));
  EXPECT_TRUE(contains(log, "event=ready urls=\"" + ipc_ + "\" load_seconds="));
}

TEST_F(Clearanced, LogWarnsOfMeshesThatAreFarFromConvex) {
  std::string obj;
  for (const int x : {0, 10})
    for (const char* corner : {"0 0 0", "1 0 0", "0 1 0", "0 0 1"})
      obj += "v " + std::to_string(x + (corner[0] - '0')) + (corner + 1) + "\n";
  for (const int first : {1, 5})
    for (const auto& [a, b, c] : {std::array{0, 2, 1}, std::array{0, 1, 3}, std::array{1, 2, 3}, std::array{0, 3, 2}})
      obj +=
          "f " + std::to_string(first + a) + " " + std::to_string(first + b) + " " + std::to_string(first + c) + "\n";
  folder_.write("apart.obj", obj);
  const std::string scene = folder_.write("apart.yaml",
                                          "bodies: [{name: apart, mesh: apart.obj, mesh_as: hull}, "
                                          "{name: again, mesh: apart.obj, mesh_as: hull}, {name: box, box: 1}]\n");
  Daemon daemon({"--scene", scene, "--zmq", ipc_});
  const std::string log = daemon.log(),
                    event = "level=warning event=mesh_suspicious body=\"apart\" more=1 hull_excess_m=";
  ASSERT_TRUE(contains(log, event));
  EXPECT_EQ(log.find("mesh_suspicious", log.find(event) + event.size()), std::string::npos) << "once for each mesh";
  const auto bodies = connect(ipc_).scene().bodies;
  EXPECT_GT(bodies[0].hull_excess, 4);
  EXPECT_LT(bodies[0].hull_excess, 6);
  EXPECT_GT(bodies[0].empty_share, 0.9);
  EXPECT_EQ(bodies[2].hull_excess, 0);
}

TEST_F(Clearanced, AnOpenMeshThatIsAddedIsLoggedWithAnEdge) {
  Daemon daemon({"--scene", scene_, "--zmq", ipc_});
  Client client = connect(ipc_);
  const std::array<std::array<double, 3>, 4> corners{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  const std::array<std::array<std::uint32_t, 3>, 4> faces{{{0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 2, 1}}};
  NewBody closed, open;
  closed.name = "closed", open.name = "open";
  closed.vertices = open.vertices = corners;
  closed.triangles = faces;
  open.triangles = std::span(faces).first(3);
  client.add_body(closed);
  client.add_body(open);
  const std::string log = daemon.log();
  EXPECT_FALSE(contains(log, "event=mesh_suspicious body=\"closed\""));
  ASSERT_TRUE(contains(log, "level=warning event=mesh_suspicious body=\"open\" more=0 "));
  EXPECT_TRUE(contains(log,
                       "mesh (hull) encloses nothing: the edge from (0, 0, 0) to (1, 0, 0) of triangle 0 belongs to no "
                       "other triangle: the mesh is open there; mesh_as: surface uses its triangles as they are"));
}

TEST_F(Clearanced, TheSocketOfALivingDaemonIsRejectedThatOfADeadOneReplaced) {
  Daemon first({"--scene", scene_, "--zmq", ipc_});
  const Finished second = clearanced({"--scene", scene_, "--zmq", ipc_});
  EXPECT_EQ(second.code, 4);
  EXPECT_EQ(sentence(second),
            "clearanced: " + ipc_ + ": another process listens there; stop it, or choose another path");
  EXPECT_EQ(patient(ipc_).scene().bodies.size(), 4u) << "the first one still serves";
  first.stop(SIGKILL);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "c.ipc"));
  Daemon third({"--scene", scene_, "--zmq", ipc_});
  EXPECT_EQ(patient(ipc_).scene().bodies.size(), 4u);
  EXPECT_EQ(third.stop(SIGTERM), 0);
}

TEST_F(Clearanced, ReadsItsConfigurationFile) {
  const std::string config = folder_.write("c.toml", "\xEF\xBB\xBFscene = \"" + scene_ + "\"\nzmq = [\n  \"" + ipc_ +
                                                         "\",  # ours\n  \"tcp://127.0.0.1:*\"]\n");
  Daemon daemon({"--config", config});
  ASSERT_EQ(daemon.urls().size(), 2u);
  EXPECT_EQ(daemon.urls()[0], ipc_);
  EXPECT_EQ(daemon.urls()[1].rfind("tcp://127.0.0.1:", 0), 0u) << "with the port that was free";
  EXPECT_EQ(patient(daemon.urls()[1]).scene().bodies.size(), 4u);
}

TEST_F(Clearanced, TakesLimitsFromItsFileAndThenFromItsCommandLine) {
  const std::string config =
      folder_.write("c.toml", "[limits]\nmax-added-bodies = 0\nmax-pairs = 11\n[default]\nscene = \"" + scene_ +
                                  "\"\nzmq = [\"" + ipc_ + "\"]\n");
  Daemon daemon({"--config", config, "--limit", "max-pairs=5"});
  const auto rejected = [](auto call) -> std::string {
    try {
      call();
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  };
  Client client = patient(ipc_);
  const std::string pairs = rejected([&] { client.distances(Query{}); });
  EXPECT_TRUE(contains(pairs, "the 5 that one query may have (limit max-pairs)")) << pairs;
  const std::string added = rejected([&] { client.add_body({.name = "ball", .sphere = 0.1}); });
  EXPECT_TRUE(contains(added, "(limit max-added-bodies)")) << added;
}

TEST_F(Clearanced, NotifiesSystemd) {
  const std::string path = folder_ / "notify";
  const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  Daemon daemon({"--scene", scene_, "--zmq", ipc_});
  unsetenv("NOTIFY_SOCKET");
  const auto next = [&] {
    char text[1000];
    const ssize_t size = recv(socket, text, sizeof text, 0);
    return std::string(text, static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  };
  EXPECT_EQ(next(), "READY=1\nSTATUS=serving " + scene_ + " at " + ipc_);
  daemon.stop(SIGTERM);
  EXPECT_EQ(next(), "STOPPING=1");
  close(socket);
}

TEST_F(Clearanced, ItsLoopFeedsAWatchdog) {
  const int socket = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const std::string path = folder_ / "watchdog";
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const timeval patience{kPatience.count(), 0};
  setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  const auto next = [&] {
    char text[1000];
    const ssize_t size = recv(socket, text, sizeof text, 0);
    return std::string(text, static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  };
  Daemon daemon({"--scene", scene_, "--zmq", ipc_}, {"NOTIFY_SOCKET=" + path, "WATCHDOG_USEC=400000"});
  EXPECT_EQ(next().substr(0, 8), "READY=1\n");
  for (int i = 0; i < 3; ++i) EXPECT_EQ(next(), "WATCHDOG=1");
  daemon.stop(SIGTERM);
  close(socket);
}

TEST_F(Clearanced, IsQuietWhileNoQueryArrives) {
  Daemon daemon({"--scene", scene_, "--zmq", ipc_});
  Client client = patient(ipc_);
  const auto sleeps = [&] {
    for (const auto& [name, value] : client.stats())
      if (name == "loop.sleeps") return value;
    return std::uint64_t{0};
  };
  // Only the tick every 100 ms and the request itself wake it, not thousands of times.
  const std::uint64_t before = sleeps();
  const auto begin = std::chrono::steady_clock::now();
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const double halves = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / 0.5;
  EXPECT_LT(static_cast<double>(sleeps() - before), 100 * halves + 100)
      << "the answer itself may have been long in coming";
}

}  // namespace
}  // namespace clearance
