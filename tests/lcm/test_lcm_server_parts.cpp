// Components of the LCM transport, each alone: messages that fit, publishers, scheduling.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "server/lcm/lcm_outbox.h"
#include "server/lcm/lcm_publishers.h"
#include "server/lcm/lcm_translate.h"
#include "tests/lcm/lcm_fixture.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using wire::FrameType;

FrameBytes hold(const std::vector<std::byte>& bytes) {
  FrameBytes frame(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.bytes.get());
  return frame;
}

// --- messages

TEST(LcmTranslate, AMessageOfZerosIsASensibleQuery) {
  const auto frame = query_frame_of(clearance_lcm::query_t{});
  wire::FrameHeader header;
  const auto parts = wire::parse_query(wire::split_frame(frame, header));
  EXPECT_EQ(parts.header.max_distance, std::numeric_limits<double>::infinity());
  EXPECT_LT(parts.header.rel_tol, 0);
  EXPECT_EQ(parts.header.max_results, 1u << 20);
  EXPECT_EQ(parts.header.fields, kDefaultFields | kFieldPair);
  EXPECT_EQ(parts.header.all_pairs, 1);
}

TEST(LcmTranslate, QueryFieldsAreAllCarried) {
  clearance_lcm::query_t query{};
  query.client_id = 0x7123456789ABCDEF;
  query.request_id = -3;
  query.scene_revision = std::numeric_limits<std::int64_t>::min();
  query.max_distance = 2.5;
  query.abs_tol = 1e-3;
  query.rel_tol = 1e-2;
  query.max_results = 17;
  query.max_pose_age_ns = 18;
  query.fields = clearance_lcm::query_t::FIELD_LOWER;
  query.precision = 1;
  query.reduce = clearance_lcm::query_t::REDUCE_MIN;
  query.signed_distance = 1;
  query.pair_count = 2;
  query.pairs = {{1, clearance_lcm::query_t::EVERY_BODY}, {clearance_lcm::query_t::GROUP + 3, 4}};
  query.body_count = 3;
  query.bodies = {5, 6, 7};
  query.configuration_count = 2;
  double x = 0;
  query.configurations.assign(2, {3, std::vector<double>(7)});
  for (auto& c : query.configurations) {
    for (auto& pose : c) std::generate(pose.begin(), pose.end(), [&] { return ++x; });
  }
  const auto frame = query_frame_of(query);
  wire::FrameHeader header;
  const auto parts = wire::parse_query(wire::split_frame(frame, header));
  EXPECT_EQ(header.client_id, 0x7123456789ABCDEFu);
  EXPECT_EQ(header.request_id, ~std::uint64_t{2});
  EXPECT_EQ(header.scene_revision, std::uint64_t{1} << 63);
  EXPECT_EQ(parts.header.max_distance, 2.5);
  EXPECT_EQ(parts.header.abs_tol, 1e-3);
  EXPECT_EQ(parts.header.rel_tol, 1e-2);
  EXPECT_EQ(parts.header.max_results, 17u);
  EXPECT_EQ(parts.header.max_pose_age_ns, 18);
  EXPECT_EQ(parts.header.fields, static_cast<std::uint32_t>(kFieldLower));
  EXPECT_EQ(parts.header.precision, 1);
  EXPECT_EQ(parts.header.reduce, static_cast<std::uint8_t>(Reduce::kMin));
  EXPECT_EQ(parts.header.signed_distance, 1);
  EXPECT_EQ(parts.header.all_pairs, 0);
  ASSERT_EQ(parts.pairs.size(), 2u);
  EXPECT_EQ(parts.pairs[0].b, kEveryBody);
  EXPECT_EQ(parts.pairs[1].a, kGroupBit | 3u);
  ASSERT_EQ(parts.bodies.size(), 3u);
  EXPECT_EQ(parts.bodies[2], 7u);
  ASSERT_EQ(parts.configurations.size(), 6u);
  EXPECT_EQ(parts.configurations[0].pose[0], 1);
  EXPECT_EQ(parts.configurations[5].pose[6], 42);
}

