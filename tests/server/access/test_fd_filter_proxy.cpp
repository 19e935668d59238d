// Descriptors sent by unauthenticated peers. The process that closes the last one of a TCP socket with SO_LINGER waits
// for as long as its sender chose: this must only happen to the sender.
#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <sys/wait.h>

#include <atomic>
#include <filesystem>
#include <optional>
#include <thread>

#include "client/client.h"
#include "server/access/accepting.h"
#include "server/access/fd_filter_proxy.h"
#include "server/base/unix_socket.h"
#include "tests/server/daemon_fixture.h"
#include "tests/server/shm/raw_shm_client.h"

namespace clearance {
namespace {

using shm::UniqueFd;

/// Creates TCP sockets whose close takes kLinger, because their data is never read. Their other ends are kept until
/// this object is destroyed, which ends all waiting.
class Lingering {
 public:
  static constexpr int kLinger = 600;  // seconds: longer than any test

  Lingering() : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int small = 4096;
    ::setsockopt(listener_.get(), SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    socklen_t length = sizeof address_;
    if (::bind(listener_.get(), reinterpret_cast<sockaddr*>(&address_), length) || ::listen(listener_.get(), 64) ||
        ::getsockname(listener_.get(), reinterpret_cast<sockaddr*>(&address_), &length))
      throw std::runtime_error(std::string("loopback: ") + std::strerror(errno));
  }
  UniqueFd make() {
    UniqueFd socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const int small = 4096;
    ::setsockopt(socket.get(), SOL_SOCKET, SO_SNDBUF, &small, sizeof small);
    if (::connect(socket.get(), reinterpret_cast<sockaddr*>(&address_), sizeof address_))
      throw std::runtime_error("connect");
    others_.emplace_back(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
    const std::vector<char> much(1 << 16);
    while (::send(socket.get(), much.data(), much.size(), MSG_DONTWAIT | MSG_NOSIGNAL) > 0) {
    }
    const linger how{1, kLinger};
    ::setsockopt(socket.get(), SOL_SOCKET, SO_LINGER, &how, sizeof how);
    return socket;
  }
  /// Ends the waiting of processes that close one.
  void end() { others_.clear(); }

 private:
  sockaddr_in address_{};
  UniqueFd listener_;
  std::vector<UniqueFd> others_;
};

UniqueFd connect_to(const std::string& path, int type) {
  sockaddr_un address;
  shm::socket_address(path.c_str(), address);
  UniqueFd socket(::socket(AF_UNIX, type | SOCK_CLOEXEC, 0));
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address))
    throw std::runtime_error(std::string("connect: ") + std::strerror(errno));
  return socket;
}

/// Sends bytes with a descriptor. Returns false if the kernel rejects it (EPERM).
bool send_with(int socket, const void* bytes, std::size_t size, int descriptor) {
  iovec data{const_cast<void*>(bytes), size};
  alignas(cmsghdr) std::byte control[CMSG_SPACE(sizeof(int))] = {};
  msghdr header{};
  header.msg_iov = &data;
  header.msg_iovlen = 1;
  header.msg_control = control;
  header.msg_controllen = sizeof control;
  cmsghdr* c = CMSG_FIRSTHDR(&header);
  c->cmsg_level = SOL_SOCKET;
  c->cmsg_type = SCM_RIGHTS;
  c->cmsg_len = CMSG_LEN(sizeof(int));
  std::memcpy(CMSG_DATA(c), &descriptor, sizeof descriptor);
  const ssize_t sent = ::sendmsg(socket, &header, MSG_NOSIGNAL);
  if (sent < 0 && errno != EPERM) throw std::runtime_error(std::string("sendmsg: ") + std::strerror(errno));
  return sent >= 0;
}

TEST(Lingering, KeepsItsReceiverWaiting) {
  Lingering lingering;
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  const UniqueFd mine(ends[0]), other(ends[1]);
  ASSERT_TRUE(send_with(mine.get(), "x", 1, lingering.make().get()));
  std::atomic<bool> received{false};
  std::thread receiving([&] {
    char byte;
    EXPECT_EQ(::recv(other.get(), &byte, 1, 0), 1);
    received = true;
  });
  int unread = 1;
  while (unread > 0) ::ioctl(other.get(), FIONREAD, &unread);  // it has taken the byte, and closes the descriptor
  EXPECT_FALSE(received) << "these tests would show nothing";
  lingering.end();
  receiving.join();
}

/// Both methods: the kernel's, if it has one, and the proxy's.
class FdFilterProxy : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!uses_proxy() && !kernel_rejects_descriptors()) GTEST_SKIP() << "this kernel has no SO_PASSRIGHTS";
    daemon_.emplace(
        std::vector<std::string>{"--scene", folder_.write("scene.yaml", kSmallSceneYaml), "--shm", folder_ / "c.sock",
                                 "--zmq", "ipc://" + (folder_ / "c.ipc"), "--metrics", folder_ / "m.sock"},
        std::vector<std::string>{std::string("CLEARANCE_FD_FILTER_PROXY=") + GetParam()});
  }
  bool uses_proxy() const { return std::string(GetParam()) == "on"; }
  /// Checks that new and existing clients are answered, on every endpoint.
  void expect_service() {
    for (const std::string& url : daemon_->urls()) {
      Client client = connect(url, {.timeout = std::chrono::seconds(60)});
      EXPECT_EQ(client.distances().rows(), 6u) << url;
    }
    const UniqueFd reader = connect_to(folder_ / "m.sock", SOCK_STREAM);
    const std::string request = "GET /metrics HTTP/1.0\r\n\r\n";
    ASSERT_EQ(::send(reader.get(), request.data(), request.size(), MSG_NOSIGNAL), static_cast<ssize_t>(request.size()));
    ::shutdown(reader.get(), SHUT_WR);
    std::string answer;
    char buffer[4096];
    for (ssize_t got; (got = ::recv(reader.get(), buffer, sizeof buffer, 0)) > 0;)
      answer.append(buffer, static_cast<std::size_t>(got));
    EXPECT_EQ(answer.rfind("HTTP/1.0 200 OK", 0), 0u) << answer.substr(0, 200);
  }

  TestFolder folder_;
  Lingering lingering_;
  std::optional<Daemon> daemon_;
};

