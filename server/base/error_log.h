// Distinct errors with their count, first and last time, and an example.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

namespace clearance {

/// Errors whose texts differ in numbers alone are of one kind. Beyond kMaxKinds the one not seen for longest is
/// dropped.
class ErrorLog {
 public:
  using Clock = std::chrono::system_clock;
  static constexpr std::size_t kMaxKinds = 64;
  static constexpr std::size_t kMaxText = 500;  ///< bytes kept of a text

  struct Entry {
    std::string code;
    std::string text;  ///< of the last
    std::uint64_t count = 0;
    Clock::time_point first, last;
  };

  void note(const std::string& code, const std::string& text, Clock::time_point now = Clock::now());
  /// Most recent first.
  std::vector<Entry> entries() const;

 private:
  std::unordered_map<std::string, Entry> kinds_;
};

/// A line for each, with count, first, last (UTC), code and text, separated by tabs.
std::string error_text(const std::vector<ErrorLog::Entry>& entries);

}  // namespace clearance
