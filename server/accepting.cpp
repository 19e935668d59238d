#include "accepting.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <mutex>

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
  const std::lock_guard lock(mutex);
  if (reserve >= 0) ::close(reserve);
  reserve = -1;
  const int socket = system_accept(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (socket >= 0) {
    if (refuse) refuse(socket);
    ::close(socket);
  }
  keep_reserve();
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
  if (socket >= 0 || !clearance::is_exhausted(errno)) return socket;
  clearance::shed(listener, {});
  errno = ECONNABORTED;
  return -1;
}

extern "C" __attribute__((visibility("default"))) int accept(int listener, sockaddr* address, socklen_t* length) {
  return accept4(listener, address, length, 0);
}