TEST(LcmTranslate, WaitsAndDeadlinesAreCarried) {
  const auto options_of = [](const clearance_lcm::query_t& query) {
    const auto frame = query_frame_of(query);
    wire::FrameHeader header;
    const auto payload = wire::split_frame(frame, header);
    EXPECT_EQ(header.client_id, 11u);
    return wire::parse_query(header, payload).options;
  };
  clearance_lcm::query_t query{};
  query.client_id = 11;
  query.max_distance = 2.5;
  query.max_pose_age_ns = 18;
  QueryOptions options = options_of(query);
  EXPECT_EQ(options.max_distance, 2.5);
  EXPECT_EQ(options.fields, kDefaultFields | kFieldPair);
  EXPECT_EQ(options.min_pose_stamp_ns, 0);
  EXPECT_EQ(options.wait_for, kEveryBody);
  EXPECT_EQ(options.deadline_ns, 0);

  query.min_pose_stamp_ns = std::numeric_limits<std::int64_t>::max();
  query.deadline_ns = 19;
  query.wait_for = clearance_lcm::query_t::GROUP + 3;
  options = options_of(query);
  EXPECT_EQ(options.min_pose_stamp_ns, query.min_pose_stamp_ns);
  EXPECT_EQ(options.deadline_ns, 19);
  EXPECT_EQ(options.wait_for, kGroupBit | 3u);
  query.wait_for = 0;
  EXPECT_EQ(options_of(query).wait_for, kEveryBody);
  query.wait_for_one = 1;
  EXPECT_EQ(options_of(query).wait_for, 0u);
}

TEST(LcmTranslate, RepliesOfAllSizesFitTheirMessages) {
  for (const std::uint64_t rows : {0ull, 1ull, 100ull, 1000ull, 5000ull}) {
    for (const std::uint32_t fields : {std::uint32_t{kFieldStatus}, kDefaultFields, kKnownFields & ~kJointFields}) {
      wire::ReplyHeader reply;
      reply.rows = rows;
      reply.fields = fields;
      wire::set_name(reply.backend, "a-name-of-15-by");
      wire::FrameBuilder builder(wire::make_header(FrameType::kReply, 5, 0));
      std::vector<std::byte> columns(wire::columns_bytes(rows, fields), std::byte{0x3F});
      builder.add(reply).add_bytes(columns.data(), columns.size());
      const ReplyParts parts(hold(builder.take()), 1, 2, 3);
      std::int64_t next = 0;
      for (std::uint64_t i = 0; i < parts.size(); ++i) {
        const auto part = parts[i];
        EXPECT_LE(part.getEncodedSize(), static_cast<int>(kLcmMessageBytes));
        EXPECT_EQ(part.error_code, 0) << part.error_text;
        EXPECT_EQ(part.first_row, next);
        EXPECT_EQ(part.part, static_cast<int>(i));
        EXPECT_EQ(part.parts, static_cast<int>(parts.size()));
        next += part.status_count;
      }
      EXPECT_EQ(next, static_cast<std::int64_t>(rows));
    }
  }
}

TEST(LcmTranslate, ADamagedReplyIsAnErrorAndNotAnAnswer) {
  wire::ReplyHeader reply;
  reply.rows = 1000;  // without any column
  reply.fields = kDefaultFields;
  const auto damaged = wire::FrameBuilder(wire::make_header(FrameType::kReply, 5, 0)).add(reply).take();
  const ReplyParts parts(hold(damaged), 1, 2, 3);
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0].error_code, static_cast<int>(wire::ErrorCode::kInternal));
  EXPECT_FALSE(parts[0].error_text.empty());
  const ReplyParts other(hold(wire::FrameBuilder(wire::make_header(FrameType::kPong, 5, 0)).take()), 1, 2, 3);
  EXPECT_EQ(other[0].error_text, "unexpected frame kPong");
}

