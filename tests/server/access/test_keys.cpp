// TCP with keys (CURVE): admission, the rights of each key, and the messages of rejected connections.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <thread>
#include <zmq.hpp>

#include "client/client.h"
#include "server/access/authorized_keys.h"
#include "tests/patience.h"
#include "tests/server/daemon_fixture.h"
#include "wire/key_file.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using wire::ErrorCode;

mode_t mode_of(const std::string& path) {
  struct stat info{};
  EXPECT_EQ(stat(path.c_str(), &info), 0) << path;
  return info.st_mode & 07777;
}

testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return testing::AssertionSuccess();
  return testing::AssertionFailure() << "\"" << part << "\" is not in:\n" << text;
}

/// Returns the message of the exception that a call throws.
template <class Error, class Call>
std::string thrown_by(Call call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

class Keys : public testing::Test {
 protected:
  void SetUp() override {
    if (!zmq_has("curve")) GTEST_SKIP() << "this libzmq has no CURVE";
    std::filesystem::create_directory(folder_ / "keys");
    chmod((folder_ / "keys").c_str(), 0700);
    make("keys/server.key");
    for (const char* name : {"all", "probe", "mover", "stranger"}) make(std::string(name) + ".key");
    authorize("query,poses,admin all", "all.key");
    authorize("query probe", "probe.key");
    authorize("poses mover of arms", "mover.key");
  }
  std::string make(const std::string& name) {
    const Finished made = run({program("clearance"), "keygen", folder_ / name});
    EXPECT_EQ(made.code, 0) << made.err;
    return made.out;
  }
  void authorize(const std::string& what, const std::string& file) {
    std::ofstream(folder_ / "keys/authorized", std::ios::app) << read_public_key(folder_ / file) << ' ' << what << '\n';
  }
  void start() {
    daemon_ =
        std::make_unique<Daemon>(std::vector<std::string>{"--scene", folder_.write("scene.yaml", kSmallSceneYaml),
                                                          "--zmq", "tcp://127.0.0.1:*", "--keys", folder_ / "keys"});
  }
  ConnectOptions with(const std::string& key, const std::string& server = "keys/server.key.pub") const {
    return {kPatience, folder_ / server, folder_ / (key + ".key")};
  }
  Client come(const std::string& key) const { return patient(daemon_->url(), with(key)); }
  std::uint64_t counter(const std::string& name) const {
    Client client = come("all");
    for (const auto& [known, value] : client.stats())
      if (known == name) return value;
    return 0;
  }
  static bool may(Client& client, void (*call)(Client&)) {
    try {
      call(client);
      return true;
    } catch (const RequestError& error) {
      EXPECT_EQ(error.code, static_cast<std::uint16_t>(ErrorCode::kForbidden)) << error.what();
      return false;
    }
  }
  static void evaluate(Client& client) {
    Query query;
    query.check_scene = false;
    client.distances(query);
  }
  static void move(Client& client) {
    const std::pair<std::uint32_t, Pose7> pose{1, {0, 0, 0.5, 1, 0, 0, 0}};
    client.set_poses(std::span(&pose, 1));
  }
  static void reload(Client& client) { client.reload(); }

  TestFolder folder_;
  std::unique_ptr<Daemon> daemon_;
};

TEST_F(Keys, EachMayDoWhatTheListSays) {
  start();
  struct Case {
    const char* key;
    bool query, poses, admin;
  };
  for (const Case& c : {Case{"all", true, true, true}, {"probe", true, false, false}, {"mover", false, true, false}}) {
    Client client = come(c.key);
    EXPECT_EQ(may(client, evaluate), c.query) << c.key;
    EXPECT_EQ(may(client, move), c.poses) << c.key;
    EXPECT_EQ(may(client, reload), c.admin) << c.key;
    EXPECT_GT(client.ping().count(), 0);
  }
  EXPECT_TRUE(contains(daemon_->log(), "event=key_accepted address=127.0.0.1"));
  EXPECT_TRUE(contains(daemon_->log(), "name=\"mover of arms\" rights=poses"));
  Client probe = come("probe");
  EXPECT_EQ(thrown_by<RequestError>([&] { probe.reload(); }),
            "kReload needs the right \"admin\"; this client has query");
}

TEST_F(Keys, UnauthenticatedPeersAreRejectedWithAReasonAndLogged) {
  start();
  Client witness = come("all");
  evaluate(witness);
  EXPECT_TRUE(contains(thrown_by<ConnectionError>([&] { come("stranger"); }), "the daemon rejects this client's key"));
  EXPECT_TRUE(
      contains(daemon_->log(), "event=zmq_rejected more=0 reason=\"this key is not authorized\" address=127.0.0.1"));
  EXPECT_TRUE(contains(daemon_->log(), read_public_key(folder_ / "stranger.key")));
  EXPECT_TRUE(contains(thrown_by<ConnectionError>([&] { patient(daemon_->url()); }), "the daemon there needs keys"));
  EXPECT_TRUE(contains(thrown_by<ConnectionError>([&] { connect(daemon_->url(), with("all", "probe.key.pub")); }),
                       "the daemon there has another key than server_key"));
  EXPECT_GE(counter("zmq.rejected"), 3u);
  evaluate(witness);  // as if nothing had happened
}

TEST_F(Keys, AKeyThatIsStruckOffLosesItsRightsAndOneThatIsAddedComesIn) {
  start();
  Client probe = come("probe");
  evaluate(probe);
  const std::string all = read_public_key(folder_ / "all.key");
  {
    std::ofstream list(folder_ / "keys/next");
    list << "# the first again, and another\n\n"
         << all << " query,admin\n"
         << read_public_key(folder_ / "stranger.key") << " query\n";
  }
  std::filesystem::rename(folder_ / "keys/next", folder_ / "keys/authorized");
  Client stranger = come("stranger");  // the list is read when a client connects
  evaluate(stranger);
  EXPECT_EQ(thrown_by<RequestError>([&] { evaluate(probe); }),
            "kQuery needs the right \"query\"; this client has nothing");
  EXPECT_TRUE(contains(daemon_->log(), "event=keys_read keys=2"));

  // An unreadable list changes nothing.
  std::ofstream(folder_ / "keys/authorized", std::ios::app) << "nonsense\n";
  evaluate(stranger);
  come("stranger");
  EXPECT_TRUE(contains(daemon_->log(), "keys/authorized:5: expected a public key of 40 characters (Z85) first"));
}

TEST_F(Keys, InTheUrlAndInTheEnvironment) {
  start();
  const std::string server = folder_ / "keys/server.key.pub", own = folder_ / "probe.key";
  const auto query = [&](const std::string& url, const std::vector<std::string>& environment) {
    return run({program("clearance"), "bodies", "--connect", url}, environment);
  };
  EXPECT_EQ(query(daemon_->url() + "?server_key=" + server + "&key=" + own, {}).code, 0);
  EXPECT_EQ(query(daemon_->url(), {"CLEARANCE_SERVER_KEY=" + server, "CLEARANCE_KEY=" + own}).code, 0);
  EXPECT_EQ(query(daemon_->url(), {}).code, 3);
  const Finished half = query(daemon_->url() + "?key=" + own, {});
  EXPECT_EQ(half.code, 2);
  EXPECT_TRUE(contains(half.err, "server_key is missing"));
  EXPECT_TRUE(contains(query(daemon_->url() + "?server_key=" + server + "&key=" + folder_.path() + "/none", {}).err,
                       "/none: No such file or directory"));
  EXPECT_TRUE(contains(query(daemon_->url() + "?keys=x", {}).err, "\"keys=x\" is not an option"));
  chmod(own.c_str(), 0644);
  EXPECT_TRUE(contains(query(daemon_->url() + "?server_key=" + server + "&key=" + own, {}).err,
                       "others may read this secret key"));
}

TEST_F(Keys, ADaemonWithoutThemAndAClientWithThem) {
  Daemon daemon({"--scene", folder_.write("scene.yaml", kSmallSceneYaml), "--zmq", "tcp://127.0.0.1:*"});
  Client stranger = patient(daemon.url());
  EXPECT_TRUE(may(stranger, evaluate));
  EXPECT_TRUE(may(stranger, move));
  EXPECT_FALSE(may(stranger, reload)) << "the loopback knows no users";
  EXPECT_TRUE(contains(thrown_by<ConnectionError>([&] { connect(daemon.url(), with("all")); }), "or uses none"));
}

TEST_F(Keys, WithThemOtherAddressesAreOpened) {
  const std::string scene = folder_.write("scene.yaml", kSmallSceneYaml);
  Daemon daemon({"--scene", scene, "--zmq", "tcp://0.0.0.0:*", "--keys", folder_ / "keys"});
  const std::string port = daemon.url().substr(daemon.url().rfind(':'));
  Client client = connect("tcp://127.0.0.1" + port, with("probe"));
  evaluate(client);
}

TEST_F(Keys, FilesThatWillNotDoEndTheDaemonWith4) {
  const std::string scene = folder_.write("scene.yaml", kSmallSceneYaml);
  const auto said = [&] {
    const Finished ended =
        run({program("clearanced"), "--scene", scene, "--zmq", "tcp://127.0.0.1:*", "--keys", folder_ / "keys"});
    EXPECT_EQ(ended.code, 4);
    return ended.err;
  };
  const std::string list = folder_ / "keys/authorized", own = folder_ / "keys/server.key";
  chmod(list.c_str(), 0666);
  EXPECT_TRUE(contains(said(), "authorized: others may write to it"));
  chmod(list.c_str(), 0600);
  chmod(own.c_str(), 0640);
  EXPECT_TRUE(contains(said(), "server.key: others may read this secret key"));
  chmod(own.c_str(), 0600);
  chmod((folder_ / "keys").c_str(), 0777);
  EXPECT_TRUE(contains(said(), "/keys: others may write to it"));
  chmod((folder_ / "keys").c_str(), 0700);
  authorize("query again", "probe.key");
  EXPECT_TRUE(contains(said(), "authorized:4: this key is listed twice"));
  std::ofstream{list} << read_public_key(folder_ / "all.key") << " everything\n";
  EXPECT_TRUE(contains(said(), "authorized:1: \"everything\" is not a right"));
  std::ofstream{list} << read_public_key(folder_ / "all.key") << "\n";
  EXPECT_TRUE(contains(said(), "authorized:1: the rights of this key are missing"));
  std::filesystem::remove(list);
  EXPECT_TRUE(contains(said(), "authorized: No such file or directory"));
}

TEST(KeyFiles, AreThisUsersAloneAndNeverOverwritten) {
  if (!zmq_has("curve")) GTEST_SKIP() << "this libzmq has no CURVE";
  const TestFolder folder;
  const auto keygen = [&](const std::string& name) { return run({program("clearance"), "keygen", folder / name}); };
  const Finished first = keygen("a.key");
  EXPECT_EQ(first.code, 0) << first.err;
  EXPECT_EQ(mode_of(folder / "a.key"), 0600u);
  EXPECT_EQ(mode_of(folder / "a.key.pub"), 0600u);
  const KeyPair pair = read_key_pair(folder / "a.key");
  EXPECT_EQ(first.out, pair.public_key + "\n");
  EXPECT_EQ(read_public_key(folder / "a.key.pub"), pair.public_key);
  char derived[41];
  ASSERT_EQ(zmq_curve_public(derived, pair.secret_key.c_str()), 0);
  EXPECT_EQ(pair.public_key, derived);

  EXPECT_TRUE(contains(keygen("a.key").err, "a.key: is there already"));
  EXPECT_EQ(read_key_pair(folder / "a.key").secret_key, pair.secret_key);
  folder.write("b.key.pub", "somebody's\n");
  EXPECT_EQ(keygen("b.key").code, 1);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.key")) << "no half of a pair";
  EXPECT_NE(read_key_pair((keygen("c.key"), folder / "c.key")).secret_key, pair.secret_key);

  EXPECT_TRUE(
      contains(thrown_by<std::runtime_error>([&] { read_key_pair(folder / "a.key.pub"); }), "no secret key in it"));
  EXPECT_TRUE(contains(thrown_by<std::runtime_error>([&] { read_public_key(folder.write("d", "public short\n")); }),
                       "d: expected a key of 40 characters"));
  EXPECT_TRUE(
      contains(thrown_by<std::runtime_error>([&] { read_public_key(folder.write("e", "")); }), "no public key"));
}

}  // namespace
}  // namespace clearance
