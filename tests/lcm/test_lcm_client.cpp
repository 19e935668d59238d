// The C++ client over LCM and the real loop: every call, bit-identical with the engine, large batches, lost daemons.
#include <gtest/gtest.h>

#include <cstring>
#include <optional>
#include <random>
#include <thread>

#include "client/client.h"
#include "engine/engine.h"
#include "server/core/loop.h"
#include "server/requests/transport.h"
#include "tests/lcm/lcm_fixture.h"
#include "wire/protocol.h"

namespace clearance {
namespace {

constexpr std::uint32_t kBodies = 8;

class LcmClientTest : public LcmTest {
 protected:
  void SetUp() override {
    LcmTest::SetUp();
    if (IsSkipped()) return;
    engine::Scene scene;
    for (std::uint32_t i = 0; i < kBodies; ++i)
      scene.add_box("box" + std::to_string(i), {0.2, 0.3, 0.1 + 0.01 * i}, {});
    const std::vector<std::string> pair{"box0", "box1"};
    scene.add_group("pair", pair);
    engine_.emplace(std::move(scene), engine::Engine::Options{.threads = 1});
    loop_.emplace(*engine_);
    loop_->add(make_lcm_transport(url("&prefix=test/")));
    thread_ = std::thread([this] { loop_->run(); });
  }
  void TearDown() override { stop(); }
  void stop() {
    if (!thread_.joinable()) return;
    loop_->stop();
    thread_.join();
  }
  Client connect_here() { return connect(loop_->transports()[0]->url(), kPatience); }

  static Pose7 pose_of(std::uint32_t i, double t) {
    return {0.4 * i + 0.02 * std::sin(t + i), 0.1 * t, 0, 1, 0.1 * i, 0.2, 0};
  }
  static void place(Client& client, double t) {
    std::vector<std::pair<std::uint32_t, Pose7>> poses;
    for (std::uint32_t i = 0; i < kBodies; ++i) poses.push_back({i, pose_of(i, t)});
    const UpdateResult done = client.set_poses(poses, 77, 4);
    EXPECT_EQ(done.applied, kBodies);
  }
  std::optional<engine::Engine> engine_;
  std::optional<Loop> loop_;
  std::thread thread_;
};

/// Checks that distance, lower and upper of `reply` equal the engine's, bit for bit.
void expect_same_bits(const Result& reply, const engine::Engine& engine, const QueryView& query) {
  const std::uint64_t rows = engine.size(query).rows;
  std::vector<double> distance(rows), lower(rows), upper(rows);
  ReplyView view;
  view.distance = distance.data();
  view.lower = lower.data();
  view.upper = upper.data();
  Job job = engine.start(query, view);
  while (!job.advance()) {
  }
  ASSERT_EQ(reply.rows(), rows);
  EXPECT_EQ(std::memcmp(reply.distance().data(), distance.data(), rows * sizeof(double)), 0);
  EXPECT_EQ(std::memcmp(reply.lower().data(), lower.data(), rows * sizeof(double)), 0);
  EXPECT_EQ(std::memcmp(reply.upper().data(), upper.data(), rows * sizeof(double)), 0);
}

TEST_F(LcmClientTest, EveryCall) {
  Client client = connect_here();
  EXPECT_EQ(client.url(), url("&prefix=test/"));
  place(client, 1.0);
  const SceneInfo& scene = client.scene();
  EXPECT_EQ(scene.revision, engine_->scene_revision());
  ASSERT_EQ(scene.bodies.size(), kBodies);
  EXPECT_EQ(scene.bodies[3].name, "box3");
  EXPECT_EQ(client.body("box5"), 5u);
  EXPECT_EQ(client.group("pair"), kGroupBit | 0u);
  EXPECT_EQ(client.pairs().size(), kBodies * (kBodies - 1) / 2);
  const Result reply = client.distances();
  EXPECT_EQ(reply.snapshot_stamp_ns(), 77);
  EXPECT_EQ(reply.snapshot_sequence(), 4);
  EXPECT_GT(reply.pose_age_ns(), 0);
  expect_same_bits(reply, *engine_, {});
  const auto states = client.body_states();
  ASSERT_EQ(states.size(), kBodies);
  EXPECT_EQ(states[2].stamp_ns, 77);
  EXPECT_EQ(client.attach(1, 0).applied, 1u);
  client.refresh();
  EXPECT_EQ(client.scene().bodies[1].parent, 0u);
  bool counted = false;
  for (const auto& [name, value] : client.stats()) counted |= name == "lcm.frames" && value > 5;
  EXPECT_TRUE(counted);
  EXPECT_GT(client.ping().count(), 0);
  try {
    Query wrong;
    wrong.fields = 1u << 30;
    client.distances(wrong);
    FAIL() << "an unknown field was accepted";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kBadQuery));
  }
}

