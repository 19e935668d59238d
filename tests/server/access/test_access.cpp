// Rights of clients: as text, in the loop, and through Unix sockets.
#include <grp.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "client/client.h"
#include "server/access/access.h"
#include "tests/patience.h"
#include "tests/server/bad_requests.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

TEST(Rights, InWords) {
  EXPECT_EQ(parse_rights("query"), kMayQuery);
  EXPECT_EQ(parse_rights("admin,poses"), kMayAdmin | kMayPose);
  EXPECT_EQ(rights_text(kAllRights), "query,poses,admin");
  EXPECT_EQ(rights_text(parse_rights("control,query")), "query,control");
  EXPECT_EQ(rights_text(0), "nothing");
  for (const char* wrong : {"", "Query", "query,", "query poses", "root"})
    EXPECT_THROW(parse_rights(wrong), std::invalid_argument) << wrong;
}

TEST(Rights, OfUsersAtUnixSockets) {
  const uid_t own = geteuid(), other = own + 1;
  Access access;
  EXPECT_FALSE(access.has_control());
  EXPECT_EQ(rights_of_user(own, false, access), Rights{kAllRights});
  EXPECT_EQ(class_of(kAllRights), ServiceClass::kPlanning) << "the class is given by name, to this user too";
  EXPECT_EQ(rights_of_user(other, false, access), std::nullopt);
  EXPECT_EQ(rights_of_user(other, true, access), Rights{kMayQuery});
  access.control_users = {own, other};
  EXPECT_TRUE(access.has_control());
  EXPECT_EQ(rights_of_user(own, false, access), Rights{kAllRights | kControl});
  EXPECT_EQ(rights_of_user(other, true, access), Rights{kMayQuery | kControl});
  EXPECT_EQ(rights_of_user(other, false, access), std::nullopt) << "a class lets nobody in";
  EXPECT_EQ(user_named("root"), 0u);
  EXPECT_EQ(user_named("1234567"), 1234567u);
  EXPECT_THROW(user_named("no such user"), std::invalid_argument);
}

/// Every request, with the right that it needs.
struct Request {
  FrameType type;
  Rights needed;
  std::vector<std::byte> frame;
  bool is_plan = false;  ///< of which none exists without a GPU
};
std::vector<Request> requests() {
  wire::PosesHeader poses;
  wire::AttachRecord attach;
  attach.child = 1;
  attach.parent = 2;
  wire::NewBodyRecord new_body;
  wire::set_name(new_body.name, "ball");
  new_body.shape = static_cast<std::uint8_t>(wire::BodyShape::kSphere);
  new_body.size[0] = 1;
  const auto with = [](FrameType type, const auto& record) {
    return simple_frame(type, 1, std::as_bytes(std::span(&record, 1)));
  };
  return {{FrameType::kPing, 0, simple_frame(FrameType::kPing, 1)},
          {FrameType::kDescribe, kMayQuery, simple_frame(FrameType::kDescribe, 1)},
          {FrameType::kQuery, kMayQuery, small_query().frame(1)},
          {FrameType::kPairs, kMayQuery, small_query().frame(1, FrameType::kPairs)},
          {FrameType::kCertify, kMayQuery, small_query().frame(1, FrameType::kCertify)},
          {FrameType::kOpenPlan, kMayQuery, small_query().frame(1, FrameType::kOpenPlan), true},
          {FrameType::kRunPlan, kMayQuery, with(FrameType::kRunPlan, wire::PlanRecord()), true},
          {FrameType::kClosePlan, kMayQuery, with(FrameType::kClosePlan, wire::PlanRecord()), true},
          {FrameType::kSetPoses, kMayPose, with(FrameType::kSetPoses, poses)},
          {FrameType::kAttach, kMayPose, with(FrameType::kAttach, attach)},
          {FrameType::kGetStates, kMayQuery, simple_frame(FrameType::kGetStates, 1)},
          {FrameType::kGetStats, kMayQuery, simple_frame(FrameType::kGetStats, 1)},
          {FrameType::kSetJoints, kMayPose, with(FrameType::kSetJoints, poses)},
          {FrameType::kGetJoints, kMayQuery, simple_frame(FrameType::kGetJoints, 1)},
          {FrameType::kAddBody, kMayPose, with(FrameType::kAddBody, new_body)},
          {FrameType::kReload, kMayAdmin, simple_frame(FrameType::kReload, 1)}};
}

