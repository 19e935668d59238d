// Joint positions and queries in joint space over LCM alone.
#include "clearance_lcm/joint_update_t.hpp"
#include "clearance_lcm/moving_joint_update_t.hpp"
#include "clearance_lcm/moving_pose_update_t.hpp"
#include "tests/engine/evaluate_query.h"
#include "tests/lcm/lcm_transport_fixture.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

using clearance_lcm::joint_update_t;

engine::Scene arm_scene() {
  engine::Scene scene = make_scene();
  scene.add_robot("arm0", {.urdf = source_file("tests/engine/robot/arm.urdf"), .home = {{{"joint4", -1.5}}}});
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
    message.names = {"arm0/joint1", "arm0/joint5"};
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

TEST_F(LcmJoints, VelocitiesComeOnChannelsOfTheirOwn) {
  start("", {}, arm_scene());
  const BodyPair pair{engine_->scene().find_body("table"), engine_->scene().find_body("ball0")};
  QueryView query;
  query.pairs = {&pair, 1};
  query.all_pairs = false;
  query.fields = kFieldRate;
  const auto rate = [&] { return test::evaluate(*engine_, query).view.rate[0]; };
  clearance_lcm::moving_pose_update_t moving{};
  moving.publisher_id = moving.sequence = moving.stamp_ns = 1;
  moving.count = 1;
  moving.names = {"ball0"};
  moving.poses = {{0, 0, 2, 1, 0, 0, 0}};
  moving.velocities = {{0, 0, 0, 0.5, 0, -0.25}};
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_MOVING_POSES", moving));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_NEAR(rate(), -0.25, 1e-6);
  publish(update(1, 0));  // the first on its channel, and newer
  ASSERT_TRUE(until_counter("lcm.pose_messages", 2));
  EXPECT_TRUE(std::isnan(rate())) << "a pose without a velocity is not at rest";
  EXPECT_EQ(counter("lcm.repeated"), 0u);

  clearance_lcm::moving_joint_update_t joints{};
  joints.publisher_id = joints.sequence = 1;
  joints.count = 1;
  joints.names = {"arm0/joint1"};
  joints.positions = {0.25};
  joints.velocities = {2};
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_MOVING_JOINTS", joints));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 3));
  EXPECT_EQ(position_of_joint(0), 0.25);
  publish_positions(positions(1, 0.5));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 4));
  EXPECT_EQ(position_of_joint(0), 0.5);
}

TEST_F(LcmJoints, NamesAreLookedUpAndUnknownOnesCounted) {
  start("", {}, arm_scene());
  joint_update_t message{};
  message.publisher_id = 1;
  message.sequence = 1;
  message.count = 3;
  message.names = {"arm0/joint2", "arm0/none", "arm0/grip"};
  message.positions = {0.25, 1, 0.02};
  publish_positions(message);
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(position_of_joint(1), 0.25);
  EXPECT_EQ(position_of_joint(7), 0.02);
  EXPECT_EQ(counter("lcm.unknown_bodies"), 1u);
}

TEST_F(LcmJoints, ARepeatedJointAndARobotOfOthersAreRejected) {
  start("", {.any = false, .allowed = {"ball0"}}, arm_scene());
  publish_positions(positions(1, 0.1));
  ASSERT_TRUE(until_counter("lcm.poses_not_allowed", 2));
  EXPECT_EQ(position_of_joint(0), 0);
  start("", {.any = false, .allowed = {"arm0"}}, arm_scene());
  publish_positions(positions(1, 0.1));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  EXPECT_EQ(position_of_joint(0), 0.1);
  joint_update_t twice = positions(2, 0.3);
  twice.names = {"arm0/joint5", "arm0/joint5"};
  publish_positions(twice);
  ASSERT_TRUE(until_counter("lcm.bad_stamps", 1));
  EXPECT_EQ(position_of_joint(0), 0.1);
  EXPECT_EQ(position_of_joint(4), -0.1);
}

