// An LCM query and the bytes of LCM messages: for recorded messages (tests/golden) and seeds of the fuzzer.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <vector>

#include "clearance_lcm/query_t.hpp"

namespace clearance {

/// Returns the bytes of a message.
template <class Message>
std::vector<std::byte> encode(const Message& message) {
  std::vector<std::byte> packet(static_cast<std::size_t>(message.getEncodedSize()));
  const int size = static_cast<int>(packet.size());
  if (message.encode(packet.data(), 0, size) != size) throw std::logic_error("a message of another size than encoded");
  return packet;
}

/// Returns a query of one pair in two configurations of one body, which waits for poses until a deadline.
inline clearance_lcm::query_t sample_lcm_query() {
  clearance_lcm::query_t query{};
  query.client_id = 7;
  query.pair_count = 1;
  query.pairs = {{0, 1}};
  query.body_count = 1;
  query.bodies = {1};
  query.configuration_count = 2;
  query.configurations.assign(2, {{0, 0, 1, 1, 0, 0, 0}});
  query.min_pose_stamp_ns = 1000;
  query.deadline_ns = 1'000'000;
  query.wait_for_one = 1;
  return query;
}

}  // namespace clearance
