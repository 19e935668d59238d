// Shared memory between processes: deaths on both sides, forks, and permission to connect.
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "tests/server/shm/shm_echo.h"

namespace clearance {
namespace {

using Mode = EchoRequestHandler::Mode;

/// Runs `body` in a forked child, which dies with its parent and exits with the result of `body`.
template <class Body>
pid_t in_child(Body body) {
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child != 0) return child;
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(99);
  int code = 98;
  try {
    code = body();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "child: %s\n", error.what());
  }
  ::_exit(code);
}

int exit_code(pid_t child) {
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

/// One byte from a child to its parent, to report progress.
class Signal {
 public:
  Signal() {
    if (::pipe(ends_) != 0) throw std::runtime_error("pipe");
  }
  ~Signal() {
    ::close(ends_[0]);
    ::close(ends_[1]);
  }
  void give() const { EXPECT_EQ(::write(ends_[1], "x", 1), 1); }
  void await() const {
    char byte;
    EXPECT_EQ(::read(ends_[0], &byte, 1), 1);
  }
  int descriptor() const { return ends_[0]; }

 private:
  int ends_[2];
};

class ShmProcesses : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string path_ = folder_ / "c.sock";
};

TEST_F(ShmProcesses, ClientsInOtherProcessesAreAnswered) {
  EchoServer server(path_);
  std::vector<pid_t> children;
  for (int c = 0; c < 3; ++c)
    children.push_back(in_child([&] {
      auto channel = open_shm_channel(path_, soon());
      for (std::uint64_t id = 1; id <= 300; ++id) {
        const auto payload = random_bytes(id * 37 % 9000, id * 3 + static_cast<std::uint64_t>(c));
        send_ping(*channel, id, payload);
        if (!echoes(*channel, id, payload)) return 1;
      }
      return 0;
    }));
  server.run_until([&] { return server.handler.frames == 900 && server.handler.counters["shm.clients"] == 0; });
  for (const pid_t child : children) EXPECT_EQ(exit_code(child), 0);
}

TEST_F(ShmProcesses, ClientsKilledMidRequestLeaveNothingBehind) {
  EchoServer server(path_);
  server.handler.mode = Mode::kHold;
  server.serve();
  const std::size_t descriptors = open_descriptors(), mappings = mapped_segments();
  EXPECT_EQ(mappings, 0u);
  std::size_t most_mappings = 0;
  for (int round = 0; round < 50; ++round) {
    Signal posted;
    const pid_t child = in_child([&] {
      auto channel = open_shm_channel(path_, soon());
      if (round % 3 == 1) channel->begin(1 << 20, 0);  // has grown
      for (std::uint64_t id = 1; id <= 4; ++id) send_ping(*channel, id, random_bytes(1000, id));
      posted.give();
      channel->receive(4, soon());
      return 1;  // not reached, because it is killed while it waits
    });
    server.run_until([&] { return server.handler.held.size() == 4; }, round % 2 ? -1 : posted.descriptor());
    posted.await();
    EXPECT_TRUE(server.handler.held[0].sink->alive());
    most_mappings = std::max(most_mappings, mapped_segments());
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    EXPECT_EQ(exit_code(child), -SIGKILL);
    server.run_until([&] { return server.handler.counters["shm.clients"] == 0; });
    EXPECT_FALSE(server.handler.held[0].sink->alive());
    // Replies in progress are written into memory that still exists; it is then released.
    for (std::size_t i = 0; i + 1 < server.handler.held.size(); ++i) server.handler.answer_held(i);
    server.handler.held.clear();
    ASSERT_EQ(mapped_segments(), 0u);
  }
  EXPECT_GE(most_mappings, 1u);
  EXPECT_EQ(open_descriptors(), descriptors);
  server.transport->tick(server.handler);
  EXPECT_EQ(server.handler.counters["shm.segment_bytes"], 0u);
  EXPECT_EQ(server.handler.counters["shm.connections"], 50u);
}