TEST(LcmTranslate, ALargeSceneComesInPartsThatStandForThemselves) {
  constexpr std::uint32_t kBodies = 5000, kGroups = 300;
  wire::SceneHeader scene;
  scene.scene_revision = 9;
  scene.body_count = kBodies;
  scene.group_count = kGroups;
  scene.member_count = kBodies + kGroups - 1;  // one group of all, the others of one each
  wire::FrameBuilder builder(wire::make_header(FrameType::kScene, 1, 0));
  builder.add(scene);
  for (std::uint32_t i = 0; i < kBodies; ++i) {
    wire::BodyRecord body;
    wire::set_name(body.name, "body" + std::to_string(i) + std::string(50, 'x'));
    body.extent = i;
    builder.add(body);
  }
  for (std::uint32_t g = 0; g < kGroups; ++g) {
    wire::GroupRecord group;
    wire::set_name(group.name, "group" + std::to_string(g));
    group.first_member = g == 0 ? 0 : kBodies + g - 1;
    group.member_count = g == 0 ? kBodies : 1;
    builder.add(group);
  }
  for (std::uint32_t i = 0; i < kBodies; ++i) builder.add(i);
  for (std::uint32_t g = 1; g < kGroups; ++g) builder.add(g);
  const auto messages = scene_messages(builder.take(), 7);
  EXPECT_GT(messages.size(), 5u);
  std::set<std::int32_t> ids, groups;
  std::set<std::vector<std::int32_t>> members;
  for (std::size_t m = 0; m < messages.size(); ++m) {
    const auto& message = messages[m];
    EXPECT_LE(message.getEncodedSize(), static_cast<int>(kLcmMessageBytes));
    EXPECT_EQ(message.part, static_cast<int>(m));
    EXPECT_EQ(message.parts, static_cast<int>(messages.size()));
    EXPECT_EQ(message.revision, 9);
    EXPECT_EQ(message.body_total, static_cast<int>(kBodies));
    ids.insert(message.ids.begin(), message.ids.end());
    groups.insert(message.groups.begin(), message.groups.end());
    members.insert(message.members.begin(), message.members.end());
    for (int i = 0; i < message.body_count; ++i) EXPECT_EQ(message.extent[i], message.ids[i]);
  }
  EXPECT_EQ(ids.size(), kBodies);
  EXPECT_EQ(groups.size(), kGroups);
  EXPECT_EQ(members.size(), kBodies + kGroups - 1);
}

TEST(LcmTranslate, ManyStatesAndCountersFit) {
  wire::StatesHeader header;
  header.count = 3000;
  wire::FrameBuilder states(wire::make_header(FrameType::kBodyStates, 1, 0));
  states.add(header);
  for (std::uint64_t i = 0; i < header.count; ++i) {
    wire::BodyStateRecord state;
    state.pose[0] = static_cast<double>(i);
    states.add(state);
  }
  std::int32_t next = 0;
  for (const auto& message : states_messages(states.take(), 1, 1, 1)) {
    EXPECT_LE(message.getEncodedSize(), static_cast<int>(kLcmMessageBytes));
    for (int i = 0; i < message.count; ++i, ++next) {
      EXPECT_EQ(message.ids[i], next);
      EXPECT_EQ(message.poses[i][0], next);
    }
  }
  EXPECT_EQ(next, 3000);

  wire::FrameBuilder stats(wire::make_header(FrameType::kStats, 1, 0));
  for (int i = 0; i < 2000; ++i) {
    wire::CounterRecord counter;
    wire::set_name(counter.name, "counter" + std::to_string(i) + std::string(40, 'x'));
    counter.value = static_cast<std::uint64_t>(i);
    stats.add(counter);
  }
  const auto status = status_message(stats.take(), 1);
  EXPECT_LE(status.getEncodedSize(), static_cast<int>(kLcmMessageBytes));
  EXPECT_GT(status.count, 500);
  EXPECT_EQ(status.values[499], 499);
}

// --- publishers

using Sequencing = PublisherLog::Sequencing;

