// Malformed packets are rejected before decode(). Frames in parts are restored completely or not at all.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <random>

#include "tests/lcm/lcm_fixture.h"
#include "wire/lcm/lcm_check.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using clearance_lcm::frame_t;
using clearance_lcm::joint_update_t;
using clearance_lcm::pose_update_t;
using clearance_lcm::query_t;

pose_update_t poses(std::vector<std::string> names) {
  pose_update_t message{};
  message.publisher_id = 5;
  message.sequence = 1;
  message.count = static_cast<int>(names.size());
  message.poses.assign(names.size(), {1, 2, 3, 1, 0, 0, 0});
  message.names = std::move(names);
  return message;
}

joint_update_t positions(std::vector<std::string> names) {
  joint_update_t message{};
  message.publisher_id = 5;
  message.sequence = 1;
  message.count = static_cast<int>(names.size());
  message.positions.assign(names.size(), 0.5);
  message.names = std::move(names);
  return message;
}

query_t query(int pairs, int bodies, int configurations, int joints = 0) {
  query_t message{};
  message.client_id = 7;
  message.min_pose_stamp_ns = 1;
  message.pair_count = pairs;
  message.pairs.assign(pairs, {0, 1});
  message.body_count = bodies;
  message.bodies.assign(bodies, 2);
  message.configuration_count = configurations;
  message.configurations.assign(configurations, {static_cast<std::size_t>(bodies), {0, 0, 0, 1, 0, 0, 0}});
  message.joint_count = joints;
  message.joints.assign(joints, "arm/joint1");
  message.row_count = joints == 0 ? 0 : configurations;
  message.positions.assign(message.row_count, std::vector<double>(joints, 0.5));
  return message;
}

frame_t frame(int bytes) {
  frame_t message{};
  message.client_id = 9;
  message.frame_bytes = bytes;
  message.parts = 1;
  message.byte_count = bytes;
  message.bytes.assign(bytes, 0xA5);
  return message;
}

/// Overwrites the 32-bit big-endian word at `at`.
void put_word(std::vector<std::byte>& packet, std::size_t at, std::int32_t value) {
  for (int i = 0; i < 4; ++i)
    packet[at + i] = static_cast<std::byte>(static_cast<std::uint32_t>(value) >> (24 - 8 * i));
}

/// A valid packet passes; none of its prefixes does, nor the packet with an extra byte, nor any with a wrong count.
template <class Message>
void test_sizes(const Message& message, const std::vector<std::size_t>& counts_at) {
  const std::vector<std::byte> packet = encode(message);
  Message out;
  EXPECT_EQ(decode_checked(packet, out), "");
  EXPECT_EQ(encode(out), packet);
  for (std::size_t size = 0; size < packet.size(); ++size) {
    EXPECT_NE(check_packet(std::span(packet).first(size), out), "") << "of " << size << " bytes";
  }
  std::vector<std::byte> longer = packet;
  longer.push_back(std::byte{0});
  EXPECT_NE(check_packet(longer, out), "");
  for (const std::size_t at : counts_at) {
    for (const std::int32_t count : {-1, -2147483647 - 1, 2147483647, 0x10000000, 1 << 20, 60000}) {
      std::vector<std::byte> wrong = packet;
      put_word(wrong, at, count);
      EXPECT_NE(decode_checked(wrong, out), "") << "count " << count << " at " << at;
    }
  }
  std::vector<std::byte> other = packet;
  other[3] ^= std::byte{1};
  EXPECT_NE(check_packet(other, out).find("the hash differs"), std::string::npos);
}

TEST(LcmCheck, PoseUpdate) {
  test_sizes(poses({}), {32});
  test_sizes(poses({"base", "", "a longer name"}), {32, 36, 45});
}
TEST(LcmCheck, JointUpdate) {
  test_sizes(positions({}), {32});
  test_sizes(positions({"arm/joint1", "", "a longer name"}), {32, 36, 51});
}
TEST(LcmCheck, MovingPoseUpdate) {
  for (const pose_update_t& pose : {poses({}), poses({"base", "", "a longer name"})}) {
    clearance_lcm::moving_pose_update_t message{};
    message.count = pose.count;
    message.names = pose.names;
    message.poses = pose.poses;
    message.velocities.assign(pose.names.size(), std::vector<double>(6, 0.5));
    test_sizes(message, {32});
  }
}
TEST(LcmCheck, MovingJointUpdate) {
  for (const joint_update_t& position : {positions({}), positions({"arm/joint1", "", "a longer name"})}) {
    clearance_lcm::moving_joint_update_t message{};
    message.count = position.count;
    message.names = position.names;
    message.positions = message.velocities = position.positions;
    test_sizes(message, {32});
  }
}
TEST(LcmCheck, Query) {
  const std::size_t parameters = 8 + 3 * 8 + 4 * 8 + 4 * 8 + 3 * 4 + 4;
  const std::size_t bodies = parameters + 4 + 16, configurations = bodies + 4 + 12;
  const std::size_t joints = configurations + 4 + 4 * 3 * 56, rows = joints + 4 + 2 * (4 + 11);
  test_sizes(query(0, 0, 0), {parameters, parameters + 4, parameters + 8, parameters + 12, parameters + 16});
  test_sizes(query(2, 3, 4, 2), {parameters, bodies, configurations, joints, joints + 4, rows});
  query_t out;
  EXPECT_EQ(decode_checked(encode(poses({})), out),
            "query_t: another type, or another version of it (the hash differs)");
}
TEST(LcmCheck, Frame) {
  test_sizes(frame(0), {8 + 5 * 8 + 2 * 4});
  test_sizes(frame(200), {8 + 5 * 8 + 2 * 4});
}

