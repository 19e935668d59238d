// Poses over a network that loses, repeats, delays and floods: the daemon has the newest that was delivered, and after
// one repeat the newest that was sent; restarted publishers and daemons agree within two repeats.
#include <limits>

#include "engine/state/pose_store.h"
#include "tests/lcm/faulty_link.h"
#include "tests/lcm/lcm_transport_fixture.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {
namespace {

class LcmFreshness : public LcmTransportTest {
 protected:
  void SetUp() override {
    LcmTransportTest::SetUp();
    raw_.emplace(address_.port);
  }

  static double step_of(std::int64_t sequence) { return 0.01 * static_cast<double>(sequence); }
  /// The datagram of a message of publisher 1 with the positions of all balls in a step.
  std::vector<std::byte> datagram(std::int64_t sequence, double step) {
    return RawSender::datagram("CLEARANCE_POSES", encode(update(sequence, step)));
  }
  /// Pose messages that the daemon has received, used or left out.
  std::uint64_t seen() { return counter("lcm.pose_messages") + counter("lcm.repeated") + counter("lcm.reordered"); }
  bool until_seen(std::uint64_t count) {
    return until([&] { return seen() >= count; });
  }
  /// Returns whether every ball is at the position of message `sequence` and reports it: no mix of two messages.
  bool stands_at(std::int64_t sequence, double step) {
    for (int i = 0; i < kMoving; ++i)
      if (position(1 + i) != position_of(i, step) || engine_->body_state(1 + i).stamp_ns != 1000 * sequence)
        return false;
    return true;
  }
  bool stands_at(std::int64_t sequence) { return stands_at(sequence, step_of(sequence)); }