TEST_F(LcmClientTest, LargeBatchesBothWays) {
  Client client = connect_here();
  place(client, 1.0);
  // 2000 configurations of four bodies: 448 KB out, 52,000 rows (1.3 MB) back.
  constexpr std::uint32_t kConfigurations = 2000;
  const std::vector<std::uint32_t> bodies{1, 3, 5, 7};
  std::mt19937 random(5);
  std::uniform_real_distribution<double> anywhere(-2, 2);
  std::vector<Pose7> poses(kConfigurations * bodies.size());
  for (Pose7& pose : poses) pose = {anywhere(random), anywhere(random), anywhere(random), 1, anywhere(random), 0, 0};
  Query query;
  query.bodies = bodies;
  query.configurations = poses;
  const Result reply = patiently(client, [&] { return client.distances(query); });
  EXPECT_EQ(reply.configurations(), kConfigurations);
  EXPECT_EQ(reply.rows(), kConfigurations * reply.pairs());
  std::vector<Pose> own(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose7& p = poses[i];
    own[i] = {{p[0], p[1], p[2]}, p[3], p[4], p[5], p[6]};
  }
  QueryView view;
  view.bodies = bodies;
  view.configurations = own;
  view.configuration_count = kConfigurations;
  expect_same_bits(reply, *engine_, view);
}

// Clients of Clearance send whole frames: query_t has no fields for curves and growth.
TEST_F(LcmClientTest, BodiesThatGrowAlongCurves) {
  Client client = connect_here();
  place(client, 1.0);
  const std::vector<std::uint32_t> bodies{1, 3};
  std::vector<Pose7> poses;
  std::vector<Pose> own;
  std::vector<double> growths;
  for (std::uint32_t p = 0; p < 3; ++p)
    for (const std::uint32_t body : bodies) {
      poses.push_back({0.5 * body, 0.3 * p, 0.1 * p * p, 1, 0, 0.1, 0});
      const Pose7& X = poses.back();
      own.push_back({{X[0], X[1], X[2]}, X[3], X[4], X[5], X[6]});
      growths.push_back(0.01 * p * body);
    }
  const Query query{
      .bodies = bodies, .configurations = poses, .rel_tol = 1e-3, .control_points = 3, .growths = growths};
  QueryView view;
  view.bodies = bodies;
  view.configurations = own;
  view.configuration_count = 3;
  view.control_points = 3;
  view.max_evaluations = kDefaultEvaluations;
  view.rel_tol = 1e-3;
  view.growths = growths;
  expect_same_bits(patiently(client, [&] { return client.motions(query); }), *engine_, view);
}

TEST_F(LcmClientTest, SeveralClientsAndQueriesUnderWay) {
  Client one = connect_here(), two = connect_here();
  place(one, 2.0);
  std::vector<Pending> under_way;
  for (int i = 0; i < 8; ++i) {
    under_way.push_back(one.submit());
    under_way.push_back(two.submit());
  }
  for (auto& pending : under_way) expect_same_bits(pending.get(), *engine_, {});
}

TEST_F(LcmClientTest, ADaemonThatIsGoneIsATimeout) {
  Client client = connect_here();
  place(client, 1.0);
  stop();
  client.set_timeout(std::chrono::milliseconds(100));
  EXPECT_THROW(client.distances(), TimeoutError);
}

TEST_F(LcmClientTest, TooLargeAnAnswerIsRejected) {
  Client client = connect_here();
  place(client, 1.0);
  // 60,000 configurations of one body with all columns: 7 x 60,000 rows of 207 bytes.
  const std::vector<std::uint32_t> bodies{1};
  const std::vector<Pose7> poses(60000, pose_of(1, 0));
  Query query;
  query.bodies = bodies;
  query.configurations = poses;
  query.fields = kDefaultFields | kFieldFlags | kFieldPoints | kFieldNormal | kFieldPieces | kFieldGradient;
  try {
    patiently(client, [&] { return client.distances(query); });
    FAIL() << "an answer of 87 MB over LCM";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge));
    EXPECT_NE(std::string(error.what()).find("420000 rows"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace clearance
