// A process without free descriptors: new connections are closed, on either thread that accepts them, and the reserved
// descriptor for that is never lost.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <filesystem>
#include <thread>

#include "server/access/accepting.h"
#include "server/base/unix_socket.h"
#include "tests/faults/limits.h"
#include "tests/server/daemon_fixture.h"
#include "wire/shm_os.h"

namespace clearance {
namespace {

using shm::UniqueFd;

constexpr int kRounds = 1000;

UniqueFd socket_at(const std::string& path, bool listening) {
  sockaddr_un address;
  shm::socket_address(path.c_str(), address);
  UniqueFd socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | (listening ? SOCK_NONBLOCK : 0), 0));
  const auto* at = reinterpret_cast<const sockaddr*>(&address);
  const int failed = listening ? ::bind(socket.get(), at, sizeof address) || ::listen(socket.get(), 4)
                               : ::connect(socket.get(), at, sizeof address);
  if (failed) throw std::runtime_error(path + ": " + std::strerror(errno));
  return socket;
}

/// Connects to each in turn, as soon as the previous one has hung up. Returns the number that sent anything.
int connect_to(const std::array<std::string, 2>& paths) {
  int answered = 0;
  for (int i = 0; i < kRounds; ++i)
    for (const std::string& path : paths) {
      char byte;
      answered += ::recv(socket_at(path, false).get(), &byte, 1, 0) != 0;
    }
  return answered;
}

std::ptrdiff_t descriptors() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
}

TEST(Accepting, WithoutDescriptorsAllAreTurnedAwayAndTheReserveStays) {
  const TestFolder folder;
  const std::array<std::string, 2> paths{folder / "a", folder / "b"};
  const std::array<UniqueFd, 2> listeners{socket_at(paths[0], true), socket_at(paths[1], true)};
  const pid_t child = ::fork();
  if (child == 0) ::_exit(connect_to(paths) == 0 ? 0 : 1);
  reserve_descriptor();
  const std::ptrdiff_t before = descriptors();

  std::atomic<int> served{0}, rejected{0};
  {
    const faults::Limit limit(::getpid(), RLIMIT_NOFILE, faults::descriptors_for(::getpid(), 0));
    ASSERT_LT(::open("/dev/null", O_RDONLY), 0) << "this test would show nothing";
    const auto take_all = [&](int listener) {
      while (served + rejected < 2 * kRounds) {
        pollfd ready{listener, POLLIN, 0};
        if (::poll(&ready, 1, 10) > 0 && UniqueFd(accept_or_reject(listener, [&](int) { ++rejected; }))) ++served;
      }
    };
    std::thread other(take_all, listeners[1].get());
    take_all(listeners[0].get());
    other.join();
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(served, 0);
  EXPECT_EQ(rejected, 2 * kRounds);
  EXPECT_EQ(descriptors(), before);
}

}  // namespace
}  // namespace clearance
