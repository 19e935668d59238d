// System calls for both ends of the shared-memory transport: descriptors, messages with descriptors, futex.
#pragma once

#include <linux/futex.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>

#include "wire/shm_layout.h"

namespace clearance::shm {

/// An owned descriptor, closed by the destructor.
class UniqueFd {
 public:
  UniqueFd() = default;
  explicit UniqueFd(int fd) : fd_(fd) {}
  UniqueFd(UniqueFd&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UniqueFd& operator=(UniqueFd&& other) noexcept {
    if (this != &other) reset(std::exchange(other.fd_, -1));
    return *this;
  }
  ~UniqueFd() { reset(); }

  int get() const { return fd_; }
  explicit operator bool() const { return fd_ >= 0; }
  int release() { return std::exchange(fd_, -1); }
  void reset(int fd = -1) {
    if (fd_ >= 0) ::close(fd_);
    fd_ = fd;
  }

 private:
  int fd_ = -1;
};

inline constexpr int kMaxPassedFds = 2;

/// Sends one message with up to kMaxPassedFds descriptors, without blocking. On failure, returns false with errno set.
inline bool send_message(int socket, const Message& message, std::span<const int> fds = {}) {
  iovec data{const_cast<Message*>(&message), sizeof message};
  alignas(cmsghdr) std::byte control[CMSG_SPACE(sizeof(int) * kMaxPassedFds)] = {};
  msghdr header{};
  header.msg_iov = &data;
  header.msg_iovlen = 1;
  if (!fds.empty()) {
    header.msg_control = control;
    header.msg_controllen = CMSG_SPACE(fds.size_bytes());
    cmsghdr* c = CMSG_FIRSTHDR(&header);
    c->cmsg_level = SOL_SOCKET;
    c->cmsg_type = SCM_RIGHTS;
    c->cmsg_len = CMSG_LEN(fds.size_bytes());
    std::memcpy(CMSG_DATA(c), fds.data(), fds.size_bytes());
  }
  ssize_t sent;
  do sent = ::sendmsg(socket, &header, MSG_NOSIGNAL | MSG_DONTWAIT);
  while (sent < 0 && errno == EINTR);
  return sent == static_cast<ssize_t>(sizeof message);
}

/// Receives one message with its descriptors, all of them owned by the result, without blocking.
/// Returns the bytes received; 0 if the peer is gone; -1 with errno for no message (EAGAIN) or an error.
inline ssize_t receive_message(int socket, Message& message, std::array<UniqueFd, kMaxPassedFds>* fds = nullptr) {
  message = Message{};
  iovec data{&message, sizeof message};
  alignas(cmsghdr) std::byte control[CMSG_SPACE(sizeof(int) * kMaxPassedFds)];
  msghdr header{};
  header.msg_iov = &data;
  header.msg_iovlen = 1;
  header.msg_control = control;
  header.msg_controllen = sizeof control;
  ssize_t received;
  do received = ::recvmsg(socket, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  while (received < 0 && errno == EINTR);
  const int error = errno;
  if (received >= 0) {
    int next = 0;
    for (cmsghdr* c = CMSG_FIRSTHDR(&header); c; c = CMSG_NXTHDR(&header, c)) {
      if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) continue;
      const std::size_t count = (c->cmsg_len - CMSG_LEN(0)) / sizeof(int);
      for (std::size_t i = 0; i < count; ++i) {
        int fd;
        std::memcpy(&fd, CMSG_DATA(c) + i * sizeof fd, sizeof fd);
        UniqueFd owned(fd);
        if (fds && next < kMaxPassedFds) (*fds)[next++] = std::move(owned);
      }
    }
  }
  errno = error;
  return received;
}

/// Sets the address of a socket path. Returns false if the path is empty or longer than 107 bytes.
inline bool socket_address(const char* path, sockaddr_un& address) {
  address = {};
  address.sun_family = AF_UNIX;
  const std::size_t length = std::strlen(path);
  if (length == 0 || length >= sizeof address.sun_path) return false;
  std::memcpy(address.sun_path, path, length + 1);
  return true;
}

/// Waits while `word` equals `seen`, for at most `timeout`; may return early. Works between processes.
inline void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t seen, std::chrono::nanoseconds timeout) {
  if (timeout <= std::chrono::nanoseconds::zero()) return;
  const timespec relative{timeout.count() / 1'000'000'000, timeout.count() % 1'000'000'000};
  ::syscall(SYS_futex, &word, FUTEX_WAIT, seen, &relative, nullptr, 0);
}

/// Wakes the threads that wait on `word`.
inline void futex_wake(const std::atomic<std::uint32_t>& word) {
  ::syscall(SYS_futex, &word, FUTEX_WAKE, 1, nullptr, nullptr, 0);
}

/// Prefetches the cache lines of memory that is read or written soon. The transfers between cores overlap, unlike those
/// of dependent loads.
inline constexpr std::size_t kPrefetched = 512;
inline void prefetch_to_read(const std::byte* begin) {
  for (std::size_t at = 0; at < kPrefetched; at += kCacheLine) __builtin_prefetch(begin + at, 0);
}
inline void prefetch_to_write(const std::byte* begin) {
  for (std::size_t at = 0; at < kPrefetched; at += kCacheLine) __builtin_prefetch(begin + at, 1);
}

/// Hint to the core for a spin loop.
inline void cpu_relax() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

/// Number of times that the kernel took the core from this thread for another one.
inline long preemptions() {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return usage.ru_nivcsw;
}

}  // namespace clearance::shm
