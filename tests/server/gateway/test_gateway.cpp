// Unauthenticated peers at TCP endpoints, and the gateway process that handles them: however it ends, clients in shared
// memory are served throughout, and those over TCP again afterwards.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>
#include <zmq.hpp>

#include "client/client.h"
#include "tests/patience.h"
#include "tests/server/daemon_fixture.h"
#include "tests/server/gateway/raw_tcp.h"
#include "wire/key_file.h"
#include "wire/protocol.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// A value of /proc/PID/status, in KiB.
std::uint64_t status_kib(int pid, const std::string& name) {
  std::ifstream in("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(in, line);)
    if (line.starts_with(name + ":")) return std::stoull(line.substr(name.size() + 1));
  return 0;
}

/// The single child of a process with this name, or 0 if there is none.
int child_of(int parent, const std::string& name) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string pid = entry.path().filename();
    if (pid.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream in(entry.path() / "stat");
    std::string number, command, state;
    int its_parent = 0;
    if (in >> number >> command >> state >> its_parent && its_parent == parent && command == "(" + name + ")" &&
        state != "Z")
      return std::stoi(pid);
  }
  return 0;
}

/// A client in shared memory that sends queries continuously.
class Busy {
 public:
  explicit Busy(const std::string& url)
      : thread_([this, url] {
          Client client = patient(url);
          while (!stop_) {
            const Result reply = client.distances();
            rows_ = reply.rows();
            ++answers_;
          }
        }) {}
  ~Busy() {
    stop_ = true;
    thread_.join();
  }
  /// Waits for further answers, to queries that are sent from now on.
  void expect_answers() const {
    const std::uint64_t before = answers_;
    while (answers_ < before + 3) std::this_thread::sleep_for(1ms);
    EXPECT_EQ(rows_, 6u);
  }

 private:
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> answers_{0}, rows_{0};
  std::thread thread_;
};

class Gateway : public testing::Test {
 protected:
  static constexpr const char* kName = "clearance-gatew";  // as truncated by the kernel

  void start(const std::vector<std::string>& more, const std::vector<std::string>& environment = {}) {
    std::vector<std::string> options{"--scene",   folder_.write("scene.yaml", kSmallSceneYaml),
                                     "--shm",     folder_ / "c.sock",
                                     "--zmq",     "tcp://127.0.0.1:*",
                                     "--threads", "1"};
    options.insert(options.end(), more.begin(), more.end());
    daemon_ = std::make_unique<Daemon>(options, environment);
  }
  const std::string& shm() const { return daemon_->urls()[0]; }
  const std::string& tcp() const { return daemon_->urls()[1]; }
  std::uint64_t counter(const std::string& name) const {
    Client client = patient(shm());
    for (const auto& [known, value] : client.stats())
      if (known == name) return value;
    return 0;
  }
  void wait_for(const std::string& name, std::uint64_t value) const {
    while (counter(name) < value) std::this_thread::sleep_for(1ms);
  }
  /// Reconnects, as often as necessary, and sends a query. Returns the time taken.
  std::chrono::milliseconds served_again(const ConnectOptions& options = {}) const {
    const auto begin = Clock::now();
    for (;;) try {
        ConnectOptions once = options;
        once.timeout = 20s;
        Client client = connect(tcp(), once);
        EXPECT_EQ(client.distances().rows(), 6u);
        return std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begin);
      } catch (const ConnectionError&) {
        std::this_thread::sleep_for(1ms);
      }
  }
  void report(const char* what, std::chrono::milliseconds took) {
    RecordProperty(what, static_cast<int>(took.count()));
    std::printf("[ figure   ] %s: %d ms\n", what, static_cast<int>(took.count()));
  }
  void expect_core_unharmed(std::uint64_t high_water_before_kib) const {
    EXPECT_LT(status_kib(daemon_->pid(), "VmHWM"), high_water_before_kib + 64 * 1024) << "the core's memory, KiB";
  }
  std::uint64_t high_water_kib() const { return status_kib(daemon_->pid(), "VmHWM"); }

  TestFolder folder_;
  std::unique_ptr<Daemon> daemon_;
};