TEST_F(LoopTest, ARequestIsAnsweredToThoseAloneWhoHaveItsRight) {
  int allowed = 0, rejected = 0;
  for (Rights rights = 0; rights <= kAllRights; ++rights)
    for (const Request& request : requests()) {
      start(small_scene());
      loop_->reload_by([] { return std::make_unique<engine::Engine>(small_scene()); },
                       [](engine::Scene scene) { return std::make_unique<engine::Engine>(std::move(scene)); });
      const std::uint64_t revision = engine_->pose_revision();
      a_.rights = rights;
      transport_->send(a_, request.frame);
      while (a_.replies.empty()) loop_->turn();
      const auto frame = take(a_);
      if ((request.needed & rights) == request.needed) {
        if (request.is_plan)
          EXPECT_NE(static_cast<ErrorCode>(error_of(frame).header.code), ErrorCode::kForbidden);
        else
          EXPECT_NE(frame->type(), FrameType::kError) << wire::type_name(static_cast<std::uint16_t>(request.type));
        ++allowed;
        continue;
      }
      const auto error = error_of(frame);
      EXPECT_EQ(static_cast<ErrorCode>(error.header.code), ErrorCode::kForbidden);
      EXPECT_EQ(error.text, wire::type_name(static_cast<std::uint16_t>(request.type)) + " needs the right \"" +
                                rights_text(request.needed) + "\"; this client has " + rights_text(rights));
      EXPECT_EQ(engine_->pose_revision(), revision);
      EXPECT_FALSE(loop_->is_reloading());
      ++rejected;
    }
  EXPECT_EQ(allowed, 8 + 15 * 4);  // the echo, and each of the others with half of the sets
  EXPECT_EQ(rejected, 15 * 4);
}

// --- Unix sockets

mode_t mode_of(const std::string& path) {
  struct stat info{};
  EXPECT_EQ(stat(path.c_str(), &info), 0) << path;
  return info.st_mode & 07777;
}

constexpr uid_t kNobody = 65534;
constexpr gid_t kGroup = 4242, kOtherGroup = 4343;

