#include "server/access/fd_filter_proxy.h"

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <sys/stat.h>

#include <cstdlib>
#include <deque>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <unordered_map>

#include "server/limits/places.h"

#ifndef SO_PASSRIGHTS  // of Linux 6.16, missing in the C libraries of Debian 12 and Ubuntu 24.04
#define SO_PASSRIGHTS 83
#endif

namespace clearance {
namespace {

using shm::UniqueFd;

/// Proxies of all endpoints, including those whose threads still close a peer's descriptors.
constexpr std::uint64_t kMostProxies = 1024;
constexpr std::size_t kThreadStackBytes = 256 << 10;
constexpr std::size_t kBufferBytes = 16 << 10;

bool set_passrights(int socket, int value) {
  return ::setsockopt(socket, SOL_SOCKET, SO_PASSRIGHTS, &value, sizeof value) == 0;
}

/// State shared by the proxies. Never freed, as their threads may end after everything else.
struct ProxyRegistry {
  std::mutex mutex;
  Places proxies{kMostProxies};
  std::unordered_map<ino_t, ucred> credentials;  // by the daemon's end
  struct PendingClose {
    UniqueFd peer;
    void (*close)(UniqueFd);
  };
  std::deque<PendingClose> closing;
  bool is_closing = false;  // a thread closes those in `closing`
};
ProxyRegistry& registry() {
  static ProxyRegistry* one = new ProxyRegistry;
  return *one;
}

ino_t inode_of(int socket) {
  struct stat info{};
  return ::fstat(socket, &info) == 0 ? info.st_ino : 0;
}

/// Starts a detached thread without signals and with a small stack.
bool run_detached(void* (*work)(void*), void* with) {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kThreadStackBytes);
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  pthread_t thread;
  const bool runs = pthread_create(&thread, &attributes, work, with) == 0;
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  pthread_attr_destroy(&attributes);
  return runs;
}

/// Bytes or one message on their way from one end to the other.
struct Direction {
  Direction(int from_end, int to_end, bool descriptors) : from(from_end), to(to_end), passes_descriptors(descriptors) {}

  int from, to;
  bool passes_descriptors;  ///< pass on the daemon's; the kernel drops a peer's
  std::size_t size = 0, sent = 0;
  bool ended = false, has_hung_up = false;  ///< end of input; the other end has hung up
  std::array<UniqueFd, shm::kMaxPassedFds> fds;
  std::byte data[kBufferBytes];

  bool is_full() const { return sent < size; }
  bool has_space() const { return !is_full() && !ended; }
  void take();
  void pass();
};

/// Receives bytes, or the first message. A message larger than the buffer is longer than any valid one and cut off.
void Direction::take() {
  iovec buffer{data, sizeof data};
  alignas(cmsghdr) std::byte control[CMSG_SPACE(sizeof(int) * shm::kMaxPassedFds)];
  msghdr header{};
  header.msg_iov = &buffer;
  header.msg_iovlen = 1;
  if (passes_descriptors) {
    header.msg_control = control;
    header.msg_controllen = sizeof control;
  }
  const ssize_t got = ::recvmsg(from, &header, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  // ECONNRESET comes once, before the last messages, if the peer closed with unread data.
  if (got < 0 && (errno == EAGAIN || errno == EINTR || errno == ECONNRESET)) return;
  ended = got <= 0;
  sent = 0;
  size = ended ? 0 : static_cast<std::size_t>(got);
  if (ended || !passes_descriptors) return;
  std::size_t next = 0;
  for (cmsghdr* c = CMSG_FIRSTHDR(&header); c; c = CMSG_NXTHDR(&header, c)) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SCM_RIGHTS) continue;
    const std::size_t count = (c->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (std::size_t i = 0; i < count && next < fds.size(); ++i) {
      int fd;
      std::memcpy(&fd, CMSG_DATA(c) + i * sizeof fd, sizeof fd);
      fds[next++].reset(fd);
    }
  }
}

/// Sends as much as possible.
void Direction::pass() {
  while (is_full() && !has_hung_up) {
    iovec rest{data + sent, size - sent};
    alignas(cmsghdr) std::byte control[CMSG_SPACE(sizeof(int) * shm::kMaxPassedFds)] = {};
    msghdr header{};
    header.msg_iov = &rest;
    header.msg_iovlen = 1;
    std::size_t count = 0;
    int numbers[shm::kMaxPassedFds];
    for (const UniqueFd& fd : fds)
      if (fd) numbers[count++] = fd.get();
    if (count > 0) {
      header.msg_control = control;
      header.msg_controllen = CMSG_SPACE(count * sizeof(int));
      cmsghdr* c = CMSG_FIRSTHDR(&header);
      c->cmsg_level = SOL_SOCKET;
      c->cmsg_type = SCM_RIGHTS;
      c->cmsg_len = CMSG_LEN(count * sizeof(int));
      std::memcpy(CMSG_DATA(c), numbers, count * sizeof(int));
    }
    const ssize_t now = ::sendmsg(to, &header, MSG_DONTWAIT | MSG_NOSIGNAL);
    if (now < 0 && errno == EINTR) continue;
    if (now < 0 && errno == EAGAIN) return;
    has_hung_up = now < 0;
    for (UniqueFd& fd : fds) fd.reset();
    sent += has_hung_up ? 0 : static_cast<std::size_t>(now);
  }
  if (has_hung_up) sent = size;
  if (ended) ::shutdown(to, SHUT_WR);
}

/// Both directions of one unauthenticated peer.
struct Proxy {
  UniqueFd peer, inner;
  ino_t inode;
  Places::Share place = {};  // guarded by the mutex of ProxyRegistry