TEST(LcmPublishers, Verdicts) {
  PublisherLog log;
  const auto t = PublisherLog::Clock::now();
  EXPECT_EQ(log.note(0, 1, 100, 0, t).sequencing, Sequencing::kNew);
  EXPECT_EQ(log.note(0, 1, 101, 0, t).sequencing, Sequencing::kNext);
  EXPECT_EQ(log.note(0, 1, 104, 0, t).missing, 2u);
  EXPECT_EQ(log.note(0, 1, 103, 0, t).sequencing, Sequencing::kOld);
  EXPECT_EQ(log.note(0, 1, 104, 0, t).sequencing, Sequencing::kRepeated);
  EXPECT_EQ(log.note(1, 1, 1, 0, t).sequencing, Sequencing::kNew);
  EXPECT_EQ(log.note(0, 2, 1, 0, t).sequencing, Sequencing::kNew);
  // Old messages stay old, whatever their distance and however long the publisher was silent.
  EXPECT_EQ(log.note(0, 1, 100'000, 0, t).sequencing, Sequencing::kGap);
  for (const int seconds : {0, 1, 4, 3600})
    for (const std::int64_t sequence : {99'999, 99'000, 5, 1, 0, -1})
      EXPECT_EQ(log.note(0, 1, sequence, 0, t + std::chrono::seconds(seconds)).sequencing, Sequencing::kOld);
  // The limits of the range.
  EXPECT_EQ(log.note(0, 3, std::numeric_limits<std::int64_t>::min(), 0, t).sequencing, Sequencing::kNew);
  const auto far = log.note(0, 3, std::numeric_limits<std::int64_t>::max(), 0, t);
  EXPECT_EQ(far.sequencing, Sequencing::kGap);
  EXPECT_EQ(far.missing, ~std::uint64_t{0} - 1);
  EXPECT_EQ(log.note(0, 3, std::numeric_limits<std::int64_t>::min(), 0, t).sequencing, Sequencing::kOld);
}

TEST(LcmPublishers, OneThatBeginsAgainUnderItsOldIdIsKnownByItsClock) {
  PublisherLog log;
  const auto t = PublisherLog::Clock::now();
  ASSERT_EQ(log.note(0, 1, 900, 9000, t).sequencing, Sequencing::kNew);
  EXPECT_EQ(log.note(0, 1, 899, 8990, t).sequencing, Sequencing::kOld);
  EXPECT_EQ(log.note(0, 1, 1, 9000, t).sequencing, Sequencing::kOld) << "no newer than all before";
  EXPECT_EQ(log.note(0, 1, 2, 9500, t).sequencing, Sequencing::kRestart);
  EXPECT_EQ(log.note(0, 1, 1, 9490, t).sequencing, Sequencing::kOld) << "overtaken";
  EXPECT_EQ(log.note(0, 1, 3, 9510, t).sequencing, Sequencing::kNext);
  // Delayed messages of its former run.
  for (const auto& [sequence, stamp] : {std::pair(899, 8990), {900, 9000}, {905, 9050}})
    EXPECT_EQ(log.note(0, 1, sequence, stamp, t).sequencing, Sequencing::kOld) << sequence;
  EXPECT_EQ(log.note(0, 1, 4, 9520, t).sequencing, Sequencing::kNext);
  // A number that overflows continues at the other end.
  EXPECT_EQ(log.note(0, 1, std::numeric_limits<std::int64_t>::max(), 9600, t).sequencing, Sequencing::kGap);
  EXPECT_EQ(log.note(0, 1, std::numeric_limits<std::int64_t>::min(), 9610, t).sequencing, Sequencing::kRestart);
  EXPECT_EQ(log.note(0, 1, std::numeric_limits<std::int64_t>::min() + 1, 9620, t).sequencing, Sequencing::kNext);
  EXPECT_EQ(log.note(0, 1, std::numeric_limits<std::int64_t>::max(), 9600, t).sequencing, Sequencing::kOld);
}

TEST(LcmPublishers, ManyAreNotRememberedForever) {
  PublisherLog log;
  const auto t = PublisherLog::Clock::now();
  for (int i = 1; i <= 1000; ++i) log.note(0, i, 5, 0, t + std::chrono::milliseconds(i));
  EXPECT_EQ(log.size(), PublisherLog::kMaxPublishers);
  EXPECT_EQ(log.note(0, 1000, 5, 0, t + std::chrono::seconds(1)).sequencing, Sequencing::kRepeated);
  EXPECT_EQ(log.note(0, 1, 5, 0, t + std::chrono::seconds(1)).sequencing, Sequencing::kNew);
}

TEST(LcmPublishers, AQuarrelIsTakingTurns) {
  OwnerLog log(4);
  const auto t = OwnerLog::Clock::now();
  const std::vector<std::uint32_t> one{1}, both{1, 2, 99};
  EXPECT_TRUE(log.note(10, both, t).empty());
  EXPECT_TRUE(log.note(20, one, t).empty());
  EXPECT_EQ(log.note(10, both, t + std::chrono::seconds(1)), (std::vector<std::uint32_t>{1}));
  EXPECT_EQ(log.note(20, one, t + std::chrono::seconds(1)), (std::vector<std::uint32_t>{1}));
  // Successive publishers are no conflict.
  EXPECT_TRUE(log.note(10, one, t + std::chrono::seconds(20)).empty());
  // Four alternating ones: detected from the second turn on.
  for (int turn = 0; turn < 3; ++turn)
    for (const int publisher : {1, 2, 3, 4})
      EXPECT_EQ(log.note(publisher, one, t + std::chrono::seconds(40)).size(), turn == 0 ? 0u : 1u)
          << turn << " " << publisher;
  // Successive ones, none of which returns: restarts.
  for (int publisher = 5; publisher < 50; ++publisher)
    EXPECT_TRUE(log.note(publisher, one, t + std::chrono::seconds(41)).empty());
}

// --- the outbox

TEST(LcmOutbox, TakesTurnsAndKeepsThePace) {
  LcmOutbox outbox;
  std::vector<char> sent;
  const auto item = [&](char name, std::size_t bytes) {
    return [&sent, name, bytes](std::uint64_t) {
      sent.push_back(name);
      return bytes;
    };
  };
  ASSERT_TRUE(outbox.push(100, 1000, item('L', 48000)));
  ASSERT_TRUE(outbox.push(1, 10, item('s', 100)));
  auto now = LcmOutbox::Clock::now();
  outbox.flush(now);
  // A burst is sent at once; the short second message comes before the rest of the long first one.
  ASSERT_GE(sent.size(), 3u);
  EXPECT_EQ(sent[0], 'L');
  EXPECT_EQ(sent[1], 's');
  EXPECT_LE(sent.size(), 5u);
  // The rest at the pacer's rate, in simulated time.
  const auto begin = now;
  while (outbox.due()) {
    ASSERT_GT(*outbox.due(), now);
    now = *outbox.due();
    outbox.flush(now);
  }
  EXPECT_EQ(sent.size(), 101u);
  const double seconds = std::chrono::duration<double>(now - begin).count();
  const double expected = (100 * 48000 - LcmPacer::kBurstBytes) / LcmPacer::kBytesPerSecond;
  EXPECT_GT(seconds, 0.9 * expected);
  EXPECT_LT(seconds, 1.3 * expected);
  EXPECT_EQ(outbox.sent(), 101u);
}

TEST(LcmOutbox, MemoryIsBoundedAndFailuresAreCounted) {
  LcmOutbox outbox;
  EXPECT_FALSE(outbox.push(1, LcmOutbox::kMaxBytes + 1, [](std::uint64_t) { return std::size_t{1}; }));
  ASSERT_TRUE(outbox.push(2, LcmOutbox::kMaxBytes, [](std::uint64_t) { return std::size_t{0}; }));
  EXPECT_FALSE(outbox.push(1, 1, [](std::uint64_t) { return std::size_t{1}; }));
  outbox.flush(LcmOutbox::Clock::now());
  EXPECT_EQ(outbox.failed(), 2u);
  EXPECT_TRUE(outbox.push(1, 1, [](std::uint64_t) { return std::size_t{1}; }));
}

}  // namespace
}  // namespace clearance