TEST_F(Gateway, PartsThatNeverEndAreAffairsOfItsMemoryAndNotOfTheCores) {
  start({"--limit", "gateway-mib=128"});
  const Busy busy(shm());
  busy.expect_answers();
  const std::uint64_t before = high_water_kib();
  RawTcp peer(tcp());
  ASSERT_TRUE(peer.send(RawTcp::handshake()));
  const std::string part = RawTcp::head(1, 1 << 20) + std::string(1 << 20, 'x');
  std::uint64_t sent = 0;
  while (peer.send(part)) ASSERT_LT(++sent, 200u) << "MiB in one message, and nothing happens";
  EXPECT_GT(sent, 16u);
  // libzmq drops the connection or, if another one found no memory, its process ends.
  report("after parts that never end, until served over TCP", served_again());
  busy.expect_answers();
  expect_core_unharmed(before);
}

TEST_F(Gateway, AMessageOfFourMillionPartsEndsItAndNotTheCore) {
  start({});
  const Busy busy(shm());
  busy.expect_answers();
  const std::uint64_t before = high_water_kib();
  RawTcp peer(tcp());
  ASSERT_TRUE(peer.send(RawTcp::handshake()));
  std::string parts;
  for (int i = 0; i < 4'000'000; ++i) parts += std::string_view("\1\0", 2);
  peer.send(parts + std::string(2, '\0'));  // the last one: flags 0, no bytes
  wait_for("gateway.restarts", 1);
  report("after a message of 4 M parts, until served over TCP", served_again());
  busy.expect_answers();
  expect_core_unharmed(before);
  EXPECT_NE(daemon_->log().find("a message has too many parts"), std::string::npos) << daemon_->log();
}

TEST_F(Gateway, KilledItIsThereAgainAndTheEpochIsTheSame) {
  start({});
  Client client = patient(tcp());
  const auto epoch = client.epoch();
  ASSERT_EQ(client.distances().rows(), 6u);
  for (int round = 1; round <= 3; ++round) {
    const int pid = child_of(daemon_->pid(), kName);
    ASSERT_GT(pid, 0);
    kill(pid, SIGKILL);
    wait_for("gateway.restarts", static_cast<std::uint64_t>(round));
    EXPECT_THROW(client.distances(), ConnectionError) << "its connection went with that process";
    report("after it was killed, until served over TCP", served_again());
    EXPECT_EQ(client.distances().rows(), 6u) << "the same client, which need not acknowledge anything";
    EXPECT_EQ(client.epoch(), epoch);
  }
  wait_for("gateway.memory_bytes", 1 << 20);
  EXPECT_LT(counter("gateway.memory_bytes"), 200u << 20);
}

TEST_F(Gateway, FrozenItIsEndedAndReplaced) {
  start({});
  const int pid = child_of(daemon_->pid(), kName);
  ASSERT_GT(pid, 0);
  kill(pid, SIGSTOP);
  wait_for("gateway.restarts", 1);
  served_again();
  EXPECT_NE(daemon_->log().find("it hangs"), std::string::npos) << daemon_->log();
}

TEST_F(Gateway, ItEndsWithTheCore) {
  start({});
  const int pid = child_of(daemon_->pid(), kName);
  ASSERT_GT(pid, 0);
  daemon_->stop(SIGKILL);
  while (kill(pid, 0) == 0 && status_kib(pid, "VmSize") > 0) std::this_thread::sleep_for(1ms);
}

