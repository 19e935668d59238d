// A victim over LCM: parts of frames, poses and queries without the client library.
#include <stdexcept>

#include "clearance_lcm/pose_update_t.hpp"
#include "clearance_lcm/query_t.hpp"
#include "tests/faults/victim/victim.h"
#include "wire/lcm/lcm_bus.h"
#include "wire/lcm/lcm_check.h"
#include "wire/lcm/lcm_frames.h"

namespace clearance::faults {

void talk_lcm(const std::string& url, const Fate& fate, std::mt19937_64& random) {
  LcmBus bus(parse_lcm_address(url));
  const std::int64_t id = draw_lcm_id();
  std::int64_t sequence = 0;
  std::uint64_t parts_received = 0, parts_wanted = 0;
  bus.subscribe("CLEARANCE_FRAME_OUT", 512, [&](std::span<const std::byte> packet) {
    clearance_lcm::frame_t part;
    if (!decode_checked(packet, part).empty() || part.client_id != id) return;
    ++parts_received;
    parts_wanted = static_cast<std::uint64_t>(part.parts);
  });
  fate.at("opened");

  clearance_lcm::pose_update_t update{};
  update.publisher_id = id;
  update.sequence = 1;
  update.count = 1;
  update.names = {"random_0"};
  update.poses = {{1, 2, 3, 1, 0, 0, 0}};
  bus.publish_message("CLEARANCE_POSES", update);
  fate.at("poses_sent");

  const auto send = [&](const std::vector<std::byte>& frame, std::uint64_t from, std::uint64_t to) {
    for (std::uint64_t i = from; i < std::min(to, frame_part_count(frame.size())); ++i) {
      clearance_lcm::frame_t part = frame_part(frame, i);
      part.client_id = id;
      part.request_id = 100 + sequence;
      part.sequence = sequence;
      bus.publish_message("CLEARANCE_FRAME_IN", part);
    }
  };
  // Some of 112 KB, which take three parts.
  const auto long_request = request_of(100, 2000, random);
  send(long_request, 0, 1);
  fate.at("part_sent");
  send(long_request, 1, 3);
  fate.at("sent");

  // Answers may be lost; then the request is repeated.
  const auto await_parts = [&](auto enough) {
    using namespace std::chrono_literals;
    for (int attempt = 0; attempt < 20; ++attempt) {
      ++sequence;
      parts_received = 0;
      send(large_request(static_cast<std::uint64_t>(100 + sequence)), 0, 1);
      const auto deadline = std::chrono::steady_clock::now() + 2s;
      while (!enough() && bus.wait(deadline))
        while (!enough() && bus.handle()) {
        }
      if (enough()) return;
    }
    throw std::runtime_error("no answer over LCM");
  };
  await_parts([&] { return parts_received > 0; });
  fate.at("reply_begun");
  await_parts([&] { return parts_received > 0 && parts_received >= parts_wanted; });
  fate.at("reply_there");
  for (int i = 0; i < 8; ++i) {
    ++sequence;
    send(large_request(static_cast<std::uint64_t>(100 + sequence)), 0, 1);
  }
  fate.at("many_sent");
  clearance_lcm::query_t query{};
  query.client_id = id;
  query.request_id = 1;
  bus.publish_message("CLEARANCE_QUERY", query);
  fate.at("query_sent");
}

}  // namespace clearance::faults
