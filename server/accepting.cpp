#include "accepting.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <mutex>

#include "doorman.h"

namespace clearance {
namespace {

std::mutex mutex;  // the loop's thread and libzmq's
int reserve = -1;

int system_accept(int listener, sockaddr* address, socklen_t* length, int flags) {
  return static_cast<int>(::syscall(SYS_accept4, listener, address, length, flags));
}

bool is_exhausted(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

void keep_reserve() {
  if (reserve < 0) reserve = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
}

/// Takes one connection in the reserve's place and closes it.
void shed(int listener, const std::function<void(int)>& refuse) {
  shm::UniqueFd unwanted;
  {
    const std::lock_guard lock(mutex);
    if (reserve >= 0) ::close(reserve);
    reserve = -1;
    unwanted.reset(system_accept(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!unwanted) keep_reserve();
  }
  if (!unwanted) return;
  if (refuse) refuse(unwanted.get());
  turn_away(std::move(unwanted), &reserve_descriptor);
}

}  // namespace

int accept_or_refuse(int listener, const std::function<void(int)>& refuse) {
  const int socket = system_accept(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (socket < 0 && is_exhausted(errno)) shed(listener, refuse);
  return socket;
}

void reserve_descriptor() {
  const std::lock_guard lock(mutex);
  keep_reserve();
}

}  // namespace clearance

// In place of the C library's, for libzmq. ECONNABORTED is what it hears of a client that hung up before it was taken.
extern "C" __attribute__((visibility("default"))) int accept4(int listener, sockaddr* address, socklen_t* length,
                                                              int flags) {
  const int socket = clearance::system_accept(listener, address, length, flags);
  if (socket >= 0) {
    const int inner = clearance::let_in(clearance::shm::UniqueFd(socket)).release();
    if (inner < 0) errno = ECONNABORTED;
    return inner;
  }
  if (!clearance::is_exhausted(errno)) return socket;
  clearance::shed(listener, {});
  errno = ECONNABORTED;
  return -1;
}

// Likewise: whose process is at the other end is asked of the connection that a socket stands for.
extern "C" __attribute__((visibility("default"))) int getsockopt(int socket, int level, int name, void* value,
                                                                 socklen_t* length) {
  const long failed = ::syscall(SYS_getsockopt, socket, level, name, value, length);
  ucred who;
  if (!failed && level == SOL_SOCKET && name == SO_PEERCRED && *length == sizeof who &&
      clearance::credentials_behind(socket, who))
    std::memcpy(value, &who, sizeof who);
  return static_cast<int>(failed);
}

extern "C" __attribute__((visibility("default"))) int accept(int listener, sockaddr* address, socklen_t* length) {
  return accept4(listener, address, length, 0);
}
