#include "wire/lcm/lcm_bus.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <lcm/lcm.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/random.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <utility>

namespace clearance {
namespace {

constexpr std::size_t kMaxPrefixBytes = 40;  // liblcm takes channel names of 63 bytes
constexpr long kWantedReceiveBuffer = 4 << 20;

/// Closes a descriptor.
class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() {
    if (fd_ >= 0) ::close(fd_);
  }
  Fd(const Fd&) = delete;
  Fd& operator=(const Fd&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

[[noreturn]] void bad_url(const std::string& url, const std::string& what) {
  throw std::invalid_argument("LCM url '" + url + "': " + what);
}

template <class T>
bool parse_number(std::string_view text, T& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

bool good_prefix(std::string_view prefix) {
  return prefix.size() <= kMaxPrefixBytes && std::all_of(prefix.begin(), prefix.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
                  c == '/';
         });
}

std::string remedy(const LcmAddress& address) {
  return "; to keep LCM on this host, run (as root):  ip link set lo up; ip route add " + address.host + "/32 dev lo";
}

sockaddr_in socket_address(const std::string& host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  inet_pton(AF_INET, host.c_str(), &address.sin_addr);
  return address;
}

/// Returns the granted buffer size, since liblcm warns on stderr about a request beyond it.
long granted_receive_buffer() {
  long limit = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> limit;
  return std::min(limit, kWantedReceiveBuffer);
}

}  // namespace

std::string LcmAddress::url() const {
  std::string text = "udpm://" + host + ":" + std::to_string(port) + "?ttl=" + std::to_string(ttl);
  if (!prefix.empty()) text += "&prefix=" + prefix;
  return text;
}

LcmAddress parse_lcm_address(const std::string& url) {
  constexpr std::string_view kScheme = "udpm://";
  if (url.rfind(kScheme, 0) != 0) bad_url(url, "expected udpm://GROUP:PORT?ttl=0");
  LcmAddress address;
  const std::size_t question_mark = std::min(url.find('?'), url.size());
  const std::string_view place = std::string_view(url).substr(kScheme.size(), question_mark - kScheme.size());
  if (!place.empty()) {
    const std::size_t colon = std::min(place.find(':'), place.size());
    address.host = place.substr(0, colon);
    if (colon < place.size() && (!parse_number(place.substr(colon + 1), address.port) || address.port == 0)) {
      bad_url(url, "port: expected a number from 1 to 65535, got '" + std::string(place.substr(colon + 1)) + "'");
    }
  }
  in_addr group{};
  if (inet_pton(AF_INET, address.host.c_str(), &group) != 1 || !IN_MULTICAST(ntohl(group.s_addr))) {
    bad_url(url, "group: expected a multicast address (224.0.0.0 to 239.255.255.255), got '" + address.host + "'");
  }

  std::string_view rest = std::string_view(url).substr(std::min(question_mark + 1, url.size()));
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('&'), rest.size());
    const std::string_view option = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    const std::size_t equals = std::min(option.find('='), option.size());
    const std::string_view key = option.substr(0, equals);
    const std::string_view value = option.substr(std::min(equals + 1, option.size()));
    if (key == "ttl") {
      if (!parse_number(value, address.ttl) || address.ttl < 0 || address.ttl > 255) {
        bad_url(url, "ttl: expected 0 (this host) to 255, got '" + std::string(value) + "'");
      }
    } else if (key == "recv_buf_size") {
      if (!parse_number(value, address.recv_buf_size) || address.recv_buf_size < 0 ||
          address.recv_buf_size > (1l << 30)) {
        bad_url(url, "recv_buf_size: expected bytes up to 1073741824, got '" + std::string(value) + "'");
      }
    } else if (key == "prefix") {
      address.prefix = value;
      if (!good_prefix(value)) {
        bad_url(url, "prefix: expected up to 40 letters, digits, '_', '-' or '/', got '" + std::string(value) + "'");
      }
    } else if (key == "distances_hz") {
      if (!parse_number(value, address.distances_hz) || !(address.distances_hz >= 0 && address.distances_hz <= 1e4)) {
        bad_url(url, "distances_hz: expected 0 (none) to 10000, got '" + std::string(value) + "'");
      }
    } else {
      bad_url(url, "unknown option '" + std::string(key) + "' (known: ttl, recv_buf_size, prefix, distances_hz)");
    }
  }
  return address;
}