  std::optional<RawSender> raw_;
};

// --- one publisher over a bad link

class LcmBadLink : public LcmFreshness, public testing::WithParamInterface<int> {};

TEST_P(LcmBadLink, TheStateIsTheNewestMessageDelivered) {
  const int seed = GetParam();
  start();
  FaultyLink link(static_cast<std::uint32_t>(seed), {.lose = 0.2, .duplicate = 0.2, .delay = 0.3, .most_delay = 6},
                  [&](std::span<const std::byte> bytes) { raw_->send(bytes); });
  constexpr std::int64_t kMessages = 300;
  std::uint64_t gaps = 0, repeated = 0, reordered = 0, used = 0;
  std::int64_t newest = 0;
  std::size_t looked_at = 0;
  int behind = 0;
  for (std::int64_t k = 1; k <= kMessages; ++k) {
    if (k == kMessages) link.heal();
    link.send(k, datagram(k, step_of(k)));
    // The rules of the documentation, implemented independently.
    for (; looked_at < link.delivered().size(); ++looked_at) {
      const std::int64_t sequence = link.delivered()[looked_at];
      if (newest != 0 && sequence == newest) ++repeated;
      if (newest != 0 && sequence < newest) ++reordered;
      if (sequence <= newest) continue;
      if (newest != 0) gaps += static_cast<std::uint64_t>(sequence - newest - 1);
      newest = sequence;
      ++used;
    }
    ASSERT_TRUE(until_seen(link.delivered().size()));
    if (newest == 0) continue;
    ASSERT_TRUE(stands_at(newest)) << "after message " << k;
    behind += newest < k;
  }
  // The faults did occur, and the daemon's counters show each.
  EXPECT_GT(link.counts().lost, 30);
  EXPECT_GT(link.counts().duplicated, 20);
  EXPECT_GT(link.counts().overtaken, 30);
  EXPECT_GT(behind, 30) << "the newest message sent was never missing: the link did no harm";
  EXPECT_EQ(counter("lcm.pose_messages"), used);
  EXPECT_EQ(counter("lcm.gaps"), gaps);
  EXPECT_EQ(counter("lcm.repeated"), repeated);
  EXPECT_EQ(counter("lcm.reordered"), reordered);
  EXPECT_EQ(counter("lcm.restarts"), 0u);
  EXPECT_EQ(used + repeated + reordered, link.delivered().size());
  EXPECT_GT(repeated, 0u);
  EXPECT_EQ(counter("lcm.bad_messages"), 0u);
}

TEST_P(LcmBadLink, OneRepeatBringsTheNewestMessageSent) {
  const int seed = GetParam();
  start();
  int missed = 0;
  std::int64_t sequence = 0;
  for (int round = 0; round < 12; ++round) {
    FaultyLink link(static_cast<std::uint32_t>(1000 * seed + round),
                    {.lose = 0.4, .duplicate = 0.2, .delay = 0.5, .most_delay = 5},
                    [&](std::span<const std::byte> bytes) { raw_->send(bytes); });
    const std::uint64_t before = seen();
    for (int k = 0; k < 10; ++k) {
      ++sequence;
      link.send(sequence, datagram(sequence, step_of(sequence)));
    }
    ASSERT_TRUE(until_seen(before + link.delivered().size()));
    missed += !stands_at(sequence);
    // A second later: the same poses under the next number, followed by the delayed messages.
    const double step = step_of(sequence);
    ++sequence;
    raw_->send(datagram(sequence, step));
    link.heal();
    ASSERT_TRUE(until_seen(before + link.delivered().size() + 1));
    EXPECT_TRUE(stands_at(sequence, step)) << "round " << round;
  }
  EXPECT_GT(missed, 2) << "nothing was ever missing before the repeat";
}

INSTANTIATE_TEST_SUITE_P(Seeds, LcmBadLink, testing::Values(1, 2, 3));

// --- floods

TEST_F(LcmFreshness, AFloodLosesMessagesButNeverMixesThem) {
  start();
  constexpr std::int64_t kFlood = 20'000;
  raw_->send(datagram(1, step_of(1)));
  ASSERT_TRUE(until_seen(1));
  // The daemon does not run meanwhile, so that the queue of its subscription overflows.
  for (std::int64_t k = 2; k <= kFlood; ++k) raw_->send(datagram(k, step_of(k)));
  // The answer to a final query shows that every message that was not lost has been processed.
  query_t query = query_message();
  query.pair_count = 1;
  query.pairs = {{1, 2}};
  std::int64_t mixed = 0, looks = 0;
  auto again = std::chrono::steady_clock::now();
  ASSERT_TRUE(until([&] {
    if (const auto now = std::chrono::steady_clock::now(); now >= again) {
      bus_->publish_message("CLEARANCE_QUERY", query);
      again = now + std::chrono::milliseconds(200);
    }
    mixed += !stands_at(engine_->body_state(1).stamp_ns / 1000);
    ++looks;
    return !answers_.empty();
  }));
  EXPECT_EQ(mixed, 0);
  EXPECT_GT(looks, 1);
  EXPECT_LT(seen(), static_cast<std::uint64_t>(kFlood)) << "nothing was lost: this was no flood";
  const std::int64_t newest = engine_->body_state(1).stamp_ns / 1000;
  EXPECT_LE(seen() + counter("lcm.gaps"), static_cast<std::uint64_t>(newest))
      << "every message up to the newest is seen or missing";
  raw_->send(datagram(kFlood + 1, step_of(kFlood)));
  ASSERT_TRUE(until([&] { return engine_->body_state(1).stamp_ns == 1000 * (kFlood + 1); }));
  EXPECT_TRUE(stands_at(kFlood + 1, step_of(kFlood)));
  EXPECT_EQ(seen() + counter("lcm.gaps"), static_cast<std::uint64_t>(kFlood + 1));
  expect_good_answer();
}

TEST_F(LcmFreshness, AFloodOfPublishersIsForgottenAndReported) {
  start();
  set_poses(1, 0.5);
  std::uint64_t sent = 1;
  // Each moves ball 5, alternating with publisher 1.
  for (std::int64_t publisher = 2; publisher <= 1000; ++publisher) {
    pose_update_t message{};
    message.publisher_id = publisher;
    message.sequence = 1;
    message.count = 1;
    message.names = {"ball5"};
    message.poses = {{9, 9, 9, 1, 0, 0, 0}};
    publish(message);
    ++sent;
    if (publisher % 3 == 0) {
      publish(update(publisher, 0.5));
      ++sent;
    }
    if (publisher % 50 == 0) {
      ASSERT_TRUE(until_seen(sent));
    }
  }
  ASSERT_TRUE(until_seen(sent));
  EXPECT_LE(counter("lcm.publishers"), 256u);
  EXPECT_GE(counter("lcm.contested"), 1u);
  set_poses(2000, 0.6);
  EXPECT_TRUE(stands_at(2000, 0.6));
}

// --- restarts

TEST_F(LcmFreshness, APublisherThatRestartsIsFollowedAtOnce) {
  start();
  FaultyLink link(7, {.lose = 0.1, .duplicate = 0.2, .delay = 0.6, .most_delay = 8},
                  [&](std::span<const std::byte> bytes) { raw_->send(bytes); });
  for (std::int64_t k = 1; k <= 100; ++k) link.send(k, datagram(k, step_of(k)));
  ASSERT_TRUE(until_seen(link.delivered().size()));
  const std::size_t before = link.delivered().size();
  // Its successor draws another id and starts at 1.
  publish(update(1, 50, 2));
  ASSERT_TRUE(until_seen(before + 1));
  EXPECT_TRUE(stands_at(1, 50));
  // Delayed messages of the old publisher arrive now. It counts as another publisher, so that its newest message, the
  // first to arrive, wins until the next repeat.
  link.heal();
  ASSERT_GT(link.delivered().size(), before);
  ASSERT_TRUE(until_seen(link.delivered().size() + 1));
  publish(update(2, 50, 2));
  ASSERT_TRUE(until_seen(link.delivered().size() + 2));
  EXPECT_TRUE(stands_at(2, 50));
  EXPECT_EQ(counter("lcm.publishers"), 2u);
  EXPECT_EQ(counter("lcm.restarts"), 0u);
}

TEST_F(LcmFreshness, ADaemonThatStartsLateHasAllPosesAfterOneRepeat) {
  for (std::int64_t k = 1; k <= 50; ++k) raw_->send(datagram(k, step_of(k)));  // no daemon runs
  start();
  EXPECT_EQ(engine_->body_state(1).status, Status::kNoPose);
  raw_->send(datagram(51, step_of(50)));
  ASSERT_TRUE(until_seen(1));
  EXPECT_TRUE(stands_at(51, step_of(50)));
  EXPECT_EQ(counter("lcm.gaps"), 0u) << "what was sent before its time is not missing";
}

TEST_F(LcmFreshness, ADaemonThatRestartsWithAnotherSceneHasAllPosesAfterOneRepeat) {
  start();
  publish(update(1, 3));
  ASSERT_TRUE(until_seen(1));
  EXPECT_TRUE(stands_at(1, 3));

  // Another daemon with other ids: a box precedes the balls.
  loop_.reset();
  engine::Scene other;
  other.add_box("crate", {1, 1, 1}, {});
  const engine::Scene same = make_scene();
  for (const Body& body : same.bodies()) other.add_body(body);
  engine_.emplace(std::move(other), engine::Engine::Options{.threads = 1});
  loop_.emplace(*engine_);
  loop_->add(make_lcm_transport(url()));
  publish(update(2, 3));  // before the new daemon has sent anything
  ASSERT_TRUE(until_seen(1));
  EXPECT_EQ(engine_->body_state(0).status, Status::kNoPose) << "the crate";
  for (int i = 0; i < kMoving; ++i) {
    EXPECT_EQ(position(2 + i), position_of(i, 3));
    EXPECT_EQ(engine_->body_state(2 + i).stamp_ns, 2000);
  }
}

TEST_F(LcmFreshness, AListenerThatJoinsLateKnowsAllAfterTwoAnnouncements) {
  start();
  set_poses(1, 0.7);
  ASSERT_TRUE(until([&] { return statuses_.size() >= 2; }));
  LcmBus late(address_);
  std::optional<scene_t> scene;
  std::optional<states_t> states;
  int announcements = 0;
  late.subscribe("CLEARANCE_SCENE", 8,
                 [&](auto packet) { scene.emplace().decode(packet.data(), 0, static_cast<int>(packet.size())); });
  late.subscribe("CLEARANCE_STATES", 8,
                 [&](auto packet) { states.emplace().decode(packet.data(), 0, static_cast<int>(packet.size())); });
  late.subscribe("CLEARANCE_STATUS", 8, [&](auto) { ++announcements; });
  ASSERT_TRUE(until([&] {
    while (late.handle()) {
    }
    return announcements >= 2;
  }));
  ASSERT_TRUE(scene && states);
  EXPECT_EQ(static_cast<std::uint64_t>(scene->revision), engine_->scene_revision());
  ASSERT_EQ(states->count, 1 + kMoving);
  for (int i = 0; i < kMoving; ++i)
    EXPECT_EQ(std::vector<double>(states->poses[1 + i].begin(), states->poses[1 + i].begin() + 3), position_of(i, 0.7));
}

TEST_F(LcmFreshness, AnOldMessageIsOldHoweverOldItIs) {
  start();
  set_poses(10'000, 1.0);
  std::uint64_t sent = 1;
  const std::uint64_t revision = engine_->pose_revision();
  const auto replay_all = [&] {
    for (const std::int64_t sequence : {9999, 9001, 9000, 8000, 1, 0, -1}) {
      pose_update_t old = update(sequence, 9.9);
      old.stamp_ns = std::max<std::int64_t>(old.stamp_ns, 0);
      publish(old);
      old.stamp_ns = 0;
      publish(old);
      sent += 2;
    }
    ASSERT_TRUE(until_seen(sent));
  };
  replay_all();
  EXPECT_TRUE(stands_at(10'000, 1.0));
  EXPECT_EQ(engine_->pose_revision(), revision);
  EXPECT_EQ(counter("lcm.reordered"), 14u);
  EXPECT_EQ(counter("lcm.restarts"), 0u);
  // A higher number with an older stamp: wrong numbering, or a forgery.
  pose_update_t forged = update(10'001, 9.9);
  forged.stamp_ns = 5;
  publish(forged);
  ASSERT_TRUE(until_counter("lcm.bad_stamps", 1));
  EXPECT_TRUE(stands_at(10'000, 1.0));
  // After a restart under its old id, messages of its former run are old, whatever their numbers.
  pose_update_t anew = update(1, 2.0);
  anew.stamp_ns = 20'000'000;
  publish(anew);
  ASSERT_TRUE(until_counter("lcm.restarts", 1));
  publish(update(10'002, 9.9));
  ASSERT_TRUE(until_counter("lcm.reordered", 15));
  EXPECT_EQ(position(1), position_of(0, 2.0));
}

TEST_F(LcmFreshness, StampsThatAreNoTimePoisonNothing) {
  start();
  set_poses(1, 1.0);
  constexpr std::int64_t kMin = std::numeric_limits<std::int64_t>::min(),
                         kMax = std::numeric_limits<std::int64_t>::max();
  const std::int64_t now = std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
  std::uint64_t rejected = 0;
  for (const std::int64_t stamp : {kMax, now + 3'600'000'000'000, std::int64_t{-1}, kMin})
    for (const std::int64_t publisher : {1, 2}) {
      pose_update_t bad = update(2, 9.9, publisher);
      bad.stamp_ns = stamp;
      bad.sequence = kMax;  // nor do their numbers
      publish(bad);
      ASSERT_TRUE(until_counter("lcm.bad_stamps", ++rejected));
    }
  EXPECT_TRUE(stands_at(1, 1.0));
  set_poses(2, 1.1);
  EXPECT_TRUE(stands_at(2, 1.1));
  EXPECT_EQ(counter("lcm.gaps"), 0u);
  Job job = engine_->start({}, {});
  EXPECT_EQ(job.info().snapshot_stamp_ns, 2000);
}

TEST_F(LcmFreshness, AFrameThatMovesBodiesIsTakenOnce) {
  start();
  const auto frame_at = [&](std::int64_t sequence, double x) {
    wire::PoseRecord record;
    record.body = 1;
    record.pose[0] = x;
    record.pose[3] = 1;
    const auto bytes =
        wire::FrameBuilder(wire::make_header(wire::FrameType::kSetPoses, static_cast<std::uint64_t>(sequence), 0))
            .add(wire::PosesHeader{.count = 1})
            .add(record)
            .take();
    auto part = frame_part(bytes, 0);
    part.client_id = 77;
    part.request_id = sequence;
    part.sequence = sequence;
    return part;
  };
  const auto send = [&](const clearance_lcm::frame_t& part) {
    ASSERT_TRUE(bus_->publish_message("CLEARANCE_FRAME_IN", part));
  };
  send(frame_at(1, 1));
  ASSERT_TRUE(until_counter("poses.batches", 1));
  send(frame_at(2, 2));
  ASSERT_TRUE(until_counter("poses.batches", 2));
  send(frame_at(1, 1));
  ASSERT_TRUE(until_counter("lcm.reordered", 1));
  send(frame_at(2, 2));
  ASSERT_TRUE(until_counter("lcm.repeated", 1));
  EXPECT_EQ(counter("poses.batches"), 2u);
  EXPECT_EQ(position(1)[0], 2);
  send(frame_at(3, 3));
  ASSERT_TRUE(until_counter("poses.batches", 3));
  EXPECT_EQ(position(1)[0], 3);
}

// --- age

TEST_F(LcmFreshness, StaleSaysWhichPosesAreOlderThanRequested) {
  start();
  set_poses(1, 0.7);
  pose_update_t one{};
  one.publisher_id = 1;
  one.count = 1;
  one.names = {"ball0"};
  one.poses = {pose_of(0, 0.9)};
  query_t query = query_message();
  query.pair_count = 3;
  query.pairs = {{1, 2}, {2, 3}, {0, 1}};
  query.fields = kFieldDistance | kFieldStatus;
  bool told_apart = false;
  for (int attempt = 0; attempt < 100 && !told_apart; ++attempt) {
    one.sequence = 2 + attempt;
    one.stamp_ns = monotonic_ns();
    const std::int64_t before = engine_->body_state(1).receipt_ns;
    publish(one);
    ASSERT_TRUE(until([&] { return engine_->body_state(1).receipt_ns != before; }));
    const std::int64_t young = engine_->body_state(1).receipt_ns, old = engine_->body_state(2).receipt_ns;
    // Slightly less than the age of the others: they are certainly too old, and ball 0 is not unless this takes longer
    // than the difference.
    const std::int64_t requested = monotonic_ns();
    query.max_pose_age_ns = requested - old - 1;
    const auto reply = evaluate(query);
    const std::int64_t answered = monotonic_ns();
    ASSERT_TRUE(reply);
    ASSERT_EQ(reply->error_code, 0) << reply->error_text;
    ASSERT_EQ(reply->status.size(), 3u);
    EXPECT_EQ(reply->status[0], reply_t::STATUS_STALE_POSE);
    EXPECT_EQ(reply->status[1], reply_t::STATUS_STALE_POSE);
    EXPECT_EQ(reply->oldest_receipt_ns, old);
    if (answered - requested >= young - old) continue;
    told_apart = true;
    EXPECT_NE(reply->status[2], reply_t::STATUS_STALE_POSE) << "the table never moves, and ball 0 is young";
  }
  EXPECT_TRUE(told_apart);
  Job job = engine_->start({}, {});
  EXPECT_EQ(job.info().snapshot_sequence, one.sequence) << "as the publisher counts";
  query.max_pose_age_ns = std::int64_t{3600} * 1'000'000'000;
  const auto reply = evaluate(query);
  ASSERT_TRUE(reply);
  for (const auto status : reply->status) EXPECT_NE(status, reply_t::STATUS_STALE_POSE);
}

}  // namespace
}  // namespace clearance