/// Runs `work` as another user, in the given groups. Its result is the exit code.
template <class Work>
int as_other_user(gid_t primary, const std::vector<gid_t>& groups, Work work) {
  const pid_t child = fork();
  if (child == 0) {
    if (setgroups(groups.size(), groups.data()) || setresgid(primary, primary, primary) ||
        setresuid(kNobody, kNobody, kNobody))
      _exit(90);
    int result = 91;
    try {
      result = work();
    } catch (const std::exception& error) {
      std::fprintf(stderr, "child: %s\n", error.what());
    }
    _exit(result);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

/// Rights of this client at a daemon: 1 query, 2 poses, 4 admin.
int tried(const std::string& url) {
  const auto allowed = [&](auto call) {
    Client client = patient(url);
    try {
      call(client);
      return true;
    } catch (const RequestError& error) {
      if (error.code != static_cast<std::uint16_t>(ErrorCode::kForbidden)) throw;
      return false;
    }
  };
  const std::pair<std::uint32_t, Pose7> pose{1, {0, 0, 0.5, 1, 0, 0, 0}};
  return allowed([](Client& client) { client.distances(); }) +
         2 * allowed([&](Client& client) { client.set_poses(std::span(&pose, 1)); }) +
         4 * allowed([](Client& client) { client.reload(); });
}

class SocketGroup : public testing::Test {
 protected:
  void SetUp() override {
    if (geteuid() != 0) GTEST_SKIP() << "only root can become another user";
    ASSERT_EQ(chmod(folder_.path().c_str(), 0755), 0);
  }
  std::unique_ptr<Daemon> start(std::vector<std::string> options, const std::vector<std::string>& environment = {}) {
    options.insert(options.end(), {"--scene", folder_.write("scene.yaml", kSmallSceneYaml), "--shm", folder_ / "c.sock",
                                   "--zmq", "ipc://" + (folder_ / "c.ipc")});
    return std::make_unique<Daemon>(std::move(options), environment);
  }
  void expect_rights_of_members(const std::vector<std::string>& environment);
  TestFolder folder_;
};

TEST_F(SocketGroup, WithoutItTheSocketsAreTheOwnersAlone) {
  const auto daemon = start({});
  EXPECT_EQ(mode_of(folder_ / "c.sock"), 0600u);
  EXPECT_EQ(mode_of(folder_ / "c.ipc"), 0700u & mode_of(folder_ / "c.ipc")) << "nothing for group and others";
  for (const std::string& url : daemon->urls()) EXPECT_EQ(tried(url), 7) << url;
  for (const char* url : {"/c.sock?user=root", "/c.ipc"}) {
    const std::string whole = (url[3] == 's' ? "shm://" : "ipc://") + folder_.path() + url;
    const int code = as_other_user(kGroup, {kGroup}, [&] {
      try {
        connect(whole);
        return 1;
      } catch (const ConnectionError&) {
        return 0;
      }
    });
    EXPECT_EQ(code, 0) << whole;
  }
}

void SocketGroup::expect_rights_of_members(const std::vector<std::string>& environment) {
  const auto daemon = start({"--socket-group", std::to_string(kGroup), "--group-rights", "query,poses"}, environment);
  const std::string shm = daemon->urls()[0] + "?user=root", ipc = daemon->urls()[1];
  EXPECT_EQ(mode_of(folder_ / "c.sock"), 0660u);
  EXPECT_EQ(mode_of(folder_ / "c.ipc"), 0660u);
  for (const std::string& url : {shm, ipc}) {
    EXPECT_EQ(tried(url), 7) << "the owner, at " << url;
    EXPECT_EQ(as_other_user(kGroup, {}, [&] { return tried(url); }), 3) << url;
    EXPECT_EQ(as_other_user(kOtherGroup, {1, 2, kGroup}, [&] { return tried(url); }), 3) << url;
    const int rejected = as_other_user(kOtherGroup, {kOtherGroup}, [&] {
      try {
        return 10 + tried(url);
      } catch (const ConnectionError&) {
        return 0;
      }
    });
    EXPECT_EQ(rejected, 0) << url;
  }
  // Even if the mode permits the connection, the daemon checks the credentials.
  ASSERT_EQ(chmod((folder_ / "c.sock").c_str(), 0666), 0);
  const int rejected = as_other_user(kOtherGroup, {kOtherGroup}, [&] {
    try {
      connect(shm);
      return 1;
    } catch (const ConnectionError& error) {
      const bool said = std::string(error.what()).find("this user is not in its group 4242") != std::string::npos;
      if (!said) std::fprintf(stderr, "child: %s\n", error.what());
      return said ? 0 : 2;
    }
  });
  EXPECT_EQ(rejected, 0);
}

TEST_F(SocketGroup, ItsMembersGetTheirRightsAndOthersAreRejected) {
  expect_rights_of_members({});
}

TEST_F(SocketGroup, TheProxyReportsThePeerOfAConnection) {
  expect_rights_of_members({"CLEARANCE_FD_FILTER_PROXY=on"});
}

TEST_F(SocketGroup, AMemberWhoTakesAllPlacesShutsOutNoOthers) {
  const auto daemon = start({"--socket-group", std::to_string(kGroup), "--limit", "max-clients=8"});
  const std::string shm = daemon->urls()[0] + "?user=root";
  int go[2], ready[2];
  ASSERT_EQ(pipe(go) + pipe(ready), 0);
  const pid_t hoarder = fork();
  if (hoarder == 0) {
    close(go[1]);
    _exit(as_other_user(kGroup, {kGroup}, [&] {
      std::vector<Client> idle;
      std::string why;
      while (why.empty()) try {
          idle.push_back(connect(shm));
        } catch (const ConnectionError& error) {
          why = error.what();
        }
      const bool said = why.find("already has " + std::to_string(idle.size()) + " shared-memory clients; the last ") !=
                            std::string::npos &&
                        why.find("(limit max-clients)") != std::string::npos;
      if (!said) std::fprintf(stderr, "child: %s\n", why.c_str());
      char byte = said && idle.size() >= 2 ? 'y' : 'n';
      if (write(ready[1], &byte, 1) != 1) return 1;
      return read(go[0], &byte, 1) == 0 ? 0 : 2;  // until the test ends
    }));
  }
  close(go[0]);
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  EXPECT_EQ(byte, 'y');
  Client client = connect(shm);
  EXPECT_EQ(client.distances().rows(), 6u);
  std::uint64_t rejected = 0;
  for (const auto& [name, value] : client.stats())
    if (name == "shm.over_quota") rejected = value;
  EXPECT_EQ(rejected, 1u);
  close(go[1]);
  int status = 0;
  waitpid(hoarder, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
  close(ready[0]), close(ready[1]);
}

TEST_F(SocketGroup, AClientSaysWhoseDaemonItMeans) {
  const auto daemon = start({"--socket-group", std::to_string(kGroup)});
  const int code = as_other_user(kGroup, {}, [&] {
    int rejected = 0;
    for (const char* user : {"", "?user=65534"}) try {
        connect(daemon->urls()[0] + user);
      } catch (const ConnectionError& error) {
        rejected += std::string(error.what()).find("the socket is user 0's, not ") != std::string::npos;
      }
    return rejected == 2 ? tried(daemon->urls()[0] + "?user=0") : 80;
  });
  EXPECT_EQ(code, 1) << "query alone, where --group-rights says nothing";
  EXPECT_THROW(connect(daemon->urls()[0] + "?user=no such one"), std::invalid_argument);
}

TEST(Clearanced, WrongGroupsAndRightsEndWith2) {
  const TestFolder folder;
  const std::string scene = folder.write("scene.yaml", kSmallSceneYaml);
  const auto said = [&](const std::string& option, const std::string& value) {
    const Finished finished = run({program("clearanced"), "--scene", scene, "--shm", folder / "c.sock", option, value});
    EXPECT_EQ(finished.code, 2);
    return finished.err;
  };
  EXPECT_NE(said("--socket-group", "no such group").find("--socket-group: there is no group \"no such group\""),
            std::string::npos);
  EXPECT_NE(said("--group-rights", "query,root")
                .find("--group-rights: \"root\" is not a right: expected query, poses, admin or control"),
            std::string::npos);
}

}  // namespace
}  // namespace clearance
