#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>

#include <optional>

#include "client/channel/url.h"
#include "client/client.h"
#include "tests/client/scripted_server.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;
using wire::FrameBuilder;
using wire::FrameType;
using Bytes = ScriptedServer::Bytes;

Bytes scene_frame(const wire::FrameHeader& request, std::uint64_t revision, std::uint32_t cup_parent) {
  FrameBuilder frame(wire::make_header(FrameType::kScene, request.request_id, 0, revision));
  wire::SceneHeader header;
  header.scene_revision = revision;
  header.body_count = 3;
  header.group_count = 1;
  header.member_count = 2;
  header.pair_count = 3;
  wire::set_name(header.backend, "cpu");
  frame.add(header);
  for (const char* name : {"link1", "link2", "cup"}) {
    wire::BodyRecord body;
    wire::set_name(body.name, name);
    body.parent = std::string(name) == "cup" ? cup_parent : kNone;
    body.piece_count = 1;
    frame.add(body);
  }
  wire::GroupRecord group;
  wire::set_name(group.name, "arm");
  group.member_count = 2;
  return frame.add(group).add(std::uint32_t{0}).add(std::uint32_t{1}).take();
}

Bytes error_frame(const wire::FrameHeader& request, wire::ErrorCode code, const std::string& text) {
  wire::ErrorHeader header;
  header.code = static_cast<std::uint16_t>(code);
  header.text_bytes = static_cast<std::uint32_t>(text.size());
  return FrameBuilder(wire::make_header(FrameType::kError, request.request_id, 0))
      .add(header)
      .add_bytes(text.data(), text.size())
      .take();
}

/// One row whose distance identifies the request.
Bytes reply_frame(const wire::FrameHeader& request) {
  wire::ReplyHeader header;
  header.rows = 1;
  header.fields = kFieldDistance | kFieldStatus;
  std::byte columns[128] = {};
  const double distance = static_cast<double>(request.request_id);
  std::memcpy(columns, &distance, sizeof distance);
  return FrameBuilder(wire::make_header(FrameType::kReply, request.request_id, 0)).add(header).add(columns).take();
}

Bytes poses_done_frame(const wire::FrameHeader& request, std::uint32_t applied) {
  wire::PosesResult result;
  result.applied = applied;
  return FrameBuilder(wire::make_header(FrameType::kPosesDone, request.request_id, 0)).add(result).take();
}

template <class Error>
std::string text_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

FrameType type_of(const wire::FrameHeader& header) {
  return static_cast<FrameType>(header.type);
}

TEST(Url, KindsAndOptions) {
  EXPECT_EQ(parse_url("shm:///run/user/0/clearance.sock").kind, UrlKind::kShm);
  EXPECT_EQ(parse_url("shm:///run/user/0/clearance.sock").target, "/run/user/0/clearance.sock");
  EXPECT_EQ(parse_url("ipc:///a").target, "ipc:///a");
  EXPECT_EQ(parse_url("tcp://localhost:5555").kind, UrlKind::kZmq);
  const Url lcm = parse_url("udpm://239.255.76.67:7667?ttl=0&prefix=CELL2_&recv_buf_size=4096");
  EXPECT_EQ(lcm.kind, UrlKind::kLcm);
  EXPECT_EQ(lcm.target, "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4096");
  EXPECT_EQ(lcm.prefix, "CELL2_");
  EXPECT_EQ(parse_url("udpm://239.255.76.67:7667?prefix=A_").target, "udpm://239.255.76.67:7667");
  EXPECT_EQ(parse_url("udpm://239.255.76.67:7667").prefix, "");
}

TEST(Url, BadOnesSayWhatIsExpected) {
  EXPECT_EQ(text_of<std::invalid_argument>([] { parse_url("http://localhost"); }),
            "\"http://localhost\" is not a url of a daemon: expected shm:///path, ipc:///path, tcp://host:port or "
            "udpm://group:port?ttl=0");
  EXPECT_EQ(
      text_of<std::invalid_argument>([] { parse_url("shm://clearance.sock"); }),
      "\"shm://clearance.sock\": the path of the socket must be absolute, as in shm:///run/user/1000/clearance.sock");
  EXPECT_EQ(text_of<std::invalid_argument>([] { parse_url("ipc://"); }),
            "\"ipc://\": the endpoint is missing, as in ipc:///run/user/1000/clearance.ipc");
}

