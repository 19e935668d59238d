// Validates packets before the generated decode() reads them.
//
// Generated code trusts the counts in a packet, so that 37 bytes can make it allocate gigabytes. These checks compare
// every count with the received bytes, require terminated strings, and reject trailing bytes.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "clearance_lcm/frame_t.hpp"
#include "clearance_lcm/joint_update_t.hpp"
#include "clearance_lcm/moving_joint_update_t.hpp"
#include "clearance_lcm/moving_pose_update_t.hpp"
#include "clearance_lcm/points_t.hpp"
#include "clearance_lcm/pose_update_t.hpp"
#include "clearance_lcm/query_t.hpp"

namespace clearance {

/// Each returns a description of the packet's error, or an empty text.
std::string check_pose_update(std::span<const std::byte> packet);
std::string check_joint_update(std::span<const std::byte> packet);
std::string check_moving_pose_update(std::span<const std::byte> packet);
std::string check_moving_joint_update(std::span<const std::byte> packet);
std::string check_points(std::span<const std::byte> packet);
std::string check_query(std::span<const std::byte> packet);
std::string check_frame(std::span<const std::byte> packet);

inline std::string check_packet(std::span<const std::byte> packet, const clearance_lcm::pose_update_t&) {
  return check_pose_update(packet);
}
inline std::string check_packet(std::span<const std::byte> packet, const clearance_lcm::joint_update_t&) {
  return check_joint_update(packet);
}
inline std::string check_packet(std::span<const std::byte> packet, const clearance_lcm::moving_pose_update_t&) {
  return check_moving_pose_update(packet);
}
inline std::string check_packet(std::span<const std::byte> packet, const clearance_lcm::moving_joint_update_t&) {
  return check_moving_joint_update(packet);
}
inline std::string check_packet(std::span<const std::byte> packet, const clearance_lcm::points_t&) {
  return check_points(packet);
}
inline std::string check_packet(std::span<const std::byte> packet, const clearance_lcm::query_t&) {
  return check_query(packet);
}
inline std::string check_packet(std::span<const std::byte> packet, const clearance_lcm::frame_t&) {
  return check_frame(packet);
}

/// Checks, then decodes. Returns a description of the error, or an empty text; throws only std::bad_alloc.
template <class Message>
std::string decode_checked(std::span<const std::byte> packet, Message& message) {
  std::string problem = check_packet(packet, message);
  if (problem.empty() && message.decode(packet.data(), 0, static_cast<int>(packet.size())) < 0) {
    problem = std::string(Message::getTypeName()) + ": cannot be decoded";
  }
  return problem;
}

}  // namespace clearance
