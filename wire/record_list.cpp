#include "wire/record_list.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "wire/checks.h"

namespace clearance::wire {

RecordList::RecordList(std::vector<std::byte> encoded) : encoded_(std::move(encoded)) {
  constexpr std::size_t kUsual = 8;
  records_.reserve(kUsual);
  append(encoded_);
}

void RecordList::insert(std::uint16_t tag, std::uint16_t flags, std::span<const std::byte> array) {
  const auto at = std::find_if(records_.begin(), records_.end(), [tag](const Record& r) { return r.header.tag > tag; });
  records_.insert(at, {{tag, flags, static_cast<std::uint32_t>(array.size())}, array});
}

void RecordList::append(std::span<const std::byte> encoded) {
  while (!encoded.empty()) {
    RecordHeader header;
    std::memcpy(&header, encoded.data(), sizeof header);
    records_.push_back({header, encoded.subspan(sizeof header, header.bytes)});
    encoded = encoded.subspan(align(sizeof header + std::uint64_t{header.bytes}, kRecordAlignment));
  }
}

std::uint64_t RecordList::bytes() const {
  std::uint64_t sum = 0;
  for (const Record& record : records_) sum += align(sizeof record.header + record.array.size(), kRecordAlignment);
  return sum;
}

void RecordList::write(std::byte* to) const {
  for (const auto& [header, array] : records_) {
    std::memcpy(to, &header, sizeof header);
    to += sizeof header;
    if (!array.empty()) std::memcpy(to, array.data(), array.size());
    const std::uint64_t end = align(sizeof header + array.size(), kRecordAlignment) - sizeof header;
    std::memset(to + array.size(), 0, end - array.size());
    to += end;
  }
}

}  // namespace clearance::wire