TEST(Client, SceneIsFetchedOnceAndNamesAreResolved) {
  std::atomic<int> fetched{0};
  ScriptedServer server([&](const wire::FrameHeader& header, auto) -> std::vector<Bytes> {
    ++fetched;
    return {scene_frame(header, 7, kNone)};
  });
  Client client = connect(server.url());
  EXPECT_EQ(client.scene().revision, 7u);
  EXPECT_EQ(client.scene().backend, "cpu");
  EXPECT_EQ(client.body("cup"), 2u);
  EXPECT_EQ(client.group("arm"), kGroupBit | 0u);
  EXPECT_EQ(client.group("*"), kEveryBody);
  EXPECT_EQ(client.scene().groups[0].bodies, (std::vector<std::uint32_t>{0, 1}));
  EXPECT_EQ(fetched, 1);
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.body("lnk1"); }),
            "no body \"lnk1\" in the scene; did you mean \"link1\", \"link2\"?");
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.body("gripper"); }), "no body \"gripper\" in the scene");
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.group("arms"); }),
            "no group \"arms\" in the scene; did you mean \"arm\"?");
}

TEST(Client, RepliesAreMatchedToRequestsInAnyOrder) {
  std::vector<wire::FrameHeader> held;
  ScriptedServer server([&](const wire::FrameHeader& header, auto) {
    held.push_back(header);
    std::vector<Bytes> answers;
    if (held.size() == 3)
      for (int i : {2, 0, 1}) answers.push_back(reply_frame(held[i]));
    return answers;
  });
  Client client = connect(server.url());
  Pending first = client.submit(), second = client.submit();
  EXPECT_FALSE(first.ready());
  const Result third = client.distances();
  EXPECT_EQ(second.get().distance()[0], 2);
  EXPECT_TRUE(first.ready());
  EXPECT_EQ(first.get().distance()[0], 1);
  EXPECT_EQ(third.distance()[0], 3);
  EXPECT_EQ(third.status()[0], Status::kOk);
  EXPECT_TRUE(third.lower().empty()) << "a column that was not sent is empty";
  EXPECT_EQ(text_of<std::logic_error>([&] { first.get(); }), "this reply was fetched already");
}

TEST(Client, WaitsForOneReplyAsLongAsItIsTold) {
  std::vector<wire::FrameHeader> held;
  ScriptedServer server([&](const wire::FrameHeader& header, auto) -> std::vector<Bytes> {
    held.push_back(header);
    if (held.size() == 1) return {};
    return {reply_frame(held[0]), reply_frame(held[1])};
  });
  Client client = connect(server.url());
  Pending first = client.submit();
  EXPECT_FALSE(first.wait_for(1ms));
  Pending second = client.submit();
  EXPECT_TRUE(first.wait_for(5s)) << "the first wait has not given it up";
  EXPECT_TRUE(second.wait_for(5s));
  EXPECT_EQ(first.get().distance()[0], 1);
  EXPECT_EQ(second.get().distance()[0], 2);
}

TEST(Client, EmptyPairsMeanAllOrNone) {
  std::vector<wire::QueryHeader> requested;
  ScriptedServer server([&](const wire::FrameHeader& header, std::span<const std::byte> payload) -> std::vector<Bytes> {
    std::memcpy(&requested.emplace_back(), payload.data(), sizeof(wire::QueryHeader));
    return {reply_frame(header)};
  });
  Client client = connect(server.url());
  (void)client.distances();
  (void)client.distances({.all_pairs = false});
  server.stop();
  ASSERT_EQ(requested.size(), 2u);
  EXPECT_EQ(requested[0].all_pairs, 1);
  EXPECT_EQ(requested[1].all_pairs, 0);
  EXPECT_EQ(requested[1].pair_count, 0u);
}

TEST(Client, PendingOutlivesItsClient) {
  ScriptedServer server(
      [](const wire::FrameHeader& header, auto) -> std::vector<Bytes> { return {reply_frame(header)}; });
  std::optional<Pending> pending;
  {
    Client client = connect(server.url());
    pending.emplace(client.submit());
  }
  EXPECT_EQ(pending->get().distance()[0], 1);
}

TEST(Client, TimesOutAndDropsTheLateReply) {
  std::vector<wire::FrameHeader> held;
  ScriptedServer server([&](const wire::FrameHeader& header, auto) -> std::vector<Bytes> {
    held.push_back(header);
    if (held.size() == 1) return {};
    return {reply_frame(held[0]), reply_frame(header)};
  });
  Client client = connect(server.url());
  client.set_timeout(20ms);
  EXPECT_EQ(text_of<TimeoutError>([&] { client.distances(); }), server.url() + ": no kReply within 0.02 s");
  client.set_timeout(5s);
  EXPECT_EQ(client.distances().distance()[0], 2) << "not the late answer to the first request";
}

