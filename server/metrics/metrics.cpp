#include "server/metrics/metrics.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "server/access/accepting.h"
#include "server/access/access.h"
#include "server/access/fd_filter_proxy.h"
#include "server/base/real_time.h"
#include "wire/prometheus.h"

namespace clearance {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kMaxHttpRequestBytes = 4096;
constexpr std::chrono::seconds kPatience{1};

[[noreturn]] void fail_metrics(const std::string& endpoint, const std::string& cause) {
  throw std::runtime_error("--metrics " + endpoint + ": " + cause);
}

shm::UniqueFd listen_on(const std::string& endpoint, int family, const sockaddr* address, socklen_t bytes) {
  shm::UniqueFd listener(::socket(family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int yes = 1;
  if (!listener ||
      (family != AF_UNIX && ::setsockopt(listener.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0) ||
      ::bind(listener.get(), address, bytes) != 0)
    fail_metrics(endpoint, std::string("cannot listen there: ") + std::strerror(errno));
  if (family == AF_UNIX) reject_descriptors(listener.get());
  return listener;
}

/// Listens on the loopback and sets the port in `url`.
shm::UniqueFd listen_on_loopback(const std::string& endpoint, std::string& url) {
  const std::size_t colon = endpoint.rfind(':');
  std::string host = colon == std::string::npos ? "" : endpoint.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  addrinfo hints{}, *found = nullptr;
  hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  if (host.empty() || ::getaddrinfo(host.c_str(), endpoint.c_str() + colon + 1, &hints, &found) != 0)
    fail_metrics(endpoint, "expected 127.0.0.1:PORT, [::1]:PORT or the path of a Unix socket");
  const bool loopback = found->ai_family == AF_INET
                            ? ntohl(reinterpret_cast<const sockaddr_in*>(found->ai_addr)->sin_addr.s_addr) >> 24 == 127
                            : IN6_IS_ADDR_LOOPBACK(&reinterpret_cast<const sockaddr_in6*>(found->ai_addr)->sin6_addr);
  if (!loopback) {
    ::freeaddrinfo(found);
    fail_metrics(endpoint, "it is for the loopback only, since it has no authentication; put a proxy before it");
  }
  shm::UniqueFd listener;
  try {
    listener = listen_on(endpoint, found->ai_family, found->ai_addr, found->ai_addrlen);
  } catch (...) {
    ::freeaddrinfo(found);
    throw;
  }
  ::freeaddrinfo(found);
  sockaddr_storage bound{};
  socklen_t length = sizeof bound;
  ::getsockname(listener.get(), reinterpret_cast<sockaddr*>(&bound), &length);
  const std::uint16_t port = bound.ss_family == AF_INET ? reinterpret_cast<const sockaddr_in&>(bound).sin_port
                                                        : reinterpret_cast<const sockaddr_in6&>(bound).sin6_port;
  url = "http://" + endpoint.substr(0, colon) + ':' + std::to_string(ntohs(port)) + "/metrics";
  return listener;
}

shm::UniqueFd listen_on_path(const std::string& path, SocketFile& file) {
  sockaddr_un address;
  if (!shm::socket_address(path.c_str(), address)) fail_metrics(path, "the path of the socket is too long");
  const FolderLock lock(path);
  clear_stale_socket(path, "--metrics " + path);
  shm::UniqueFd listener = listen_on(path, AF_UNIX, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  file = SocketFile(path);
  set_socket_mode(path, "--metrics " + path, {});
  return listener;
}

std::string response(const char* status, const std::string& body) {
  return std::string("HTTP/1.0 ") + status +
         "\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\nContent-Length: " +
         std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + body;
}

/// Waits until a connection is readable or writable. Returns false after the deadline.
bool await(int connection, short events, Clock::time_point deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
  pollfd waiting{connection, events, 0};
  return left.count() > 0 && ::poll(&waiting, 1, static_cast<int>(left.count())) > 0;
}

}  // namespace

MetricsServer::MetricsServer(const std::string& endpoint, Read read) : read_(std::move(read)) {
  if (!endpoint.empty() && endpoint[0] == '/') {
    listener_ = listen_on_path(endpoint, file_);
    url_ = "unix:" + endpoint;
  } else {
    listener_ = listen_on_loopback(endpoint, url_);
  }
  stop_.reset(::eventfd(0, EFD_CLOEXEC));
  if (!stop_ || ::listen(listener_.get(), 16) != 0)
    fail_metrics(endpoint, std::string("cannot listen there: ") + std::strerror(errno));
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);  // signals are for the loop
  thread_ = std::thread([this] { run(); });
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

MetricsServer::~MetricsServer() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = ::write(stop_.get(), &one, sizeof one);
  thread_.join();
}

void MetricsServer::run() {
  run_behind();
  for (;;) {
    pollfd waiting[] = {{stop_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}};
    if (::poll(waiting, 2, -1) < 0) continue;
    if (waiting[0].revents) return;
    const shm::UniqueFd connection = without_descriptors(shm::UniqueFd(accept_or_reject(listener_.get(), [](int) {})));
    if (connection) serve(connection.get());
  }
}

void MetricsServer::serve(int connection) const {
  const auto deadline = Clock::now() + kPatience;
  std::string request;
  while (request.find("\r\n\r\n") == std::string::npos && request.find("\n\n") == std::string::npos) {
    char buffer[1024];
    if (request.size() > kMaxHttpRequestBytes || !await(connection, POLLIN, deadline)) return;
    const ssize_t got = ::recv(connection, buffer, sizeof buffer, 0);
    if (got <= 0) return;
    request.append(buffer, static_cast<std::size_t>(got));
  }
  const std::string reply = answer(request);
  for (std::size_t sent = 0; sent < reply.size() && await(connection, POLLOUT, deadline);) {
    const ssize_t now = ::send(connection, reply.data() + sent, reply.size() - sent, MSG_NOSIGNAL);
    if (now <= 0) return;
    sent += static_cast<std::size_t>(now);
  }
}

std::string MetricsServer::answer(const std::string& request) const {
  const std::string line = request.substr(0, request.find_first_of("\r\n"));
  const std::size_t path_at = line.find(' ');
  const std::size_t path_end = line.find(' ', path_at == std::string::npos ? 0 : path_at + 1);
  if (path_end == std::string::npos || line.compare(path_end, 6, " HTTP/") != 0)
    return response("400 Bad Request", "not HTTP\n");
  if (line.compare(0, path_at, "GET") != 0) return response("405 Method Not Allowed", "only GET is supported\n");
  const std::string path = line.substr(path_at + 1, path_end - path_at - 1);
  if (path != "/metrics" && path != "/errors") return response("404 Not Found", "there are /metrics and /errors\n");
  const std::optional<Stats::MetricsSnapshot> metrics = read_();
  if (!metrics) return response("503 Service Unavailable", "the daemon's loop did not answer in time\n");
  return response("200 OK", path == "/errors" ? error_text(metrics->errors) : prometheus_text(metrics->counters));
}

}  // namespace clearance
