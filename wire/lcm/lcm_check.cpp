#include "wire/lcm/lcm_check.h"

#include <algorithm>
#include <cstdint>

#include "wire/lcm/lcm_bus.h"
#include "wire/types.h"

namespace clearance {
namespace {

/// Walks the big-endian fields of a packet, and stops at the first invalid one.
class Walk {
 public:
  Walk(std::span<const std::byte> packet, const char* type, std::int64_t hash) : packet_(packet), type_(type) {
    if (packet.size() > kLcmDatagramBytes) {
      fail("longer than one datagram (" + std::to_string(packet.size()) + " bytes)");
    } else if (packet.size() < 8) {
      fail("too short for a message (" + std::to_string(packet.size()) + " bytes)");
    } else if (static_cast<std::int64_t>(read(8)) != hash) {
      fail("another type, or another version of it (the hash differs)");
    }
  }

  void skip(std::uint64_t bytes, const char* what) {
    if (!problem_.empty()) return;
    if (bytes > packet_.size() - at_) {
      fail(std::string("ends within ") + what);
    } else {
      at_ += bytes;
    }
  }
  /// Reads a count of entries of at least `entry_bytes` each.
  std::uint64_t count(std::uint64_t entry_bytes, const char* what) {
    const std::uint64_t at = at_;
    skip(4, what);
    if (!problem_.empty()) return 0;
    at_ = at;
    const auto value = static_cast<std::int32_t>(read(4));
    if (value < 0 || static_cast<std::uint64_t>(value) * entry_bytes > packet_.size() - at_) {
      fail(std::string(what) + " " + std::to_string(value) + " does not fit the packet of " +
           std::to_string(packet_.size()) + " bytes");
      return 0;
    }
    return static_cast<std::uint64_t>(value);
  }
  /// Reads a string of at most `limit` bytes without its NUL.
  void string(std::uint64_t limit, const char* what) {
    const std::uint64_t size = count(1, what);
    if (!problem_.empty()) return;
    if (size == 0 || size > limit + 1) {
      fail(std::string(what) + ": expected at most " + std::to_string(limit) + " bytes");
    } else {
      const auto text = packet_.subspan(at_, size);
      at_ += size;
      // Generated code reads up to the first NUL, so that only some readers would get the bytes after it.
      if (std::find(text.begin(), text.end(), std::byte{0}) != text.end() - 1) {
        fail(std::string(what) + " does not end at its stated length");
      }
    }
  }
  void fail(const std::string& what) {
    if (problem_.empty()) problem_ = std::string(type_) + ": " + what;
  }
  bool good() const { return problem_.empty(); }
  std::string end() {
    if (problem_.empty() && at_ != packet_.size()) {
      fail(std::to_string(packet_.size() - at_) + " bytes are left over");
    }
    return problem_;
  }

 private:
  std::uint64_t read(std::uint64_t bytes) {
    std::uint64_t value = 0;
    for (std::uint64_t i = 0; i < bytes; ++i) value = value << 8 | std::to_integer<std::uint64_t>(packet_[at_ + i]);
    at_ += bytes;
    return value;
  }

  std::span<const std::byte> packet_;
  const char* type_;
  std::uint64_t at_ = 0;
  std::string problem_;
};

constexpr std::uint64_t kPoseBytes = 7 * 8, kTwistBytes = 6 * 8;

/// Reads the members of an update by name.
void walk_update(Walk& walk, std::uint64_t value_bytes, const char* values) {
  walk.skip(3 * 8, "its ids and stamps");
  const std::uint64_t count = walk.count(5 + value_bytes, "count");
  for (std::uint64_t i = 0; i < count && walk.good(); ++i) walk.string(kMaxNameBytes, "a name");
  walk.skip(count * value_bytes, values);
}

}  // namespace

std::string check_pose_update(std::span<const std::byte> packet) {
  Walk walk(packet, "pose_update_t", clearance_lcm::pose_update_t::getHash());
  walk_update(walk, kPoseBytes, "poses");
  return walk.end();
}

std::string check_joint_update(std::span<const std::byte> packet) {
  Walk walk(packet, "joint_update_t", clearance_lcm::joint_update_t::getHash());
  walk_update(walk, sizeof(double), "positions");
  return walk.end();
}

std::string check_moving_pose_update(std::span<const std::byte> packet) {
  Walk walk(packet, "moving_pose_update_t", clearance_lcm::moving_pose_update_t::getHash());
  walk_update(walk, kPoseBytes + kTwistBytes, "poses and velocities");
  return walk.end();
}

std::string check_moving_joint_update(std::span<const std::byte> packet) {
  Walk walk(packet, "moving_joint_update_t", clearance_lcm::moving_joint_update_t::getHash());
  walk_update(walk, 2 * sizeof(double), "positions and velocities");
  return walk.end();
}

std::string check_points(std::span<const std::byte> packet) {
  Walk walk(packet, "points_t", clearance_lcm::points_t::getHash());
  walk.skip(3 * 8, "its ids and stamps");
  walk.string(kMaxNameBytes, "its body's name");
  walk.skip(8 + 3 * 4, "its numbers");
  const std::uint64_t count = walk.count(3 * 4, "count");
  walk.skip(count * 3 * 4, "points");
  return walk.end();
}

std::string check_query(std::span<const std::byte> packet) {
  Walk walk(packet, "query_t", clearance_lcm::query_t::getHash());
  walk.skip(3 * 8 + 4 * 8 + 4 * 8 + 3 * 4 + 4, "its parameters");
  walk.skip(8 * walk.count(8, "pair_count"), "pairs");
  const std::uint64_t bodies = walk.count(4, "body_count");
  walk.skip(4 * bodies, "bodies");
  const std::uint64_t configurations = walk.count(bodies * kPoseBytes, "configuration_count");
  // Configurations without bodies have no bytes to count, and are invalid. So are rows without joints.
  if (bodies == 0 && configurations > 0) walk.fail("configurations without bodies");
  walk.skip(configurations * bodies * kPoseBytes, "configurations");
  const std::uint64_t joints = walk.count(5, "joint_count");
  for (std::uint64_t i = 0; i < joints && walk.good(); ++i) walk.string(kMaxNameBytes, "a joint");
  const std::uint64_t rows = walk.count(joints * 8, "row_count");
  if (joints == 0 && rows > 0) walk.fail("rows without joints");
  walk.skip(rows * joints * 8, "positions");
  return walk.end();
}

std::string check_frame(std::span<const std::byte> packet) {
  Walk walk(packet, "frame_t", clearance_lcm::frame_t::getHash());
  walk.skip(5 * 8 + 2 * 4, "its ids and sizes");
  walk.skip(walk.count(1, "byte_count"), "bytes");
  return walk.end();
}

}  // namespace clearance