TEST(LcmCheck, AFewBytesRequestGigabytes) {
  // Generated code allocated 9.4 GB for such a packet: a count of 2^28 - 1 at its end.
  std::vector<std::byte> packet = encode(poses({}));
  put_word(packet, packet.size() - 4, (1 << 28) - 1);
  pose_update_t out;
  EXPECT_EQ(decode_checked(packet, out), "pose_update_t: count 268435455 does not fit the packet of 36 bytes");
  packet.resize(29);
  EXPECT_EQ(decode_checked(packet, out), "pose_update_t: ends within its ids and stamps");
}

TEST(LcmCheck, ConfigurationsWithoutBodiesAndRowsWithoutJoints) {
  // Neither has any bytes, so that no size check could reject 2^31 of them.
  const std::vector<std::byte> packet = encode(query(0, 0, 0));
  query_t out;
  for (const auto& [from_end, problem] :
       {std::pair{12, "query_t: configurations without bodies"}, {4, "query_t: rows without joints"}}) {
    std::vector<std::byte> wrong = packet;
    put_word(wrong, wrong.size() - from_end, 2147483647);
    EXPECT_EQ(decode_checked(wrong, out), problem);
  }
}

TEST(LcmCheck, NamesEnd) {
  pose_update_t out;
  std::vector<std::byte> packet = encode(poses({"base"}));
  packet[36 + 4 + 4] = std::byte{'x'};  // the terminator
  EXPECT_EQ(decode_checked(packet, out), "pose_update_t: a name does not end at its stated length");
  packet = encode(poses({"base"}));
  packet[36 + 4 + 2] = std::byte{0};  // a NUL inside the name
  EXPECT_EQ(decode_checked(packet, out), "pose_update_t: a name does not end at its stated length");
  EXPECT_EQ(decode_checked(encode(poses({std::string(63, 'n')})), out), "");
  EXPECT_EQ(decode_checked(encode(poses({std::string(64, 'n')})), out),
            "pose_update_t: a name: expected at most 63 bytes");
}

TEST(LcmCheck, LongerThanADatagram) {
  query_t out;
  EXPECT_NE(decode_checked(encode(query(9000, 0, 0)), out).find("longer than one datagram"), std::string::npos);
}

TEST(LcmCheck, FlippedBitsPassOrFailButNeverOverrun) {
  std::mt19937 random(20240901);
  int passed = 0, rejected = 0;
  const auto flip = [&](const auto& message) {
    const std::vector<std::byte> packet = encode(message);
    for (int round = 0; round < 4000; ++round) {
      std::vector<std::byte> wrong = packet;
      for (unsigned n = 1 + random() % 3; n > 0; --n) {
        wrong[8 + random() % (wrong.size() - 8)] ^= std::byte(1u << random() % 8);
      }
      auto out = message;
      out = {};
      if (check_packet(wrong, out).empty()) {
        ++passed;
        EXPECT_EQ(out.decode(wrong.data(), 0, static_cast<int>(wrong.size())), static_cast<int>(wrong.size()));
      } else {
        ++rejected;
      }
    }
  };
  flip(poses({"a", "bb"}));
  flip(positions({"a", "bb"}));
  flip(query(1, 2, 1, 1));
  flip(frame(16));
  EXPECT_GT(passed, 1000);
  EXPECT_GT(rejected, 1000);
}

// --- frames in parts

using Clock = FrameAssembler::Clock;

std::vector<std::byte> random_bytes(std::mt19937& random, std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (auto& b : bytes) b = static_cast<std::byte>(random());
  return bytes;
}