TEST_F(ShmProcesses, AWaitingClientNoticesThatTheDaemonDied) {
  for (const char* options : {"", "?spin_us=0"}) {
    Signal up;
    const pid_t daemon = in_child([&] {
      EchoServer server(path_);
      server.serve();
      up.give();
      server.handler.hold_after = 1;
      server.run_until([&] { return server.handler.frames == 2; });
      ::kill(::getpid(), SIGKILL);
      return 1;
    });
    up.await();
    auto channel = open_shm_channel(path_ + options, soon());
    send_ping(*channel, 1, random_bytes(100, 1));
    const auto first = channel->receive(1, soon());
    ASSERT_TRUE(first);
    send_ping(*channel, 2, {});
    try {
      channel->receive(2, soon());
      ADD_FAILURE() << "a dead daemon answered, or its death was not noticed";
    } catch (const TimeoutError&) {
      ADD_FAILURE() << "the death was not noticed";
    } catch (const ConnectionError& error) {
      EXPECT_NE(std::string(error.what()).find("the daemon is gone"), std::string::npos) << error.what();
    }
    EXPECT_EQ(exit_code(daemon), -SIGKILL);
    EXPECT_THROW(send_ping(*channel, 3, {}), ConnectionError);
    EXPECT_THROW(channel->receive(2, soon()), ConnectionError);
    const auto payload = random_bytes(100, 1);  // received data stays readable
    EXPECT_TRUE(std::equal(payload.begin(), payload.end(), first->payload().begin(), first->payload().end()));
  }
}

TEST_F(ShmProcesses, RepliesThatADaemonPostedBeforeItDiedAreStillReceived) {
  Signal up;
  const pid_t daemon = in_child([&] {
    EchoServer server(path_);
    server.serve();
    up.give();
    server.run_until([&] { return server.handler.frames == 3; });
    ::kill(::getpid(), SIGKILL);
    return 1;
  });
  up.await();
  auto channel = open_shm_channel(path_, soon());
  for (std::uint64_t id = 1; id <= 3; ++id) send_ping(*channel, id, random_bytes(50, id));
  EXPECT_EQ(exit_code(daemon), -SIGKILL);
  for (std::uint64_t id = 1; id <= 3; ++id) EXPECT_TRUE(echoes(*channel, id, random_bytes(50, id)));
}

TEST_F(ShmProcesses, AForkedChildMustConnectAgain) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  send_ping(*channel, 1, random_bytes(50, 1));
  const pid_t child = in_child([&] {
    int rejected = 0;
    const auto expect_rejection = [&](auto call) {
      try {
        call();
      } catch (const ConnectionError& error) {
        rejected += std::string(error.what()).find("open a new one in the child") != std::string::npos;
      }
    };
    expect_rejection([&] { channel->begin(64, 0); });
    expect_rejection([&] { channel->send(); });
    expect_rejection([&] { channel->receive(1, soon()); });
    expect_rejection([&] { channel->forget(1); });
    channel.reset();  // takes nothing away from the parent
    return rejected == 4 ? 0 : 1;
  });
  EXPECT_EQ(exit_code(child), 0);
  EXPECT_TRUE(echoes(*channel, 1, random_bytes(50, 1)));
  send_ping(*channel, 2, {});
  EXPECT_TRUE(echoes(*channel, 2, {}));
}

TEST_F(ShmProcesses, AnotherUserIsRejected) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can become another user";
  EchoServer server(path_);
  server.serve();
  ASSERT_EQ(::chmod(folder_.path().c_str(), 0777), 0);
  const auto connect_as_nobody = [&](const char* expected) {
    return in_child([&, expected] {
      if (::setresuid(65534, 65534, 65534) != 0) return 2;
      try {
        open_shm_channel(path_, soon());
      } catch (const ConnectionError& error) {
        if (std::string(error.what()).find(expected) != std::string::npos) return 0;
        std::fprintf(stderr, "child: %s\n", error.what());
      }
      return 1;
    });
  };
  EXPECT_EQ(exit_code(connect_as_nobody("the socket belongs to another user")), 0) << "by the socket's mode";
  // With a permissive mode, each side checks the other's credentials. Our client checks first; an older or different
  // one would not, so the test communicates with the daemon without it.
  ASSERT_EQ(::chmod(path_.c_str(), 0666), 0);
  EXPECT_EQ(exit_code(connect_as_nobody("the socket is user 0's, not ours (user 65534)")), 0);
  const pid_t raw = in_child([&] {
    if (::setresuid(65534, 65534, 65534) != 0) return 2;
    sockaddr_un address;
    shm::socket_address(path_.c_str(), address);
    shm::UniqueFd socket(::socket(AF_UNIX, SOCK_SEQPACKET, 0));
    if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return 3;
    pollfd readable{socket.get(), POLLIN, 0};
    ::poll(&readable, 1, 30000);
    shm::Message message;
    if (shm::receive_message(socket.get(), message) <= 0) return 4;
    return std::string(message.text) == "user 65534 may not connect: this daemon runs as user 0" ? 0 : 5;
  });
  server.run_until([&] { return server.handler.counters["shm.rejected"] >= 2; });
  EXPECT_EQ(exit_code(raw), 0);
  EXPECT_EQ(server.handler.counters["shm.connections"], 0u);
}

}  // namespace
}  // namespace clearance
