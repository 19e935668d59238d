// Joint positions and queries in joint space over LCM alone.
#include "clearance_lcm/joint_query_t.hpp"
#include "clearance_lcm/joint_update_t.hpp"
#include "clearance_lcm/named_joint_update_t.hpp"
#include "lcm_transport_fixture.h"

namespace clearance {
namespace {

using clearance_lcm::joint_query_t;
using clearance_lcm::joint_update_t;
using clearance_lcm::named_joint_update_t;

Scene arm_scene() {
  Scene scene = make_scene();
  scene.add_robot("arm0", {.urdf = CLEARANCE_SOURCE_DIR "/tests/robot/arm.urdf", .home = {{{"joint4", -1.5}}}});
  return scene;
}

class LcmJoints : public LcmTransportTest {
 protected:
  static joint_update_t positions(std::int64_t sequence, double position, std::int64_t publisher = 1) {
    joint_update_t message{};
    message.publisher_id = publisher;
    message.sequence = sequence;
    message.stamp_ns = 1000 * sequence;
    message.count = 2;
    message.joints = {0, 4};
    message.positions = {position, -position};
    return message;
  }
  void publish_positions(const joint_update_t& message) {
    ASSERT_TRUE(bus_->publish_message("CLEARANCE_JOINTS", message));
  }
  double position_of_joint(std::uint32_t joint) { return engine_->joint_state(joint).position; }
};

TEST_F(LcmJoints, PositionsApplyAsAWholeWithTheRulesOfPoses) {
  start("", {}, arm_scene());
  publish_positions(positions(1, 0.1));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(position_of_joint(0), 0.1);
  EXPECT_EQ(position_of_joint(4), -0.1);
  EXPECT_EQ(engine_->joint_state(0).stamp_ns, 1000);
  publish_positions(positions(4, 0.4));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 2));
  EXPECT_EQ(counter("lcm.gaps"), 2u);
  publish_positions(positions(4, 0.9));
  ASSERT_TRUE(until_counter("lcm.repeated", 1));
  publish_positions(positions(2, 0.9));
  ASSERT_TRUE(until_counter("lcm.reordered", 1));
  EXPECT_EQ(position_of_joint(0), 0.4);
}

TEST_F(LcmJoints, NamesAreLookedUpAndUnknownOnesCounted) {
  start("", {}, arm_scene());
  named_joint_update_t message{};
  message.publisher_id = 1;
  message.sequence = 1;
  message.count = 3;
  message.names = {"arm0/joint2", "arm0/none", "arm0/grip"};
  message.positions = {0.25, 1, 0.02};
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_JOINTS_NAMED", message));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(position_of_joint(1), 0.25);
  EXPECT_EQ(position_of_joint(7), 0.02);
  EXPECT_EQ(counter("lcm.unknown_bodies"), 1u);
}

TEST_F(LcmJoints, AnOlderSceneARepeatedJointAndARobotOfOthersAreRefused) {
  start("", {.any = false, .allowed = {"ball0"}}, arm_scene());
  publish_positions(positions(1, 0.1));
  ASSERT_TRUE(until_counter("lcm.poses_not_allowed", 2));
  EXPECT_EQ(position_of_joint(0), 0);
  start("", {.any = false, .allowed = {"arm0"}}, arm_scene());
  publish_positions(positions(1, 0.1));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(position_of_joint(0), 0.1);
  joint_update_t older = positions(2, 0.2);
  older.scene_revision = 12345;
  publish_positions(older);
  ASSERT_TRUE(until_counter("lcm.wrong_scene", 1));
  joint_update_t twice = positions(3, 0.3);
  twice.joints = {4, 4};
  publish_positions(twice);
  ASSERT_TRUE(until_counter("lcm.bad_stamps", 1));
  EXPECT_EQ(position_of_joint(0), 0.1);
  EXPECT_EQ(position_of_joint(4), -0.1);
}

TEST_F(LcmJoints, QueriesInJointSpaceAreAnswered) {
  start("", {}, arm_scene());
  set_poses(1, 0.0);
  joint_query_t message{};
  message.query = question();
  message.query.reduce = query_t::REDUCE_MIN;
  message.joint_count = 2;
  message.joints = {"arm0/joint1", "arm0/joint4"};
  message.row_count = 3;
  message.positions = {{0, -1}, {0.5, -1.2}, {1, -0.4}};
  const auto send = [&] { return bus_->publish_message("CLEARANCE_JOINT_QUERY", message); };
  const auto reply = ask(message.query, send);
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->error_code, 0) << reply->error_text;
  ASSERT_EQ(reply->distance.size(), 3u);
  const std::uint32_t joints[] = {0, 3};
  const double rows[] = {0, -1, 0.5, -1.2, 1, -0.4};
  QueryView view;
  view.joints = joints;
  view.positions = rows;
  view.configuration_count = 3;
  view.reduce = Reduce::kMin;
  double lower[3];
  ReplyView columns;
  columns.lower = lower;
  Job job = engine_->start(view, columns);
  while (!job.advance()) {
  }
  for (int k = 0; k < 3; ++k) EXPECT_EQ(reply->lower[k], lower[k]);
  message.joints[1] = "arm0/joint9";
  const auto unknown = ask(message.query, send);
  ASSERT_TRUE(unknown);
  EXPECT_EQ(unknown->error_text, "joints[1]: there is no joint 'arm0/joint9'");
  message.joints[1] = "arm0/joint1";
  const auto twice = ask(message.query, send);
  ASSERT_TRUE(twice);
  EXPECT_EQ(twice->error_text, "joints[1]: 'arm0/joint1' is named twice");
}

}  // namespace
}  // namespace clearance