TEST(Client, ErrorsOfTheDaemonAreThrown) {
  ScriptedServer server([](const wire::FrameHeader& header, auto) -> std::vector<Bytes> {
    return {error_frame(header, wire::ErrorCode::kBusy, "64 requests wait already")};
  });
  Client client = connect(server.url());
  try {
    client.distances();
    FAIL();
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kBusy));
    EXPECT_STREQ(error.what(), "64 requests wait already");
  }
}

TEST(Client, MalformedFramesAreErrorsOfTheConnection) {
  int turn = 0;
  ScriptedServer server([&](const wire::FrameHeader& header, auto) -> std::vector<Bytes> {
    Bytes frame = reply_frame(header);
    switch (turn++) {
      case 0: {  // more rows than were sent
        const std::uint64_t rows = std::uint64_t{1} << 61;
        std::memcpy(frame.data() + sizeof header, &rows, sizeof rows);
        return {frame};
      }
      case 1:
        return {poses_done_frame(header, 0)};
      default: {
        frame[0] = std::byte{0};
        return {frame};
      }
    }
  });
  Client client = connect(server.url());
  EXPECT_EQ(text_of<ConnectionError>([&] { client.distances(); }),
            "the daemon sent a malformed frame: reply: 2305843009213693952 rows need a payload of more than 2^64 "
            "bytes, got 256");
  EXPECT_EQ(text_of<ConnectionError>([&] { client.distances(); }),
            server.url() + ": the daemon answered with kPosesDone, expected kReply");
  EXPECT_EQ(text_of<ConnectionError>([&] { client.distances(); }),
            server.url() + ": the daemon sent a malformed frame: frame: magic is 0x31524c00, expected 0x31524c43");
}

/// A daemon whose scene changed from revision 1 to 2 after the client fetched it.
struct ChangedScene {
  std::uint32_t new_cup_parent;
  std::vector<std::uint64_t> revisions;  // of the requests other than kDescribe
  std::uint64_t described = 0;
  ScriptedServer server{[this](const wire::FrameHeader& header, auto) -> std::vector<Bytes> {
    if (type_of(header) == FrameType::kDescribe)
      return {described++ ? scene_frame(header, 2, new_cup_parent) : scene_frame(header, 1, kNone)};
    revisions.push_back(header.scene_revision);
    if (header.scene_revision == 1) return {error_frame(header, wire::ErrorCode::kWrongScene, "the scene is 2, not 1")};
    return {type_of(header) == FrameType::kSetPoses ? poses_done_frame(header, 1) : reply_frame(header)};
  }};
};

constexpr Pose7 kIdentity{0, 0, 0, 1, 0, 0, 0};

TEST(Client, QueriesForAnOldSceneAreRefusedUntilItIsLookedAt) {
  ChangedScene daemon{kNone, {}};
  Client client = connect(daemon.server.url());
  client.scene();
  for (int i = 0; i < 2; ++i) EXPECT_EQ(text_of<RequestError>([&] { client.distances(); }), "the scene is 2, not 1");
  EXPECT_EQ(client.scene().revision, 2u) << "fetched anew";
  EXPECT_EQ(client.distances().rows(), 1u);
  Query unchecked;
  unchecked.check_scene = false;
  client.distances(unchecked);
  daemon.server.stop();
  EXPECT_EQ(daemon.revisions, (std::vector<std::uint64_t>{1, 1, 2, 0}));
}

TEST(Client, PosesAreSentAgainWhereTheyMeanTheSame) {
  ChangedScene daemon{0, {}};  // another client attached the cup to link1
  Client client = connect(daemon.server.url());
  EXPECT_EQ(client.set_poses({{"link2", kIdentity}}).applied, 1u);
  EXPECT_EQ(text_of<RequestError>([&] { client.distances(); }), "the scene is 2, not 1") << "nobody has looked at it";
  daemon.server.stop();
  EXPECT_EQ(daemon.revisions, (std::vector<std::uint64_t>{1, 2, 1}));
}