TEST_F(LcmJoints, PositionsThatAreNoNumbersAreBadAndTheOthersHold) {
  start("", {}, arm_scene());
  for (const double position : {std::nan(""), HUGE_VAL, -HUGE_VAL, 1.1e6}) {
    joint_update_t message = positions(static_cast<std::int64_t>(counter("lcm.pose_messages")) + 1, 0.1);
    message.positions[1] = position;
    publish_positions(message);
    ASSERT_TRUE(until_counter("lcm.pose_messages", static_cast<std::uint64_t>(message.sequence)));
    EXPECT_EQ(position_of_joint(0), 0.1);
    EXPECT_EQ(engine_->joint_state(4).status, Status::kBadPose) << position;
  }
  EXPECT_EQ(counter("poses.bad"), 4u);
}

TEST_F(LcmJoints, AQueryOfAnotherNumberOfRowsOrAnOlderSceneIsRejected) {
  start("", {}, arm_scene());
  query_t message = query_message();
  message.joint_count = 1;
  message.joints = {"arm0/joint1"};
  message.row_count = 2;
  message.positions = {{0.1}, {0.2}};
  message.body_count = 1;
  message.bodies = {1};
  message.configuration_count = 1;
  message.configurations = {{pose_of(0, 0)}};
  const auto rejected = [&] {
    const auto reply = evaluate(message);
    return reply ? reply->error_text : "no reply";
  };
  EXPECT_EQ(rejected(), "1 configurations of bodies and 2 of joints: expected equal numbers, or no bodies");
  message.configuration_count = 0;
  message.configurations.clear();
  EXPECT_EQ(rejected(), "0 configurations of bodies and 2 of joints: expected equal numbers, or no bodies");
  message.body_count = 0;
  message.bodies.clear();
  message.scene_revision = 12345;
  EXPECT_EQ(rejected(),
            "the scene is revision " + std::to_string(engine_->scene_revision()) + ", the query is for 12345");
}

TEST_F(LcmJoints, QueriesInJointSpaceAreAnswered) {
  start("", {}, arm_scene());
  set_poses(1, 0.0);
  query_t message = query_message();
  message.reduce = query_t::REDUCE_MIN;
  message.joint_count = 2;
  message.joints = {"arm0/joint1", "arm0/joint4"};
  message.row_count = 3;
  message.positions = {{0, -1}, {0.5, -1.2}, {1, -0.4}};
  const auto reply = evaluate(message);
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
  const auto unknown = evaluate(message);
  ASSERT_TRUE(unknown);
  EXPECT_EQ(unknown->error_text, "joints[1]: there is no joint 'arm0/joint9'");
  message.joints[1] = "arm0/joint1";
  const auto twice = evaluate(message);
  ASSERT_TRUE(twice);
  EXPECT_EQ(twice->error_text, "joints[1]: 'arm0/joint1' is named twice");
}

TEST_F(LcmJoints, MotionsAreAnsweredAllTheWay) {
  start("", {}, arm_scene());
  set_poses(1, 0.0);
  query_t message = query_message();
  message.reduce = query_t::REDUCE_MIN;
  message.abs_tol = 1e-3;
  message.joint_count = 2;
  message.joints = {"arm0/joint1", "arm0/joint4"};
  message.row_count = 4;
  message.positions = {{0, -1}, {0.5, -1.2}, {1, -0.4}, {-1, -0.6}};
  message.max_evaluations = 64;
  const auto least = evaluate(message);
  ASSERT_TRUE(least);
  ASSERT_EQ(least->error_code, 0) << least->error_text;
  ASSERT_EQ(least->lower.size(), 2u);
  EXPECT_EQ(least->configurations, 2);
  message.reduce = query_t::REDUCE_ANY;
  message.abs_tol = 0;
  message.margin = 100;  // greater than any distance
  const auto decided = evaluate(message);
  ASSERT_TRUE(decided);
  ASSERT_EQ(decided->error_code, 0) << decided->error_text;
  ASSERT_EQ(decided->status.size(), 2u);
  EXPECT_LE(decided->status[0], static_cast<int>(Status::kContact)) << "a pair is proved within";
  message.max_evaluations = -1;
  const auto negative = evaluate(message);
  ASSERT_TRUE(negative);
  EXPECT_EQ(negative->error_text, "query: max_evaluations must be 0 to 65536, got 4294967295");
}

