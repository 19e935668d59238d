#include "engine/state/stamp_marks.h"

#include <algorithm>

namespace clearance {

std::int64_t StampMarks::last(std::uint32_t body, std::uint64_t publisher) const {
  for (const Mark& mark : marks_[body])
    if (mark.publisher == publisher) return mark.stamp_ns;
  return 0;
}

void StampMarks::note(std::uint32_t body, std::uint64_t publisher, std::int64_t stamp_ns) {
  std::vector<Mark>& marks = marks_[body];
  auto known = std::find_if(marks.begin(), marks.end(), [&](const Mark& mark) { return mark.publisher == publisher; });
  if (stamp_ns == 0) {
    if (known != marks.end()) marks.erase(known);
    return;
  }
  if (known == marks.end()) {
    if (marks.size() < kMostMarks) marks.emplace_back();
    known = marks.end() - 1;
  }
  std::rotate(marks.begin(), known, known + 1);
  marks.front() = {publisher, stamp_ns};
}

}  // namespace clearance
