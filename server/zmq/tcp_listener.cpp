#include "server/zmq/tcp_listener.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "server/gateway/zmq_router.h"

namespace clearance {
namespace {

struct Place {
  std::string host, port;
};

/// Parses an endpoint. Rejects wrong addresses, and without keys those beyond the loopback.
Place check(const std::string& endpoint, bool with_keys) {
  std::string host = endpoint.substr(6);
  const std::size_t colon = host.rfind(':');
  if (colon == std::string::npos)
    throw std::runtime_error(endpoint + ": the port is missing, as in tcp://127.0.0.1:5555");
  const std::string port = host.substr(colon + 1);
  const bool digits = !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos;
  if (port != "*" && !(digits && std::stoi(port) >= 1 && std::stoi(port) <= 65535))
    throw std::runtime_error(endpoint + ": the port must be 1 to 65535, or * for a free one; got \"" + port + "\"");
  host.resize(colon);
  if (with_keys || host == "localhost" || host == "[::1]" || host == "lo" || host.rfind("127.", 0) == 0)
    return {host, port == "*" ? "0" : port};
  throw std::runtime_error(
      endpoint +
      ": anyone who reaches this address could move bodies; give --keys DIR (clearance keygen --help), "
      "or use ipc:// or tcp://127.0.0.1:PORT");
}

/// Address of a network interface, or empty.
std::string address_of_interface(const std::string& name) {
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return "";
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(all, &::freeifaddrs);
  for (const ifaddrs* one = all; one; one = one->ifa_next) {
    if (name != one->ifa_name || !one->ifa_addr || one->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN];
    const auto* address = reinterpret_cast<const sockaddr_in*>(one->ifa_addr);
    if (::inet_ntop(AF_INET, &address->sin_addr, text, sizeof text)) return text;
  }
  return "";
}

std::string url_of(int socket) {
  sockaddr_storage address{};
  socklen_t length = sizeof address;
  char host[NI_MAXHOST], port[NI_MAXSERV];
  if (::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &length) != 0 ||
      ::getnameinfo(reinterpret_cast<const sockaddr*>(&address), length, host, sizeof host, port, sizeof port,
                    NI_NUMERICHOST | NI_NUMERICSERV) != 0)
    throw std::runtime_error(std::strerror(errno));
  const std::string shown = address.ss_family == AF_INET6 ? "[" + std::string(host) + "]" : host;
  return "tcp://" + shown + ":" + port;
}

}  // namespace

TcpListener listen_tcp(const std::string& endpoint, bool with_keys) {
  Place place = check(endpoint, with_keys);
  const auto fail = [&endpoint](const std::string& cause) {
    throw std::runtime_error(endpoint + ": cannot listen there: " + cause);
  };
  if (place.host.size() > 2 && place.host.front() == '[' && place.host.back() == ']')
    place.host = place.host.substr(1, place.host.size() - 2);
  if (place.host == "*") place.host = "0.0.0.0";
  if (const std::string address = address_of_interface(place.host); !address.empty()) place.host = address;

  addrinfo hints{}, *found = nullptr;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  hints.ai_family = place.host.find(':') == std::string::npos ? AF_INET : AF_INET6;
  if (const int error = ::getaddrinfo(place.host.c_str(), place.port.c_str(), &hints, &found); error != 0)
    fail(::gai_strerror(error));
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(found, &::freeaddrinfo);
  TcpListener listener{
      shm::UniqueFd(::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, IPPROTO_TCP)), ""};
  const int yes = 1;
  if (!listener.socket || ::setsockopt(listener.socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0 ||
      ::bind(listener.socket.get(), found->ai_addr, found->ai_addrlen) != 0 ||
      ::listen(listener.socket.get(), kZmqBacklog) != 0)
    fail(std::strerror(errno));
  listener.url = url_of(listener.socket.get());
  return listener;
}

}  // namespace clearance