TEST_F(Gateway, ARequestOrReplyBeyondItsShareOfMemoryIsRejected) {
  start({"--limit", "gateway-mib=64"});  // an eighth: 8 MiB
  Client client = patient(tcp());
  Query query;
  query.fields = kDefaultFields | kFieldPoints | kFieldNormal;
  std::vector<std::uint32_t> bodies{1};
  std::vector<Pose7> poses(40'000, Pose7{0, 0, 1, 1, 0, 0, 0});
  query.bodies = bodies;
  query.configurations = poses;
  try {
    client.distances(query);
    FAIL() << "a reply of more than 8 MiB";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge)) << error.what();
  }
  EXPECT_EQ(patient(shm()).distances(query).rows(), 40'000u * 3);
  EXPECT_EQ(client.distances().rows(), 6u);
  EXPECT_EQ(counter("gateway.restarts"), 0u);
}

TEST_F(Gateway, LargeRequestsAndRepliesComeThroughWhole) {
  start({});
  Client over_tcp = patient(tcp()), over_shm = patient(shm());
  Query query;
  query.fields = kDefaultFields | kFieldPoints | kFieldNormal;
  std::vector<std::uint32_t> bodies{1};
  std::vector<Pose7> poses;
  for (int i = 0; i < 50'000; ++i) poses.push_back({0.001 * i, 0, 1, 1, 0, 0, 0});  // 2.8 MB of request, 20 MB of reply
  query.bodies = bodies;
  query.configurations = poses;
  const Result a = over_tcp.distances(query), b = over_shm.distances(query);
  ASSERT_EQ(a.rows(), b.rows());
  ASSERT_GT(a.rows(), 100'000u);
  EXPECT_EQ(std::memcmp(a.lower().data(), b.lower().data(), a.lower().size_bytes()), 0);
  EXPECT_EQ(std::memcmp(a.normal().data(), b.normal().data(), a.normal().size_bytes()), 0);
}

class GatewayWithKeys : public Gateway {
 protected:
  void SetUp() override {
    if (!zmq_has("curve")) GTEST_SKIP() << "this libzmq has no CURVE";
    std::filesystem::create_directory(folder_ / "keys");
    chmod((folder_ / "keys").c_str(), 0700);
    for (const char* name : {"keys/server.key", "own.key"}) {
      char open[41], secret[41];
      ASSERT_EQ(zmq_curve_keypair(open, secret), 0);
      write_key_pair(folder_ / name, {open, secret});
    }
    std::ofstream(folder_ / "keys/authorized") << read_public_key(folder_ / "own.key") << " query own\n";
    start({"--keys", folder_ / "keys", "--limit", "gateway-mib=256"});
  }
  /// Starts a daemon with a gateway process that misbehaves in this way once it runs.
  void start_hostile(const std::string& what) {
    daemon_.reset();
    start({"--keys", folder_ / "keys", "--limit", "gateway-mib=64"},
          {"CLEARANCE_OUTSIDE=" + program("clearance-hostile-gateway"), "CLEARANCE_HOSTILE=" + what,
           "CLEARANCE_KEY_TO_CLAIM=" + read_public_key(folder_ / "own.key")});
  }
  ConnectOptions own() const { return {20s, folder_ / "keys/server.key.pub", folder_ / "own.key"}; }
};

TEST_F(GatewayWithKeys, UnauthenticatedPeersMaySendLittleBeforeAHandshake) {
  const Busy busy(shm());
  Client good = patient(tcp(), own());
  const std::uint64_t before = high_water_kib();
  const int pid = child_of(daemon_->pid(), kName);
  ASSERT_GT(pid, 0);
  // Would take 1.6 GB: an incomplete command of 16 MiB over each of a hundred connections.
  std::vector<std::unique_ptr<RawTcp>> peers;
  const std::string command = RawTcp::head(4, 16 << 20) + std::string(8 << 20, 'x');
  for (int i = 0; i < 100; ++i) {
    peers.push_back(std::make_unique<RawTcp>(tcp()));
    peers.back()->send(RawTcp::greeting("CURVE"));
    peers.back()->send_some(command);
    if (i % 10 == 0) {
      EXPECT_EQ(good.distances().rows(), 6u);
    }
  }
  for (const auto& peer : peers) EXPECT_TRUE(peer->is_hung_up(kPatience));
  EXPECT_EQ(child_of(daemon_->pid(), kName), pid) << "it lives";
  EXPECT_LT(status_kib(pid, "VmHWM"), 64u * 1024) << "its memory, KiB";
  EXPECT_EQ(good.distances().rows(), 6u);
  busy.expect_answers();
  expect_core_unharmed(before);
  EXPECT_EQ(counter("gateway.restarts"), 0u);
}

TEST_F(GatewayWithKeys, UnauthenticatedPeersThatSendNothingAreDisconnected) {
  RawTcp silent(tcp()), halfway(tcp());
  halfway.send(RawTcp::greeting("CURVE"));
  EXPECT_TRUE(silent.is_hung_up(kPatience));
  EXPECT_TRUE(halfway.is_hung_up(kPatience));
  EXPECT_EQ(patient(tcp(), own()).distances().rows(), 6u);
}

TEST_F(GatewayWithKeys, AKeyMayEndItAndClientsWithKeysAreServedAgain) {
  const Busy busy(shm());
  const std::uint64_t before = high_water_kib();
  for (std::uint64_t round = 1; round <= 2; ++round) {
    zmq::context_t context;
    zmq::socket_t evil(context, zmq::socket_type::dealer);
    evil.set(zmq::sockopt::linger, 0);
    const KeyPair pair = read_key_pair(folder_ / "own.key");
    const std::string server = read_public_key(folder_ / "keys/server.key.pub");
    const auto set = [&evil](int option, const std::string& key) {
      ASSERT_EQ(zmq_setsockopt(evil.handle(), option, key.data(), key.size()), 0);
    };
    set(ZMQ_CURVE_SERVERKEY, server);
    set(ZMQ_CURVE_PUBLICKEY, pair.public_key);
    set(ZMQ_CURVE_SECRETKEY, pair.secret_key);
    evil.connect(tcp());
    for (int i = 0; i < 70'000; ++i) evil.send(zmq::const_buffer{}, zmq::send_flags::sndmore);
    evil.send(zmq::const_buffer{}, zmq::send_flags::none);
    wait_for("gateway.restarts", round);
    evil.close();
    report("after a key's message of 70,000 parts, until a key is served", served_again(own()));
  }
  busy.expect_answers();
  expect_core_unharmed(before);
}

TEST_F(GatewayWithKeys, OneThatWasTakenOverIsEndedAtItsFirstWrongWord) {
  struct Case {
    const char *what, *why;
  };
  for (const Case& c : {Case{"garbage", "it sends a name or extra data of a wrong length"},
                        {"kind", "it sent something other than a ZeroMQ message"},
                        {"packet", "it sent something other than a ZeroMQ message"},
                        {"no key", "it names an invalid client"},
                        {"wrong key", "it names an invalid client"},
                        {"nameless", "it names an invalid client"},
                        {"headless", "it sent something other than a ZeroMQ message"},
                        {"reply released", "it releases a reply that it did not receive"},
                        {"authenticate", "it reports a client without a valid key"},
                        {"bodies", "it sends too many bodies at once"},
                        {"stranger's key", "forbidden as it should be"}}) {
    start_hostile(c.what);
    wait_for("gateway.restarts", 1);
    EXPECT_EQ(patient(shm()).distances().rows(), 6u) << c.what;
    EXPECT_NE(daemon_->log().find(c.why), std::string::npos) << c.what << "\n" << daemon_->log();
  }
}

TEST_F(GatewayWithKeys, OneThatSendsAndDoesNotReadTakesNoMoreOfTheCoreThanItMay) {
  start_hostile("greedy");
  const Busy busy(shm());
  busy.expect_answers();
  const std::uint64_t before = high_water_kib();
  wait_for("gateway.restarts", 1);
  EXPECT_NE(daemon_->log().find("it does not read its messages"), std::string::npos) << daemon_->log();
  busy.expect_answers();
  EXPECT_LT(high_water_kib(), before + 3 * 64 * 1024) << "KiB";
}

}  // namespace
}  // namespace clearance
