// Poses over the LCM transport.
#include "clearance_lcm/joint_update_t.hpp"
#include "tests/lcm/lcm_transport_fixture.h"

namespace clearance {
namespace {

TEST_F(LcmTransportTest, PosesApplyAsAWhole) {
  start();
  for (int k = 1; k <= 20; ++k) {
    const std::uint64_t revision = engine_->pose_revision();
    set_poses(k, 0.1 * k);
    EXPECT_EQ(engine_->pose_revision(), revision + 1);
    for (int i = 0; i < kMoving; ++i) {
      EXPECT_EQ(position(1 + i), position_of(i, 0.1 * k));
      EXPECT_EQ(engine_->body_state(1 + i).stamp_ns, 1000 * k);
    }
  }
  EXPECT_EQ(counter("lcm.gaps"), 0u);
  EXPECT_EQ(counter("lcm.publishers"), 1u);
}

TEST_F(LcmTransportTest, QueriesSeeNoHalfOfAnUpdate) {
  start();
  // All balls move together, so that the distances between them belong to one step or the next, never to a mix.
  std::map<std::vector<double>, int> seen;
  const auto together = [&](int k) {
    pose_update_t message = update(k, 0);
    for (int i = 0; i < kMoving; ++i) message.poses[i] = {0.5 * i * (k % 2 == 0 ? 1 : 2), 1.0 * k, 0, 1, 0, 0, 0};
    return message;
  };
  publish(together(1));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  for (int k = 2; k <= 60; ++k) {
    query_t query = query_message();
    query.pair_count = 1;
    query.pairs = {{query_t::GROUP, query_t::EVERY_BODY}};
    query.max_distance = 100;
    publish(together(k));
    ASSERT_TRUE(bus_->publish_message("CLEARANCE_QUERY", query));
    publish(together(++k));
    ASSERT_TRUE(until([&] { return answers_.size() == 1; }));
    const reply_t reply = answers_.begin()->second.whole;
    answers_.clear();
    std::vector<double> between;
    for (std::size_t i = 0; i < reply.distance.size(); ++i) {
      if (reply.pair[i][0] != 0)
        between.push_back(reply.distance[i] + 0.2 + 0.01 * (reply.pair[i][0] + reply.pair[i][1] - 2));
    }
    ASSERT_EQ(between.size(), 12u);  // of 15 pairs of balls, those with one of the arm
    for (auto& d : between) d = std::round(d * 1e6) / 1e6;
    ++seen[between];
  }
  EXPECT_LE(seen.size(), 2u);
  EXPECT_TRUE(until_counter("lcm.pose_messages", 60));
}

TEST_F(LcmTransportTest, OrderIsKeptForEachPublisher) {
  start();
  set_poses(10, 1.0);
  set_poses(11, 1.1);
  EXPECT_EQ(counter("lcm.gaps"), 0u);
  set_poses(15, 1.5);  // 12, 13 and 14 are missing
  EXPECT_EQ(counter("lcm.gaps"), 3u);
  const std::uint64_t revision = engine_->pose_revision();
  publish(update(13, 1.3));  // late
  ASSERT_TRUE(until_counter("lcm.reordered", 1));
  publish(update(15, 9.9));  // the same again
  ASSERT_TRUE(until_counter("lcm.repeated", 1));
  EXPECT_EQ(engine_->pose_revision(), revision);
  EXPECT_EQ(position(1), position_of(0, 1.5));
  // Another publisher is counted separately, and so is another channel.
  publish(update(1, 2.0, 2));
  ASSERT_TRUE(until([&] { return engine_->pose_revision() == revision + 1; }));
  const std::uint64_t messages = counter("lcm.pose_messages");
  clearance_lcm::joint_update_t joints{};
  joints.publisher_id = 1;
  joints.sequence = 1;
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_JOINTS", joints));
  ASSERT_TRUE(until_counter("lcm.pose_messages", messages + 1));
  EXPECT_EQ(counter("lcm.gaps"), 3u);
  EXPECT_EQ(counter("lcm.reordered"), 1u);
  EXPECT_EQ(counter("lcm.publishers"), 3u);
  // A publisher that restarts its numbers with a newer stamp than all before has restarted.
  set_poses(5000, 3.0);
  pose_update_t anew = update(1, 3.1);
  anew.stamp_ns = 5'000'001;
  publish(anew);
  ASSERT_TRUE(until_counter("lcm.restarts", 1));
  EXPECT_EQ(position(1), position_of(0, 3.1));
}

TEST_F(LcmTransportTest, NamesThatAreUnknownAreLeftOut) {
  start();
  pose_update_t named{};
  named.publisher_id = 3;
  named.sequence = 1;
  named.count = 3;
  named.names = {"ball0", "nobody", "ball1"};
  named.poses = {{1, 0, 0, 1, 0, 0, 0}, {2, 0, 0, 1, 0, 0, 0}, {3, 0, 0, 1, 0, 0, 0}};
  publish(named);
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(counter("lcm.unknown_bodies"), 1u);
  EXPECT_EQ(position(1), (std::vector<double>{1, 0, 0}));
  EXPECT_EQ(position(2), (std::vector<double>{3, 0, 0}));
}

TEST_F(LcmTransportTest, AMessageThatIsLateForOneBodyIsLeftOutWhole) {
  start();
  set_poses(1, 0.1);
  const std::uint64_t revision = engine_->pose_revision();
  pose_update_t late = update(2, 0.5);
  late.stamp_ns = 1;
  publish(late);
  ASSERT_TRUE(until_counter("lcm.bad_stamps", 1));
  EXPECT_EQ(engine_->pose_revision(), revision);
  for (int i = 0; i < kMoving; ++i) EXPECT_EQ(position(1 + i), position_of(i, 0.1));
  set_poses(4, 0.4);
  EXPECT_EQ(engine_->pose_revision(), revision + 1) << "the next one is taken";
}

TEST_F(LcmTransportTest, ABadPoseAmongGoodOnesIsBadAndTheOthersHold) {
  start();
  pose_update_t message = update(1, 0.5);
  message.poses[1][0] = std::nan("");
  message.poses[2] = {0, 0, 0, 0, 0, 0, 0};
  publish(message);
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(position(1), position_of(0, 0.5));
  EXPECT_EQ(engine_->body_state(2).status, Status::kBadPose);
  EXPECT_EQ(engine_->body_state(3).status, Status::kBadPose);
  EXPECT_EQ(counter("poses.bad"), 2u);
}

TEST_F(LcmTransportTest, AMessageWithoutAPublisherIsRejected) {
  start();
  set_poses(1, 2.0);
  pose_update_t anonymous = update(2, 3.0);
  anonymous.publisher_id = 0;
  publish(anonymous);
  ASSERT_TRUE(until_counter("lcm.bad_messages", 1));
  EXPECT_EQ(position(2), position_of(1, 2.0));
}

TEST_F(LcmTransportTest, TwoPublishersOfOneBody) {
  start();
  set_poses(1, 1.0);
  publish(update(1, 1.0, 2));  // takes over, as a restarted publisher does
  ASSERT_TRUE(until_counter("lcm.pose_messages", 2));
  publish(update(2, 1.0, 2));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 3));
  EXPECT_EQ(counter("lcm.contested"), 0u);
  set_poses(2, 1.0);  // the first one returns
  EXPECT_EQ(counter("lcm.contested"), static_cast<std::uint64_t>(kMoving));
}

TEST_F(LcmTransportTest, WhereNoneAreTakenPosesChangeNothing) {
  start("", {false, {}});
  const std::uint64_t revision = engine_->pose_revision();
  publish(update(1, 0.5));
  ASSERT_TRUE(until_counter("lcm.poses_not_allowed", kMoving));
  EXPECT_EQ(counter("lcm.pose_messages"), 0u);
  EXPECT_EQ(engine_->pose_revision(), revision);
  expect_good_answer();
}

TEST_F(LcmTransportTest, PosesAreTakenOfTheAllowedBodiesAlone) {
  start("", {false, {"arm", "ball5"}});  // ball0 to ball2, and ball5: ids 1 to 3, 6
  set_poses(1, 0.5);
  for (int i = 0; i < kMoving; ++i) {
    const bool allowed = i <= 2 || i == 5;
    EXPECT_EQ(engine_->body_state(1 + i).status, allowed ? Status::kOk : Status::kNoPose) << i;
    if (allowed) {
      EXPECT_EQ(position(1 + i), position_of(i, 0.5));
    }
  }
  EXPECT_EQ(counter("lcm.poses_not_allowed"), 2u);
}

}  // namespace
}  // namespace clearance
