// Arbitrary LCM packets: those that pass the check are decoded, encode to the same bytes, and convert to a frame that
// the loop accepts.
#include <numeric>
#include <vector>

#include "server/lcm/lcm_translate.h"
#include "tests/fuzz/fuzz_target.h"
#include "wire/lcm/lcm_check.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/wire.h"

namespace clearance::fuzz {
namespace {

template <class Message>
bool decoded(Bytes packet, Message& message) {
  if (!decode_checked(packet, message).empty()) return false;
  std::vector<std::byte> again(static_cast<std::size_t>(message.getEncodedSize()));
  require(message.encode(again.data(), 0, static_cast<int>(again.size())) == static_cast<int>(again.size()) &&
              again.size() == packet.size() && std::memcmp(again.data(), packet.data(), again.size()) == 0,
          "what was decoded encodes to the same bytes");
  return true;
}

/// Returns whether a packet is a query that the daemon would start.
bool requested(Bytes packet) {
  clearance_lcm::query_t query;
  if (!decoded(packet, query)) return false;
  try {
    std::vector<std::uint32_t> joints(query.joints.size());
    std::iota(joints.begin(), joints.end(), 0u);
    const std::vector<std::byte> frame = query_frame_of(query, joints);
    wire::FrameHeader header;
    const auto payload = wire::split_frame(frame, header);
    wire::parse_query(header, payload);
  } catch (const wire::WireError& error) {  // invalid values of a query; its sizes are ours
    require(error.code == wire::ErrorCode::kBadQuery, "a query makes a frame whose sizes fit");
    return false;
  }
  return true;
}

}  // namespace
}  // namespace clearance::fuzz

/// Packets in sequence, [type 1 B | size 2 B | bytes]; packets of frames go to one assembler.
CLEARANCE_FUZZ_TARGET(lcm_packet) {
  using namespace clearance;
  using namespace clearance::fuzz;
  FrameAssembler assembler({.frame_bytes = 1 << 20, .total_bytes = 2 << 20, .frames = 8});
  FrameAssembler::Clock::time_point now{};
  Input in(bytes);
  bool accepted = !bytes.empty();
  while (!in.empty()) {
    const auto type = in.number<std::uint8_t>();
    const Bytes packet = in.take(in.number<std::uint16_t>());
    bool good = false;
    switch (type % 4) {
      case 0: {
        clearance_lcm::pose_update_t update;
        good = decoded(packet, update);
        break;
      }
      case 1: {
        clearance_lcm::joint_update_t update;
        good = decoded(packet, update);
        break;
      }
      case 2:
        good = requested(packet);
        break;
      default: {
        clearance_lcm::frame_t part;
        good = decoded(packet, part);
        if (!good) break;
        now += std::chrono::milliseconds(type);
        if (const auto whole = assembler.add(part, now)) {
          wire::FrameHeader header;
          require(whole->frame.size >= sizeof header, "a frame has a header");
          std::memcpy(&header, whole->frame.bytes.get(), sizeof header);
        }
      }
    }
    accepted &= good;
  }
  return accepted;
}
