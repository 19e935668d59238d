// Invalid packets, with a valid query after each.
#include "tests/lcm/lcm_transport_fixture.h"

namespace clearance {
namespace {

TEST_F(LcmTransportTest, HostilePacketsAndAGoodQueryAfterEach) {
  start();
  set_poses(1, 0.7);
  expect_good_answer();
  RawSender raw(address_.port);
  std::mt19937 random(99);
  const auto noise = [&](std::size_t size) {
    std::vector<std::byte> bytes(size);
    for (auto& b : bytes) b = static_cast<std::byte>(random());
    return bytes;
  };
  const auto with_word = [](std::vector<std::byte> packet, std::size_t from_end, std::uint32_t word) {
    for (int i = 0; i < 4; ++i) packet[packet.size() - from_end + i] = static_cast<std::byte>(word >> (24 - 8 * i));
    return packet;
  };
  const auto cut = [](std::vector<std::byte> packet, std::size_t size) {
    packet.resize(size);
    return packet;
  };
  const auto fragment = [&](std::uint32_t bytes, std::uint32_t offset, std::uint32_t number_and_count) {
    auto packet = RawSender::big_endian({0x4c433033, 7, bytes, offset, number_and_count});
    const auto tail = noise(100);
    packet.insert(packet.end(), tail.begin(), tail.end());
    return packet;
  };

  pose_update_t no_poses{};
  no_poses.publisher_id = 1;
  query_t no_pairs = query_message();
  clearance_lcm::frame_t no_frame{};
  no_frame.client_id = 5;
  const auto poses = encode(update(2, 0.8));
  const auto query = encode(query_message());

  // Datagrams that never form a message.
  std::vector<std::pair<std::string, std::vector<std::byte>>> datagrams{
      {"nothing", {}},
      {"noise", noise(1000)},
      {"a whole datagram of noise", noise(65000)},
      {"a header and no more", RawSender::big_endian({0x4c433032, 1})},
      {"a channel that does not end", cut(RawSender::datagram("CLEARANCE_QUERY", {}), 8 + 15)},
      {"a fragment past its message", fragment(1000, 0xFFFFFFF0, 0x00010002)},
      {"a fragment of no fragments", fragment(1000, 0, 0x00010000)},
      {"a fragment of 4 GB", fragment(0xFFFFFFFF, 0, 0x00010002)},
  };
  for (const auto& [what, datagram] : datagrams) {
    SCOPED_TRACE(what);
    raw.send(datagram);
    expect_good_answer();
  }

  // Messages on our channels with the wrong content for the channel: each is counted.
  std::vector<std::tuple<std::string, std::string, std::vector<std::byte>>> messages{
      {"an empty message", "CLEARANCE_POSES", {}},
      {"noise for poses", "CLEARANCE_POSES", noise(500)},
      {"noise for a query", "CLEARANCE_QUERY", noise(500)},
      {"a query on the channel of poses", "CLEARANCE_POSES", query},
      {"poses on the channel of queries", "CLEARANCE_QUERY", poses},
      {"37 bytes of poses", "CLEARANCE_POSES", cut(poses, 37)},
      {"poses cut short", "CLEARANCE_POSES", cut(poses, poses.size() - 1)},
      {"poses with bytes left over", "CLEARANCE_POSES", cut(poses, poses.size() + 8)},
      {"2^31 - 1 poses", "CLEARANCE_POSES", with_word(encode(no_poses), 4, 0x7FFFFFFF)},
      {"-1 poses", "CLEARANCE_POSES", with_word(encode(no_poses), 4, 0xFFFFFFFF)},
      {"2^28 poses", "CLEARANCE_POSES", with_word(encode(no_poses), 4, 0x10000000)},
      {"2^31 - 1 pairs", "CLEARANCE_QUERY", with_word(encode(no_pairs), 20, 0x7FFFFFFF)},
      {"2^31 - 1 bodies", "CLEARANCE_QUERY", with_word(encode(no_pairs), 16, 0x7FFFFFFF)},
      {"2^31 - 1 configurations of no body", "CLEARANCE_QUERY", with_word(encode(no_pairs), 12, 0x7FFFFFFF)},
      {"2^31 - 1 joints", "CLEARANCE_QUERY", with_word(encode(no_pairs), 8, 0x7FFFFFFF)},
      {"2^31 - 1 rows of no joint", "CLEARANCE_QUERY", with_word(encode(no_pairs), 4, 0x7FFFFFFF)},
      {"a query cut short", "CLEARANCE_QUERY", cut(query, query.size() - 1)},
      {"a query without a client", "CLEARANCE_QUERY", encode(query_t{})},
      {"a frame of -1 bytes", "CLEARANCE_FRAME_IN", with_word(encode(no_frame), 4, 0xFFFFFFFF)},
      {"a frame without parts", "CLEARANCE_FRAME_IN", encode(no_frame)},
  };
  for (const auto& [what, channel, packet] : messages) {
    SCOPED_TRACE(what);
    const std::uint64_t bad = counter("lcm.bad_messages");
    raw.send(RawSender::datagram(channel, packet));
    ASSERT_TRUE(until_counter("lcm.bad_messages", bad + 1));
    expect_good_answer();
  }
  EXPECT_EQ(counter("lcm.bad_messages"), messages.size());
  // Invalid values in valid messages.
  pose_update_t bad = update(2, 0.8);
  bad.poses[0] = {std::nan(""), 0, 0, 1, 0, 0, 0};
  bad.poses[1] = {0, 0, 0, 0, 0, 0, 0};
  const std::uint64_t before = counter("lcm.pose_messages");
  publish(bad);
  ASSERT_TRUE(until_counter("lcm.pose_messages", before + 1));
  EXPECT_EQ(engine_->body_state(1).status, Status::kBadPose);
  EXPECT_EQ(engine_->body_state(2).status, Status::kBadPose);
  EXPECT_EQ(engine_->body_state(3).status, Status::kOk);
  expect_good_answer();
}

}  // namespace
}  // namespace clearance
