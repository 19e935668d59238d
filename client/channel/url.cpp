#include "client/channel/url.h"

#include <stdexcept>

namespace clearance {
namespace {

bool starts_with(const std::string& text, const char* prefix) {
  return text.rfind(prefix, 0) == 0;
}

/// Removes "NAME=..." from the options after the '?' of a url. Returns its value, or empty.
std::string take_option(std::string& url, const std::string& name) {
  const std::size_t question = url.find('?');
  if (question == std::string::npos) return "";
  std::string kept, value;
  for (std::size_t at = question + 1; at <= url.size();) {
    const std::size_t end = std::min(url.find('&', at), url.size());
    const std::string option = url.substr(at, end - at);
    if (option.rfind(name + "=", 0) == 0)
      value = option.substr(name.size() + 1);
    else if (!option.empty())
      kept += (kept.empty() ? "?" : "&") + option;
    at = end + 1;
  }
  url = url.substr(0, question) + kept;
  return value;
}

Url parse_zmq(const std::string& url) {
  Url parsed{UrlKind::kZmq, url, "", "", ""};
  if (starts_with(url, "tcp://")) {
    parsed.server_key = take_option(parsed.target, "server_key");
    parsed.key = take_option(parsed.target, "key");
    if (const std::size_t question = parsed.target.find('?'); question != std::string::npos)
      throw std::invalid_argument("\"" + url + "\": \"" + parsed.target.substr(question + 1) +
                                  "\" is not an option: expected server_key=FILE&key=FILE");
  }
  if (parsed.target.size() == 6)
    throw std::invalid_argument("\"" + url + "\": the endpoint is missing, as in ipc:///run/user/1000/clearance.ipc");
  return parsed;
}

}  // namespace

Url parse_url(const std::string& url) {
  if (starts_with(url, "shm://")) {
    Url parsed{UrlKind::kShm, url.substr(6), "", "", ""};
    if (parsed.target.empty() || parsed.target[0] != '/')
      throw std::invalid_argument(
          "\"" + url + "\": the path of the socket must be absolute, as in shm:///run/user/1000/clearance.sock");
    return parsed;
  }
  if (starts_with(url, "ipc://") || starts_with(url, "tcp://")) return parse_zmq(url);
  if (starts_with(url, "udpm://")) {
    Url parsed{UrlKind::kLcm, url, "", "", ""};
    parsed.prefix = take_option(parsed.target, "prefix");
    return parsed;
  }
  throw std::invalid_argument("\"" + url +
                              "\" is not a url of a daemon: expected shm:///path, ipc:///path, tcp://host:port or "
                              "udpm://group:port?ttl=0");
}

}  // namespace clearance
