#include "client/channel/shm_options.h"

#include <pwd.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <stdexcept>
#include <string_view>

namespace clearance {
namespace {

constexpr std::uint32_t kMaxSpinUs = 1'000'000;

/// A user's name or number.
std::optional<uid_t> user_named(const std::string& name) {
  if (const passwd* entry = getpwnam(name.c_str())) return entry->pw_uid;
  uid_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (name.empty() || error != std::errc() || end != name.data() + name.size()) return std::nullopt;
  return number;
}

}  // namespace

ShmOptions parse_shm_options(const std::string& target) {
  constexpr std::string_view kSpin = "spin_us=", kUser = "user=";
  const std::size_t question = target.find('?');
  ShmOptions options{.path = target.substr(0, question)};
  for (std::size_t at = question; at != std::string::npos;) {
    const std::size_t end = target.find('&', at + 1);
    const std::string option = target.substr(at + 1, end == std::string::npos ? end : end - at - 1);
    at = end;
    if (option.empty()) continue;
    if (option.rfind(kUser, 0) == 0) {
      options.user = user_named(option.substr(kUser.size()));
      if (!options.user)
        throw std::invalid_argument("shm://" + target + ": there is no user \"" + option.substr(kUser.size()) + "\"");
      continue;
    }
    std::uint32_t us = 0;
    const char* last = option.data() + option.size();
    const auto parsed = std::from_chars(option.data() + std::min(kSpin.size(), option.size()), last, us);
    if (option.rfind(kSpin, 0) != 0 || parsed.ec != std::errc{} || parsed.ptr != last || us > kMaxSpinUs)
      throw std::invalid_argument("shm://" + target + ": \"" + option +
                                  "\" is not an option; there is spin_us=0 to spin_us=" + std::to_string(kMaxSpinUs) +
                                  ", and user=NAME");
    options.spin = std::chrono::microseconds(us);
  }
  return options;
}

}  // namespace clearance
