// The last stamp that each publisher gave for each body: what is older is an update that came late, or once more.
#pragma once

#include <cstdint>
#include <vector>

namespace clearance {

class StampMarks {
 public:
  /// Publishers of one body that are remembered; past that the one silent for longest is forgotten.
  static constexpr std::size_t kRemembered = 8;

  explicit StampMarks(std::size_t bodies) : marks_(bodies) {}

  /// The last stamp of a publisher for a body; 0: none.
  std::int64_t last(std::uint32_t body, std::uint64_t publisher) const;
  /// \param stamp_ns 0: the publisher gives none, and may begin anew.
  void note(std::uint32_t body, std::uint64_t publisher, std::int64_t stamp_ns);
  /// What another store knows of one of its bodies.
  void take_over(std::uint32_t body, const StampMarks& old, std::uint32_t was) { marks_[body] = old.marks_[was]; }

 private:
  struct Mark {
    std::uint64_t publisher;
    std::int64_t stamp_ns;
  };
  std::vector<std::vector<Mark>> marks_;  // by body; the last to move it first
};

}  // namespace clearance
