#include "engine/device/query/device_layout.h"

#include <algorithm>
#include <string>

#include "engine/base/query_error.h"

namespace clearance {

DeviceLayout::DeviceLayout(const QueryView& query)
    : bodies(static_cast<std::uint32_t>(query.bodies.size())), joints(static_cast<std::uint32_t>(query.joints.size())) {
  using Wide = unsigned __int128;
  const Wide poses = Wide(query.configuration_count) * bodies * sizeof(Pose),
             positions = Wide(query.configuration_count) * joints * sizeof(double);
  constexpr std::uint64_t kMost = std::uint64_t{1} << 48;  // more than any device has; sums do not overflow
  if (poses > kMost || positions > kMost)
    throw engine::QueryError(QueryErrorCode::kTooLarge,
                             "a plan on a device: " + std::to_string(query.configuration_count) +
                                 " configurations of " + std::to_string(bodies) + " bodies and " +
                                 std::to_string(joints) + " joints are more than one has room for");
  positions_offset = aligned(static_cast<std::uint64_t>(poses));
  columns_offset = positions_offset + aligned(static_cast<std::uint64_t>(positions));
}

void DeviceLayout::add_columns(const QuerySize& of_answer) {
  size = of_answer;
  std::uint64_t columns = 0;
  reply_view_over(nullptr, size.rows, size.fields, &columns, size.joints);
  bytes = std::max<std::uint64_t>(columns_offset + columns, 1);
}

GivenOnDevice DeviceLayout::given(std::byte* memory) const {
  GivenOnDevice given;
  if (bodies) given.poses = reinterpret_cast<const Pose*>(memory);
  if (joints) given.positions = reinterpret_cast<const double*>(memory + positions_offset);
  return given;
}

ReplyView DeviceLayout::rows(std::byte* memory) const {
  return reply_view_over(memory + columns_offset, size.rows, size.fields, nullptr, size.joints);
}

}  // namespace clearance
