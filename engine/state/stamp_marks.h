// The last stamp of each publisher for each body, to detect updates that are late or repeated.
#pragma once

#include <cstdint>
#include <vector>

namespace clearance {

class StampMarks {
 public:
  /// Maximum number of publishers per body; beyond it, the least recently active one is evicted.
  static constexpr std::size_t kMostMarks = 8;

  explicit StampMarks(std::size_t bodies) : marks_(bodies) {}

  /// Returns the last stamp of a publisher for a body, or 0.
  std::int64_t last(std::uint32_t body, std::uint64_t publisher) const;
  /// \param stamp_ns 0 for an update without a stamp, after which the publisher's clock can restart
  void note(std::uint32_t body, std::uint64_t publisher, std::int64_t stamp_ns);
  /// Copies the marks of a body from another store.
  void take_over(std::uint32_t body, const StampMarks& old, std::uint32_t was) { marks_[body] = old.marks_[was]; }

 private:
  struct Mark {
    std::uint64_t publisher;
    std::int64_t stamp_ns;
  };
  std::vector<std::vector<Mark>> marks_;  // by body, most recent publisher first
};

}  // namespace clearance