TEST_F(LcmJoints, ConfigurationsOfBodiesMayBeMotionsAndGoWithThoseOfJoints) {
  start("", {}, arm_scene());
  set_poses(1, 0.0);
  query_t message = query_message();
  message.reduce = query_t::REDUCE_MIN;
  message.abs_tol = 1e-3;
  message.pair_count = 1;
  message.pairs = {{0, 1}};  // the table below, and a ball
  message.body_count = 1;
  message.bodies = {1};
  message.configuration_count = 2;
  message.configurations = {{{-1, 0, 2, 1, 0, 0, 0}}, {{1, 0, 1, 1, 0, 0, 0}}};
  const auto states = evaluate(message);
  ASSERT_TRUE(states);
  ASSERT_EQ(states->lower.size(), 2u);
  message.max_evaluations = 64;
  const auto motion = evaluate(message);
  ASSERT_TRUE(motion);
  ASSERT_EQ(motion->error_code, 0) << motion->error_text;
  ASSERT_EQ(motion->lower.size(), 1u);
  EXPECT_NEAR(motion->upper[0], states->upper[1], 1e-3) << "its end is the nearest";
  message.joint_count = 1;
  message.joints = {"arm0/joint1"};
  message.row_count = 2;
  message.positions = {{0.1}, {0.2}};
  const auto both = evaluate(message);
  ASSERT_TRUE(both);
  ASSERT_EQ(both->error_code, 0) << both->error_text;
  ASSERT_EQ(both->lower.size(), 1u);
  EXPECT_EQ(both->lower[0], motion->lower[0]) << "the pair has no link";
}

TEST_F(LcmJoints, AQueryWaitsForPositionsOfItsStamp) {
  start("", {}, arm_scene());
  publish_positions(positions(1, 0.1));
  ASSERT_TRUE(until_counter("lcm.pose_messages", 1));
  query_t waiting = query_message();
  waiting.reduce = query_t::REDUCE_MIN;
  waiting.min_pose_stamp_ns = 2000;
  waiting.deadline_ns = 10'000'000'000;
  waiting.joint_count = 1;
  waiting.joints = {"arm0/joint2"};
  waiting.row_count = 1;
  waiting.positions = {{0.4}};
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_QUERY", waiting));
  ASSERT_TRUE(until_counter("queries.held_back", 1));
  EXPECT_TRUE(answers_.empty());
  publish_positions(positions(2, 0.2));
  ASSERT_TRUE(until([&] { return answers_.size() == 1; }));
  const reply_t& reply = answers_.begin()->second.whole;
  EXPECT_EQ(reply.error_code, 0) << reply.error_text;
  EXPECT_EQ(reply.request_id, waiting.request_id);
  EXPECT_EQ(reply.snapshot_stamp_ns, 2000);

  waiting.request_id = ++last_request_;
  waiting.reduce = query_t::REDUCE_NONE;
  waiting.min_pose_stamp_ns = 2001;
  waiting.deadline_ns = 1;
  answers_.clear();
  ASSERT_TRUE(bus_->publish_message("CLEARANCE_QUERY", waiting));
  ASSERT_TRUE(until([&] { return answers_.size() == 1; }));
  EXPECT_EQ(answers_.begin()->second.whole.error_code, reply_t::ERROR_POSES_LATE);
  EXPECT_EQ(answers_.begin()->second.whole.error_text, "no poses with stamp 2001 or newer came within 0.000001 ms");
}

}  // namespace
}  // namespace clearance