TEST_P(FdFilterProxy, NoClientWaitsForDescriptorsOfOthers) {
  EXPECT_NE(
      daemon_->log().find(std::string("event=descriptor_filter rejected_by=") + (uses_proxy() ? "proxy" : "kernel")),
      std::string::npos)
      << daemon_->log();
  std::vector<Client> old;
  for (const std::string& url : daemon_->urls()) old.push_back(connect(url, {.timeout = std::chrono::seconds(60)}));
  expect_service();
  const shm::Message hello = RawClient::make(shm::MessageKind::kHello);
  const std::vector<char> noise(sizeof hello, '\xff');  // begins a ZeroMQ greeting
  int sent = 0, rejected = 0;
  std::vector<UniqueFd> open, ours;
  for (const auto& [name, type] :
       {std::pair("c.sock", SOCK_SEQPACKET), {"c.ipc", SOCK_STREAM}, {"m.sock", SOCK_STREAM}})
    for (const bool stays : {true, false}) {  // the descriptor is received, or closed with the connection
      // Stops the daemon, so that the daemon's copies, if it gets any, are closed last.
      ASSERT_EQ(kill(daemon_->pid(), SIGSTOP), 0);
      ASSERT_EQ(waitpid(daemon_->pid(), nullptr, WUNTRACED), daemon_->pid());
      for (const bool good : {true, false}) {  // whether its bytes are a greeting
        UniqueFd socket = connect_to(folder_ / name, type);
        if (!good && type == SOCK_STREAM) ::send(socket.get(), "\n\n", 2, MSG_NOSIGNAL);
        const void* bytes = good && type == SOCK_SEQPACKET ? static_cast<const void*>(&hello) : noise.data();
        for (int i = 0; i < 3; ++i) {
          UniqueFd descriptor = lingering_.make();
          const bool taken = send_with(socket.get(), bytes, sizeof hello, descriptor.get());
          (taken ? sent : rejected) += 1;
          if (!taken) ours.push_back(std::move(descriptor));  // closing the last one would wait
        }
        if (stays) open.push_back(std::move(socket));
      }
      ASSERT_EQ(kill(daemon_->pid(), SIGCONT), 0);
      expect_service();
    }
  EXPECT_EQ(sent, uses_proxy() ? 36 : 0);
  EXPECT_EQ(rejected, uses_proxy() ? 0 : 36);
  for (Client& client : old) EXPECT_EQ(client.distances().rows(), 6u);
  open.clear();
  expect_service();
  EXPECT_EQ(daemon_->stop(SIGTERM), 0) << "with descriptors that still linger";
  lingering_.end();
}

TEST_P(FdFilterProxy, ClientsComeAndGo) {
  const auto descriptors = [&] {
    int count = 0;
    for ([[maybe_unused]] const auto& entry :
         std::filesystem::directory_iterator("/proc/" + std::to_string(daemon_->pid()) + "/fd"))
      ++count;
    return count;
  };
  expect_service();
  for (const std::string& url : daemon_->urls()) {
    Client watching = connect(url);
    const auto clients = [&] {
      for (const auto& [name, value] : watching.stats())
        if (name == "shm.clients") return value;
      return ~std::uint64_t{0};
    };
    watching.ping();
    const auto before = clients();
    for (int i = 0; i < 4; ++i) {
      Client client = connect(url);
      EXPECT_EQ(client.distances().rows(), 6u);
      const std::vector<Pose7> poses(10'000, {0, 0, 0, 1, 0, 0, 0});  // a segment of its own, or many reads
      const std::uint32_t body = 1;
      Query large;
      large.bodies = std::span(&body, 1);
      large.configurations = poses;
      large.reduce = Reduce::kMin;
      EXPECT_EQ(client.distances(large).rows(), poses.size());
    }
    while (clients() > before) std::this_thread::yield();
  }
  const int after = descriptors();
  for (int i = 0; i < 5; ++i)
    for (const std::string& url : daemon_->urls()) connect(url).ping();
  while (descriptors() > after + 4) std::this_thread::yield();  // all but those of the last ones: nothing is left
}

INSTANTIATE_TEST_SUITE_P(Both, FdFilterProxy, testing::Values("off", "on"),
                         [](const auto& of) { return std::string(of.param) == "on" ? "Doorman" : "Kernel"; });

}  // namespace
}  // namespace clearance
