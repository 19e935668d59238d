// What went wrong, each kind once: how often, when first and last, and an example.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

namespace clearance {

/// Two errors are of one kind if their texts differ in numbers alone. Of more than kMaxKinds the one that was not seen
/// for longest is forgotten.
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
  /// The last seen first.
  std::vector<Entry> entries() const;

 private:
  std::unordered_map<std::string, Entry> kinds_;
};

/// A line for each: count, first, last (UTC), code, text; tabs between them.
std::string error_text(const std::vector<ErrorLog::Entry>& entries);

}  // namespace clearance
