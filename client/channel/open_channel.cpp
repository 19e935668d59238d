#include <cstdlib>
#include <stdexcept>

#include "client/channel/channel.h"
#include "client/channel/url.h"
#include "client/client.h"

namespace clearance {
namespace {

/// Returns the keys of the url, the options or the environment, in this order of precedence.
ChannelKeys keys_of(const std::string& url, const Url& parsed, const ConnectOptions& options) {
  const auto choose = [](const std::string& option, const std::string& in_url, const char* variable) {
    const char* value = std::getenv(variable);
    return !option.empty() ? option : !in_url.empty() ? in_url : value ? std::string(value) : std::string();
  };
  const bool tcp = url.rfind("tcp://", 0) == 0;
  const std::string server = tcp ? choose(options.server_key, parsed.server_key, "CLEARANCE_SERVER_KEY") : "";
  const std::string own = tcp ? choose(options.key, parsed.key, "CLEARANCE_KEY") : "";
  if (server.empty() != own.empty())
    throw std::invalid_argument(url + ": needs both the daemon's key and this client's; " +
                                (server.empty() ? "server_key is missing" : "key is missing"));
  if (server.empty()) return {};
  try {
    return {read_public_key(server), read_key_pair(own)};
  } catch (const std::runtime_error& error) {
    throw ConnectionError(url + ": " + error.what());
  }
}

}  // namespace

std::unique_ptr<Channel> open_channel(const std::string& url, const ConnectOptions& options, Deadline deadline) {
  const Url parsed = parse_url(url);
  switch (parsed.kind) {
    case UrlKind::kShm:
#ifdef CLEARANCE_HAVE_SHM
      return open_shm_channel(parsed.target, deadline);
#else
      break;
#endif
    case UrlKind::kZmq:
#ifdef CLEARANCE_HAVE_ZMQ
      return open_zmq_channel(parsed.target, keys_of(url, parsed, options), deadline);
#else
      break;
#endif
    case UrlKind::kLcm:
#ifdef CLEARANCE_HAVE_LCM
      return open_lcm_channel(parsed.target, parsed.prefix, deadline);
#else
      break;
#endif
  }
  throw ConnectionError(url + ": this client was built without that transport");
}

}  // namespace clearance
