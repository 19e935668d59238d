#include "url.h"

#include <stdexcept>

namespace clearance {
namespace {

bool starts_with(const std::string& text, const char* prefix) {
  return text.rfind(prefix, 0) == 0;
}

/// Takes "prefix=..." out of the options behind the '?' of an LCM url: LCM itself does not know it.
std::string take_prefix(std::string& url) {
  const std::size_t question = url.find('?');
  if (question == std::string::npos) return "";
  std::string kept, prefix;
  for (std::size_t at = question + 1; at <= url.size();) {
    const std::size_t end = std::min(url.find('&', at), url.size());
    const std::string option = url.substr(at, end - at);
    if (starts_with(option, "prefix="))
      prefix = option.substr(7);
    else if (!option.empty())
      kept += (kept.empty() ? "?" : "&") + option;
    at = end + 1;
  }
  url = url.substr(0, question) + kept;
  return prefix;
}

}  // namespace

Url parse_url(const std::string& url) {
  if (starts_with(url, "shm://")) {
    Url parsed{UrlKind::kShm, url.substr(6), ""};
    if (parsed.target.empty() || parsed.target[0] != '/')
      throw std::invalid_argument(
          "\"" + url + "\": the path of the socket must be absolute, as in shm:///run/user/1000/clearance.sock");
    return parsed;
  }
  if (starts_with(url, "ipc://") || starts_with(url, "tcp://")) {
    if (url.size() == 6)
      throw std::invalid_argument("\"" + url + "\": the endpoint is missing, as in ipc:///run/user/1000/clearance.ipc");
    return {UrlKind::kZmq, url, ""};
  }
  if (starts_with(url, "udpm://")) {
    Url parsed{UrlKind::kLcm, url, ""};
    parsed.prefix = take_prefix(parsed.target);
    return parsed;
  }
  throw std::invalid_argument("\"" + url +
                              "\" is no url of a daemon: expected shm:///path, ipc:///path, tcp://host:port or "
                              "udpm://group:port?ttl=0");
}

}  // namespace clearance