std::vector<frame_t> parts_of(const std::vector<std::byte>& bytes, std::int64_t client, std::int64_t sequence) {
  std::vector<frame_t> parts;
  for (std::uint64_t i = 0; i < frame_part_count(bytes.size()); ++i) {
    frame_t part = frame_part(bytes, i);
    part.client_id = client;
    part.request_id = sequence;
    part.sequence = sequence;
    EXPECT_LE(part.getEncodedSize(), static_cast<int>(kLcmMessageBytes));
    parts.push_back(part);
  }
  return parts;
}

bool same(const FrameBytes& frame, const std::vector<std::byte>& bytes) {
  return frame.size == bytes.size() && std::memcmp(frame.bytes.get(), bytes.data(), bytes.size()) == 0;
}

constexpr FrameAssembler::Limits kRoomy{.frame_bytes = 1 << 20, .total_bytes = 8 << 20, .frames = 64};

TEST(LcmFrames, WholeInAnyOrderWithRepeats) {
  std::mt19937 random(7);
  int repeated = 0;
  for (const std::size_t size : {64ul, 65ul, 48640ul, 48641ul, 97280ul, 300001ul, 1048576ul}) {
    const auto bytes = random_bytes(random, size);
    auto parts = parts_of(bytes, 1, 1);
    EXPECT_EQ(parts.size(), (size + 48639) / 48640);
    // Every part except one, some twice, in a random order; then the last.
    std::shuffle(parts.begin(), parts.end(), random);
    FrameAssembler assembler(kRoomy);
    for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
      EXPECT_FALSE(assembler.add(parts[i], Clock::now()));
      const bool again = random() % 2 == 0;
      EXPECT_FALSE(again && assembler.add(parts[i], Clock::now()));
    }
    const auto whole = assembler.add(parts.back(), Clock::now());
    ASSERT_TRUE(whole);
    EXPECT_TRUE(same(whole->frame, bytes));
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(whole->frame.bytes.get()) % 64, 0u);
    repeated += static_cast<int>(assembler.counts().repeated);
  }
  EXPECT_GT(repeated, 3);
}

TEST(LcmFrames, PartsOfDifferentFramesNeverMeet) {
  std::mt19937 random(8);
  const auto a = random_bytes(random, 200000), b = random_bytes(random, 200000);
  // The same client sends two requests under one id, and the daemon answers both. Half of each answer is lost.
  auto first = parts_of(a, 1, 1), second = parts_of(b, 1, 2);
  for (auto& part : second) part.request_id = 1;
  FrameAssembler assembler(kRoomy);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_FALSE(assembler.add(i % 2 == 0 ? first[i] : second[i], Clock::now()));
  }
  // Two clients, and two daemons, with the same sequence.
  auto other_client = parts_of(b, 2, 3), other_server = parts_of(b, 1, 3), own = parts_of(a, 1, 3);
  for (auto& part : other_server) part.server_id = 77;
  int whole = 0;
  for (std::size_t i = 0; i < own.size(); ++i) {
    for (const auto* parts : {&own, &other_client, &other_server}) {
      if (const auto done = assembler.add((*parts)[i], Clock::now())) {
        EXPECT_TRUE(same(done->frame, parts == &own ? a : b));
        ++whole;
      }
    }
  }
  EXPECT_EQ(whole, 3);
}

TEST(LcmFrames, OldOnesAreGivenUp) {
  std::mt19937 random(9);
  const auto bytes = random_bytes(random, 100000);
  const auto parts = parts_of(bytes, 1, 1);
  ASSERT_EQ(parts.size(), 3u);
  FrameAssembler assembler(kRoomy), later(kRoomy);
  const auto begin = Clock::now();
  for (FrameAssembler* each : {&assembler, &later}) {
    each->add(parts[0], begin);
    each->add(parts[1], begin + std::chrono::milliseconds(1900));
  }
  // Kept 1.9 s after its last part, dropped after 2.2 s.
  EXPECT_TRUE(assembler.add(parts[2], begin + std::chrono::milliseconds(3800)));
  EXPECT_FALSE(later.add(parts[2], begin + std::chrono::milliseconds(4100)));
  EXPECT_EQ(later.counts().given_up, 1u);
}

TEST(LcmFrames, MemoryIsBounded) {
  std::mt19937 random(10);
  const auto bytes = random_bytes(random, 100000);
  FrameAssembler few({.frame_bytes = 1 << 20, .total_bytes = 1 << 30, .frames = 4});
  for (int sequence = 1; sequence <= 10; ++sequence) few.add(parts_of(bytes, 1, sequence)[0], Clock::now());
  EXPECT_EQ(few.counts().given_up, 6u);
  FrameAssembler small({.frame_bytes = 1 << 20, .total_bytes = 250000, .frames = 64});
  for (int sequence = 1; sequence <= 10; ++sequence) small.add(parts_of(bytes, 1, sequence)[0], Clock::now());
  EXPECT_EQ(small.counts().given_up, 8u);
  // The youngest are kept.
  EXPECT_FALSE(small.add(parts_of(bytes, 1, 10)[1], Clock::now()));
  EXPECT_TRUE(small.add(parts_of(bytes, 1, 10)[2], Clock::now()));
}