void check_multicast(const LcmAddress& address) {
  const auto fail = [&](const std::string& what, int error) {
    throw std::runtime_error("LCM: no multicast route to " + address.host + ": " + what +
                             (error != 0 ? std::string(" (") + std::strerror(error) + ")" : "") + remedy(address));
  };
  const sockaddr_in group = socket_address(address.host, address.port);
  const Fd route(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (route.get() < 0) throw std::runtime_error(std::string("LCM: no UDP socket: ") + std::strerror(errno));
  if (::connect(route.get(), reinterpret_cast<const sockaddr*>(&group), sizeof group) < 0) {
    fail("cannot send there", errno);
  }

  // A route alone is no proof: its interface may lack multicast, or a firewall may drop the packets. So this sends a
  // packet, from the kind of sockets that liblcm opens but on another port, and waits for it.
  const Fd receiver(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in place = socket_address(address.host, 0);
  ip_mreq membership{};
  membership.imr_multiaddr = group.sin_addr;
  if (::bind(receiver.get(), reinterpret_cast<const sockaddr*>(&place), sizeof place) < 0) {
    fail("cannot listen on its address", errno);
  }
  if (::setsockopt(receiver.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) < 0) {
    fail("the group cannot be joined", errno);
  }
  socklen_t size = sizeof place;
  ::getsockname(receiver.get(), reinterpret_cast<sockaddr*>(&place), &size);
  const Fd sender(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const unsigned char ttl = 0;
  ::setsockopt(sender.get(), IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  const std::int64_t token = draw_lcm_id();
  for (int attempt = 0; attempt < 10; ++attempt) {
    if (::sendto(sender.get(), &token, sizeof token, 0, reinterpret_cast<const sockaddr*>(&place), sizeof place) < 0) {
      fail("cannot send there", errno);
    }
    pollfd waiting{receiver.get(), POLLIN, 0};
    while (::poll(&waiting, 1, 100) > 0) {
      std::int64_t got = 0;
      if (::recv(receiver.get(), &got, sizeof got, MSG_DONTWAIT) == sizeof got && got == token) return;
    }
  }
  fail("packets do not come back, since the route's interface has no multicast or a firewall drops them", 0);
}

std::int64_t draw_lcm_id() {
  std::uint64_t id = 0;
  while (id == 0) {
    if (::getrandom(&id, sizeof id, 0) != sizeof id) throw std::runtime_error("getrandom failed");
    id >>= 1;
  }
  return static_cast<std::int64_t>(id);
}

struct LcmBus::Subscription {
  LcmBus* bus;
  Handler handler;

  static void receive(const lcm_recv_buf_t* buffer, const char*, void* user) {
    auto* self = static_cast<Subscription*>(user);
    // A packet with an unterminated channel name has a negative size.
    if (buffer->data_size > (1u << 30)) return;
    try {
      self->handler({static_cast<const std::byte*>(buffer->data), buffer->data_size});
    } catch (...) {
      self->bus->thrown_ = std::current_exception();
    }
  }
};

LcmBus::LcmBus(const LcmAddress& address) : address_(address) {
  if (!good_prefix(address.prefix)) throw std::runtime_error("LCM: bad channel prefix '" + address.prefix + "'");
  check_multicast(address);
  const long buffer = address.recv_buf_size > 0 ? address.recv_buf_size : granted_receive_buffer();
  const std::string url = "udpm://" + address.host + ":" + std::to_string(address.port) +
                          "?ttl=" + std::to_string(address.ttl) +
                          (buffer > 0 ? "&recv_buf_size=" + std::to_string(buffer) : "");
  lcm_ = lcm_create(url.c_str());
  if (lcm_ != nullptr) descriptor_ = lcm_get_fileno(lcm_);
  if (descriptor_ < 0) {
    if (lcm_ != nullptr) lcm_destroy(lcm_);
    throw std::runtime_error("LCM: cannot open " + url + " (liblcm prints the cause on stderr)");
  }
}

LcmBus::~LcmBus() {
  lcm_destroy(lcm_);
}

void LcmBus::subscribe(const std::string& name, int queue, Handler handler) {
  subscriptions_.push_back(std::make_unique<Subscription>(Subscription{this, std::move(handler)}));
  // liblcm treats a name as a regular expression; good_prefix() rejects special characters.
  lcm_subscription_t* subscription =
      lcm_subscribe(lcm_, (address_.prefix + name).c_str(), &Subscription::receive, subscriptions_.back().get());
  if (subscription == nullptr) throw std::runtime_error("LCM: cannot subscribe to " + address_.prefix + name);
  lcm_subscription_set_queue_capacity(subscription, queue);
}

bool LcmBus::publish(const std::string& name, std::span<const std::byte> message) {
  return lcm_publish(lcm_, (address_.prefix + name).c_str(), message.data(),
                     static_cast<unsigned int>(message.size())) == 0;
}

bool LcmBus::handle() {
  // poll() instead of lcm_handle_timeout(), which uses select() and fails beyond descriptor 1023.
  pollfd waiting{descriptor_, POLLIN, 0};
  if (::poll(&waiting, 1, 0) <= 0) return false;
  const int result = lcm_handle(lcm_);
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
  if (result != 0) throw std::runtime_error("LCM: cannot receive a message (liblcm prints the cause on stderr)");
  return true;
}

bool LcmBus::wait(std::chrono::steady_clock::time_point deadline) const {
  while (true) {
    const auto left = deadline - std::chrono::steady_clock::now();
    const auto left_ms = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    pollfd waiting{descriptor_, POLLIN, 0};
    const int result = ::poll(&waiting, 1, static_cast<int>(std::clamp<long long>(left_ms, 0, 60000)));
    if (result > 0) return true;
    if (result < 0 && errno != EINTR) return false;
    if (std::chrono::steady_clock::now() >= deadline) return false;
  }
}

bool LcmPacer::ready(Clock::time_point now) {
  const double passed = std::chrono::duration<double>(now - last_).count();
  last_ = now;
  allowance_ = std::min(kBurstBytes, allowance_ + passed * bytes_per_second_);
  return allowance_ > 0;
}

std::chrono::nanoseconds LcmPacer::pause() const {
  const double seconds = std::max(0.0, -allowance_) / bytes_per_second_;
  return std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9) + 100000);
}

}  // namespace clearance
