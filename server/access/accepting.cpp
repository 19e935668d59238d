#include "server/access/accepting.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <mutex>
#include <utility>

#include "server/access/fd_filter_proxy.h"

namespace clearance {
namespace {

std::mutex mutex;  // the loop's thread's and libzmq's threads share this
int null_device = -1;
int reserve = -1;

int system_accept(int listener, sockaddr* address, socklen_t* length, int flags) {
  return static_cast<int>(::syscall(SYS_accept4, listener, address, length, flags));
}

bool is_exhausted(int error) {
  return error == EMFILE || error == ENFILE || error == ENOBUFS || error == ENOMEM;
}

// Does nothing before a reserve was requested.
void keep_reserve() {
  if (reserve < 0 && null_device >= 0) reserve = ::fcntl(null_device, F_DUPFD_CLOEXEC, 0);
}

/// Closes a connection that was taken in the reserve's place and makes that descriptor the reserve again, in one step,
/// as another thread could take it in between. Closing takes as long as the peer's queued descriptors like, so it
/// happens without the lock.
void close_into_reserve(shm::UniqueFd unwanted) {
  if (::dup3(null_device, unwanted.get(), O_CLOEXEC) < 0) return;
  const std::lock_guard lock(mutex);
  if (reserve < 0) reserve = unwanted.release();
}

/// A connection, or one taken in the reserve's place, which must be rejected.
struct Taken {
  int socket = -1;
  shm::UniqueFd unwanted;
};
Taken take(int listener, sockaddr* address, socklen_t* length, int flags) {
  const std::lock_guard lock(mutex);
  keep_reserve();
  Taken taken{system_accept(listener, address, length, flags), {}};
  if (taken.socket >= 0 || !is_exhausted(errno)) return taken;
  if (reserve >= 0) ::close(std::exchange(reserve, -1));
  taken.unwanted.reset(system_accept(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (!taken.unwanted) keep_reserve();
  errno = ECONNABORTED;
  return taken;
}

}  // namespace

int accept_or_reject(int listener, const std::function<void(int)>& reject) {
  Taken taken = take(listener, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (taken.unwanted) {
    reject(taken.unwanted.get());
    close_detached(std::move(taken.unwanted), &close_into_reserve);
  }
  return taken.socket;
}

void reserve_descriptor() {
  const std::lock_guard lock(mutex);
  if (null_device < 0) null_device = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  keep_reserve();
}

}  // namespace clearance

// Replaces the C library's function for libzmq, which gets ECONNABORTED for a client that hung up before it was
// accepted.
extern "C" __attribute__((visibility("default"))) int accept4(int listener, sockaddr* address, socklen_t* length,
                                                              int flags) {
  clearance::Taken taken = clearance::take(listener, address, length, flags);
  if (taken.socket >= 0) {
    const int inner = clearance::without_descriptors(clearance::shm::UniqueFd(taken.socket)).release();
    if (inner < 0) errno = ECONNABORTED;
    return inner;
  }
  const int error = errno;
  if (taken.unwanted) clearance::close_detached(std::move(taken.unwanted), &clearance::close_into_reserve);
  errno = error;
  return -1;
}

// Replaces the C library's function for libzmq. Credentials are read from the connection behind the socket.
extern "C" __attribute__((visibility("default"))) int getsockopt(int socket, int level, int name, void* value,
                                                                 socklen_t* length) {
  const long failed = ::syscall(SYS_getsockopt, socket, level, name, value, length);
  ucred who;
  if (!failed && level == SOL_SOCKET && name == SO_PEERCRED && *length == sizeof who &&
      clearance::credentials_of_proxied(socket, who))
    std::memcpy(value, &who, sizeof who);
  return static_cast<int>(failed);
}

extern "C" __attribute__((visibility("default"))) int accept(int listener, sockaddr* address, socklen_t* length) {
  return accept4(listener, address, length, 0);
}