  void serve() const;
  static void* run(void* self);
};

/// Runs until the daemon has closed its end, even if the peer has gone before, as the peer's credentials must remain
/// known.
void Proxy::serve() const {
  Direction in{peer.get(), inner.get(), false}, out{inner.get(), peer.get(), true};
  for (;;) {
    // An end without expected events is left out, except the daemon's, whose hang-up ends the proxy.
    const auto poll_events = [](const Direction& from_here, const Direction& to_here) {
      return static_cast<short>((from_here.has_space() ? POLLIN : 0) | (to_here.is_full() ? POLLOUT : 0));
    };
    const short of_peer = poll_events(in, out);
    pollfd ends[] = {{of_peer ? peer.get() : -1, of_peer, 0}, {inner.get(), poll_events(out, in), 0}};
    if (::poll(ends, 2, -1) < 0) continue;
    const bool hung_up = ends[1].revents & (POLLHUP | POLLERR);
    if (in.has_space() && ends[0].revents) in.take();
    if (out.has_space() && ends[1].revents) out.take();
    in.pass();
    out.pass();
    if (out.ended || (hung_up && out.is_full())) return;
  }
}

void* Proxy::run(void* self) {
  const std::unique_ptr<Proxy> proxy(static_cast<Proxy*>(self));
  proxy->serve();
  ProxyRegistry& r = registry();
  {
    const std::lock_guard lock(r.mutex);
    r.credentials.erase(proxy->inode);
  }
  proxy->inner.reset();
  proxy->peer.reset();  // may take long, if the peer likes
  const std::lock_guard lock(r.mutex);
  proxy->place = {};
  return nullptr;
}

void* close_pending(void*) {
  ProxyRegistry& r = registry();
  std::unique_lock lock(r.mutex);
  while (!r.closing.empty()) {
    ProxyRegistry::PendingClose first = std::move(r.closing.front());
    r.closing.pop_front();
    lock.unlock();
    first.close(std::move(first.peer));
    lock.lock();
  }
  r.is_closing = false;
  return nullptr;
}

}  // namespace

bool kernel_rejects_descriptors() {
  static const bool rejects = [] {
    const char* proxy = std::getenv("CLEARANCE_FD_FILTER_PROXY");
    if (proxy && std::string(proxy) == "on") return false;
    const UniqueFd probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    return probe && set_passrights(probe.get(), 0);
  }();
  return rejects;
}

void reject_descriptors(int listener) {
  if (kernel_rejects_descriptors() && !set_passrights(listener, 0))
    throw std::runtime_error(std::string("SO_PASSRIGHTS: ") + std::strerror(errno));
}

UniqueFd without_descriptors(UniqueFd peer) {
  if (!peer || kernel_rejects_descriptors()) return peer;
  ucred who{};
  int domain = 0, type = 0, ends[2];
  socklen_t who_bytes = sizeof who, domain_bytes = sizeof domain, type_bytes = sizeof type;
  if (::getsockopt(peer.get(), SOL_SOCKET, SO_DOMAIN, &domain, &domain_bytes) == 0 && domain != AF_UNIX) return peer;
  if (::getsockopt(peer.get(), SOL_SOCKET, SO_PEERCRED, &who, &who_bytes) != 0 ||
      ::getsockopt(peer.get(), SOL_SOCKET, SO_TYPE, &type, &type_bytes) != 0 ||
      ::socketpair(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) != 0) {
    close_detached(std::move(peer));
    return {};
  }
  UniqueFd outer(ends[0]);
  const ino_t inode = inode_of(outer.get());
  auto proxy = std::make_unique<Proxy>(Proxy{std::move(peer), UniqueFd(ends[1]), inode});
  ProxyRegistry& r = registry();
  std::unique_lock lock(r.mutex);
  if (r.proxies.why_not(who, "proxies").empty()) {
    proxy->place = r.proxies.take(who);
    r.credentials[inode] = who;
    if (run_detached(&Proxy::run, proxy.get())) {
      proxy.release();  // owned by the thread
      return outer;
    }
    proxy->place = {};
    r.credentials.erase(inode);
  }
  lock.unlock();
  close_detached(std::move(proxy->peer));
  return {};
}

void close_detached(UniqueFd peer, void (*close)(UniqueFd)) {
  if (kernel_rejects_descriptors()) {
    close(std::move(peer));
    return;
  }
  ProxyRegistry& r = registry();
  const std::lock_guard lock(r.mutex);
  r.closing.push_back({std::move(peer), close});
  // Without a thread the socket stays open until the next one is turned away.
  if (!r.is_closing) r.is_closing = run_detached(&close_pending, nullptr);
}

bool credentials_of_proxied(int socket, ucred& who) {
  if (kernel_rejects_descriptors()) return false;
  ProxyRegistry& r = registry();
  const ino_t inode = inode_of(socket);
  const std::lock_guard lock(r.mutex);
  const auto found = r.credentials.find(inode);
  if (found != r.credentials.end()) who = found->second;
  return found != r.credentials.end();
}

}  // namespace clearance