TEST(Client, PosesOfABodyThatNowFollowsAnotherAreNotSentAgain) {
  ChangedScene daemon{0, {}};
  Client client = connect(daemon.server.url());
  EXPECT_EQ(text_of<RequestError>([&] { client.set_poses({{"link2", kIdentity}, {"cup", kIdentity}}); }),
            "the scene is 2, not 1");
  daemon.server.stop();
  EXPECT_EQ(daemon.revisions, (std::vector<std::uint64_t>{1}));
}

TEST(Client, BadQueriesAreRefusedBeforeTheyAreSent) {
  ScriptedServer server(
      [](const wire::FrameHeader& header, auto) -> std::vector<Bytes> { return {reply_frame(header)}; });
  Client client = connect(server.url());
  const std::vector<std::uint32_t> bodies{0, 1};
  const std::vector<Pose7> poses(3, kIdentity);
  Query query;
  query.bodies = bodies;
  query.configurations = poses;
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.distances(query); }),
            "query: 3 poses are not a whole number of configurations of 2 bodies");
  query.bodies = {};
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.distances(query); }),
            "query: 3 poses are not a whole number of configurations of 0 bodies");
  query.bodies = bodies;
  query.configurations = {};
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.distances(query); }),
            "query: 0 poses are not a whole number of configurations of 2 bodies");
  query = {};
  const std::vector<std::uint32_t> joints{0, 1};
  const std::vector<double> positions(3);
  query.joints = joints;
  query.positions = positions;
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.distances(query); }),
            "query: 3 positions are not a whole number of configurations of 2 joints");
  query.positions = std::span(positions).first(2);
  query.bodies = std::span(bodies).first(1);
  query.configurations = poses;
  EXPECT_EQ(text_of<std::invalid_argument>([&] { client.distances(query); }),
            "query: 3 configurations of bodies and 1 of joints: expected equal numbers");
  const std::vector<IdPair> pairs(40'000'000);
  query = {};
  query.pairs = pairs;
  EXPECT_EQ(text_of<RequestError>([&] { client.distances(query); }),
            "a request of 320000192 bytes is more than the 268435456 allowed: split it");
}

TEST(Client, ADaemonThatEndsIsNoticed) {
  ScriptedServer server([](auto&&...) { return std::vector<Bytes>{}; });
  Client client = connect(server.url());
  Pending pending = client.submit();
  server.stop();
  EXPECT_EQ(text_of<ConnectionError>([&] { pending.get(); }), server.url() + ": the daemon has gone");
  // The next call looks for a new daemon; the dead one's socket file may still exist.
  const std::string text = text_of<ConnectionError>([&] { client.distances(); });
  EXPECT_TRUE(text == server.url() + ": no daemon listens there" ||
              text.rfind(server.url() + ": no such socket: is clearanced running", 0) == 0)
      << text;
}

TEST(Client, ConnectingToNothingFailsAtOnce) {
  std::string folder = (std::filesystem::temp_directory_path() / "clearance-XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::string path = folder + "/socket", url = "ipc://" + path;
  EXPECT_EQ(text_of<ConnectionError>([&] { connect(url); }),
            url + ": no such socket: is clearanced running, with --zmq " + url + "?");
  // A socket file without a listener, as a killed daemon leaves it.
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  const int abandoned = socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(abandoned, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  close(abandoned);
  EXPECT_EQ(text_of<ConnectionError>([&] { connect(url); }), url + ": no daemon listens there");
  std::filesystem::remove_all(folder);
  EXPECT_EQ(text_of<ConnectionError>([] { connect("tcp://127.0.0.1:1"); }),
            "tcp://127.0.0.1:1: no daemon listens there");
}

TEST(Client, AForkedChildMustConnectAnew) {
  ScriptedServer server(
      [](const wire::FrameHeader& header, auto) -> std::vector<Bytes> { return {reply_frame(header)}; });
  Client client = connect(server.url());
  std::optional<Pending> pending(client.submit());
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    // 0 if rejected as required, and everything inherited was released without harm
    int result = 1;
    {
      Client inherited = std::move(client);
      if (text_of<ConnectionError>([&] { inherited.distances(); }) ==
          server.url() + ": this connection was opened before a fork; the child process must open a new one")
        result = 0;
      if (text_of<ConnectionError>([&] { pending->ready(); }) == "nothing was thrown") result = 2;
      pending.reset();
    }
    _exit(result);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  EXPECT_EQ(pending->get().distance()[0], 1) << "the parent's connection still works";
  EXPECT_EQ(client.distances().distance()[0], 2);
}

}  // namespace
}  // namespace clearance
