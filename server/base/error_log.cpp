#include "server/base/error_log.h"

#include <algorithm>
#include <cctype>
#include <ctime>

#include "server/base/log_text.h"

namespace clearance {
namespace {

/// Text with each number replaced by '#'.
std::string kind_of(const std::string& code, const std::string& text) {
  std::string kind = code + ' ';
  for (const unsigned char c : text) {
    if (!std::isdigit(c))
      kind += static_cast<char>(c);
    else if (kind.back() != '#')
      kind += '#';
  }
  return kind;
}

std::string utc(ErrorLog::Clock::time_point time) {
  const std::time_t seconds = ErrorLog::Clock::to_time_t(time);
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

}  // namespace

void ErrorLog::note(const std::string& code, const std::string& text, Clock::time_point now) {
  const std::string kept = text.substr(0, kMaxText);
  const auto [entry, is_new] = kinds_.try_emplace(kind_of(code, kept));
  if (is_new) {
    entry->second = {code, "", 0, now, now};
    if (kinds_.size() > kMaxKinds) {
      auto oldest = kinds_.end();
      for (auto other = kinds_.begin(); other != kinds_.end(); ++other)
        if (other != entry && (oldest == kinds_.end() || other->second.last < oldest->second.last)) oldest = other;
      kinds_.erase(oldest);
    }
  }
  Entry& known = entry->second;
  known.text = kept;
  known.last = now;
  ++known.count;
}

std::vector<ErrorLog::Entry> ErrorLog::entries() const {
  std::vector<Entry> all;
  for (const auto& [kind, entry] : kinds_) all.push_back(entry);
  std::sort(all.begin(), all.end(), [](const Entry& a, const Entry& b) { return a.last > b.last; });
  return all;
}

std::string error_text(const std::vector<ErrorLog::Entry>& entries) {
  std::string text;
  for (const ErrorLog::Entry& entry : entries) {
    text += std::to_string(entry.count) + '\t' + utc(entry.first) + '\t' + utc(entry.last) + '\t' + entry.code + '\t' +
            log_text(entry.text, false) + '\n';  // one line is one error
  }
  return text;
}

}  // namespace clearance
