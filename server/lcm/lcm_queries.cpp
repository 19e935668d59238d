// Frames of queries from LCM messages.
#include <cstring>
#include <string>

#include "server/lcm/lcm_translate.h"

namespace clearance {
namespace {

/// Reads the options that differ from 0, the default of each field.
template <class Message>
void read_options(const Message& message, QueryOptions& options) {
  for_each_query_option([&](const QueryOption&, auto member) {
    if constexpr (requires { member(message); })
      if (const auto value = member(message); value != 0)
        member(options) = static_cast<std::remove_reference_t<decltype(member(options))>>(value);
  });
}

/// Throws WireError for a column that reply_t has no field for.
void reject_columns(std::uint32_t fields) {
  for (const auto& [field, name] : {std::pair{kFieldPairLower, "pair_lower"},
                                    {kFieldGradientJoints, "gradient_joints"},
                                    {kFieldTime, "time"},
                                    {kFieldFirstContact, "first_contact"},
                                    {kFieldSteps, "steps"},
                                    {kFieldFreeScale, "free_scale"},
                                    {kFieldVerdict, "verdict"},
                                    {kFieldHessianJoints, "hessian_joints"},
                                    {kFieldRate, "rate"},
                                    {kFieldCurvature, "curvature"},
                                    {kFieldSmoothRadius, "smooth_radius"},
                                    {kFieldRateBounds, "rate_bounds"}})
    if (fields & field)
      throw wire::WireError(wire::ErrorCode::kBadQuery, std::string("query: fields: reply_t has no column ") + name);
}

/// Throws WireError for bodies and joints in different numbers of configurations.
void reject_unequal_rows(const clearance_lcm::query_t& query) {
  if (query.joint_count != 0 && query.body_count != 0 && query.configuration_count != query.row_count)
    throw wire::WireError(wire::ErrorCode::kBadQuery,
                          std::to_string(query.configuration_count) + " configurations of bodies and " +
                              std::to_string(query.row_count) + " of joints: expected equal numbers, or no bodies");
}

}  // namespace

std::vector<std::byte> query_frame_of(const clearance_lcm::query_t& query, std::span<const std::uint32_t> joints) {
  QueryOptions options;
  read_options(query, options);
  if (query.wait_for_one) options.wait_for = static_cast<std::uint32_t>(query.wait_for);  // 0 is a valid body
  reject_columns(options.fields);
  reject_unequal_rows(query);
  // LCM has no message for the pair table, so by default each row has its pair.
  if (query.fields == 0) options.fields |= kFieldPair;
  wire::QueryHeader header;
  copy_options(options, header);
  header.all_pairs = query.pair_count == 0;
  header.pair_count = static_cast<std::uint32_t>(query.pair_count);
  header.body_count = static_cast<std::uint32_t>(query.body_count);
  header.configuration_count =
      static_cast<std::uint32_t>(query.row_count ? query.row_count : query.configuration_count);

  std::vector<std::uint32_t> pairs;
  pairs.reserve(query.pairs.size() * 2);
  for (const auto& pair : query.pairs) {
    pairs.push_back(static_cast<std::uint32_t>(pair[0]));
    pairs.push_back(static_cast<std::uint32_t>(pair[1]));
  }
  std::vector<double> poses;
  poses.reserve(query.configurations.size() * query.bodies.size() * 7);
  for (const auto& configuration : query.configurations) {
    for (const auto& pose : configuration) poses.insert(poses.end(), pose.begin(), pose.end());
  }
  std::vector<double> positions;
  for (const auto& row : query.positions) positions.insert(positions.end(), row.begin(), row.end());

  const std::uint64_t payload =
      wire::query_payload_bytes(header.pair_count, header.body_count, header.configuration_count);
  std::vector<std::byte> records = wire::option_records(options);
  wire::insert_inputs(records, {.joints = joints, .positions = positions});
  std::vector<std::byte> frame(sizeof(wire::FrameHeader) + payload + records.size());
  const wire::FrameHeader frame_header =
      wire::make_header(wire::FrameType::kQuery, static_cast<std::uint64_t>(query.request_id), payload,
                        static_cast<std::uint64_t>(query.scene_revision), static_cast<std::uint64_t>(query.client_id));
  wire::write_query(frame.data(), wire::with_records(frame_header, records.size()), header, pairs.data(),
                    query.bodies.data(), poses.data(), records);
  return frame;
}

std::vector<std::byte> nearest_query_frame() {
  clearance_lcm::query_t query{};
  query.reduce = static_cast<std::int8_t>(Reduce::kNearest);
  query.fields = kDefaultFields | kFieldFlags | kFieldPoints | kFieldPair;
  return query_frame_of(query);
}

}  // namespace clearance