TEST(LcmFrames, NumbersThatDoNotFitAreRejected) {
  std::mt19937 random(11);
  const auto good = parts_of(random_bytes(random, 100000), 1, 1)[1];
  FrameAssembler assembler(kRoomy);
  std::uint64_t bad = 0;
  const auto reject = [&](auto change) {
    frame_t part = good;
    change(part);
    EXPECT_FALSE(assembler.add(part, Clock::now()));
    EXPECT_EQ(assembler.counts().bad, ++bad);
  };
  reject([](frame_t& p) { p.frame_bytes = -1; });
  reject([](frame_t& p) { p.frame_bytes = 0; });
  reject([](frame_t& p) { p.frame_bytes = 63; });
  reject([](frame_t& p) { p.frame_bytes = std::numeric_limits<std::int64_t>::max(); });
  reject([](frame_t& p) { p.frame_bytes = (1 << 20) + 1; });
  reject([](frame_t& p) { p.part = -1; });
  reject([](frame_t& p) { p.part = p.parts; });
  reject([](frame_t& p) { p.part = 2; });  // the last part is shorter
  reject([](frame_t& p) { p.parts = 4; });
  reject([](frame_t& p) { p.parts = 0; });
  reject([](frame_t& p) { p.parts = std::numeric_limits<std::int32_t>::max(); });
  reject([](frame_t& p) { p.bytes.resize(p.byte_count = 100); });
  // One that contradicts earlier parts.
  EXPECT_FALSE(assembler.add(good, Clock::now()));
  reject([](frame_t& p) { p.frame_bytes = 99999; });
  reject([](frame_t& p) { p.request_id = 12; });
}

// --- the url

TEST(LcmAddress, Parts) {
  const LcmAddress all =
      parse_lcm_address("udpm://239.1.2.3:1234?ttl=1&prefix=cell_&recv_buf_size=1000&distances_hz=2.5");
  EXPECT_EQ(all.host, "239.1.2.3");
  EXPECT_EQ(all.port, 1234);
  EXPECT_EQ(all.ttl, 1);
  EXPECT_EQ(all.prefix, "cell_");
  EXPECT_EQ(all.recv_buf_size, 1000);
  EXPECT_EQ(all.distances_hz, 2.5);
  EXPECT_EQ(all.url(), "udpm://239.1.2.3:1234?ttl=1&prefix=cell_");
  const LcmAddress none = parse_lcm_address("udpm://");
  EXPECT_EQ(none.url(), "udpm://239.255.76.67:7667?ttl=0");
  EXPECT_EQ(parse_lcm_address("udpm://239.255.76.67").port, 7667);
}

TEST(LcmAddress, ErrorsNameThePart) {
  const std::pair<const char*, const char*> cases[] = {
      {"tcpq://localhost", "expected udpm://GROUP:PORT?ttl=0"},
      {"udpm://127.0.0.1:7667", "group: expected a multicast address (224.0.0.0 to 239.255.255.255), got '127.0.0.1'"},
      {"udpm://nonsense:7667", "group: expected a multicast address (224.0.0.0 to 239.255.255.255), got 'nonsense'"},
      {"udpm://239.255.76.67:0", "port: expected a number from 1 to 65535, got '0'"},
      {"udpm://239.255.76.67:70000", "port: expected a number from 1 to 65535, got '70000'"},
      {"udpm://239.255.76.67:7667?ttl=256", "ttl: expected 0 (this host) to 255, got '256'"},
      {"udpm://239.255.76.67:7667?ttl=", "ttl: expected 0 (this host) to 255, got ''"},
      {"udpm://239.255.76.67:7667?ttl=0&prefix=a.*",
       "prefix: expected up to 40 letters, digits, '_', '-' or '/', got 'a.*'"},
      {"udpm://239.255.76.67:7667?recv_buf_size=-1", "recv_buf_size: expected bytes up to 1073741824, got '-1'"},
      {"udpm://239.255.76.67:7667?distances_hz=nan", "distances_hz: expected 0 (none) to 10000, got 'nan'"},
      {"udpm://239.255.76.67:7667?tll=0", "unknown option 'tll' (known: ttl, recv_buf_size, prefix, distances_hz)"},
  };
  for (const auto& [url, text] : cases) {
    try {
      parse_lcm_address(url);
      ADD_FAILURE() << url << " was accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_EQ(error.what(), "LCM url '" + std::string(url) + "': " + text);
    }
  }
}

}  // namespace
}  // namespace clearance
