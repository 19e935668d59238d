// Calls that a device query makes, and the requests it rejects. A fake device records the calls, so no GPU is needed.
#include <functional>

#include "engine/device/query/device_plan.h"
#include "tests/engine/cuda/uncertain_scene.h"
#include "tests/engine/device/fake_device.h"

namespace clearance::test {
namespace {

struct Launch {
  cuda::ChunkSetup chunk;
  ReplyView rows;
};
struct Told {
  Reduce reduce = Reduce::kWithin;
  cuda::QuerySetup setup;
  std::vector<double> margins;
  std::vector<std::uint32_t> mover_of_body;
  std::uint64_t rows = 0;
  std::uint32_t configurations = 0;
  std::vector<Launch> launches;
};

class Scribe final : public cuda::ResidentWorkspace {
 public:
  explicit Scribe(Told& told) : told_(told) {}

  cuda::FixedBodies body_buffers(std::size_t bodies) override {
    components_.resize(bodies * cuda::kPoseComponents);
    state_.resize(bodies);
    return {components_.data(), state_.data()};
  }
  void begin(const cuda::QuerySetup& setup) override {
    told_.setup = setup;
    told_.margins.assign(setup.margins.begin(), setup.margins.end());
    told_.mover_of_body.assign(setup.movers.of_body.begin(), setup.movers.of_body.end());
  }
  std::byte* chunk_input_buffer(cuda::Given, int, std::size_t) override { return nullptr; }
  std::byte* query_input_buffer(cuda::Given, std::size_t) override { return nullptr; }
  void reserve(std::uint64_t rows, std::uint32_t configurations) override {
    told_.rows = rows;
    told_.configurations = configurations;
  }
  int device() const override { return 3; }
  std::uint64_t bytes() const override { return memory_.size(); }
  std::byte* row_buffer(std::size_t bytes) override {
    memory_.resize(bytes);
    return memory_.data();
  }
  void launch(const cuda::ChunkSetup& chunk, const ReplyView& rows, const cuda::ResidentPairs&, std::uint64_t,
              void*) override {
    told_.launches.push_back({chunk, rows});
  }

 private:
  Told& told_;
  std::vector<double> components_;
  std::vector<std::uint8_t> state_;
  std::vector<std::byte> memory_;
};

class ScribesDevice final : public IdleDevice {
 public:
  ScribesDevice(Fault& fault, Told& told) : IdleDevice(fault), told_(told) {}
  std::shared_ptr<cuda::ResidentWorkspace> make_resident(Reduce reduce) override {
    told_.reduce = reduce;
    return std::make_shared<Scribe>(told_);
  }

 private:
  Told& told_;
};

class PlanLaunches : public testing::Test {
 protected:
  Fault fault_;
  Told told_;
  cuda::FakeDevice fake_device_{{true, "a stand-in", ""}, [this](const engine::Scene&, int, std::uint64_t) {
                                  return std::make_shared<ScribesDevice>(fault_, told_);
                                }};

  std::string rejection(const engine::Engine& engine, const QueryView& q) const {
    try {
      engine.plan_on_device(q);
    } catch (const engine::QueryError& e) {
      EXPECT_EQ(e.code, QueryErrorCode::kNotSupported);
      return e.what();
    }
    return "";
  }
};

// An address that is never read.
template <class T>
const T* somewhere(std::uintptr_t at) {
  return reinterpret_cast<const T*>(at);
}

TEST_F(PlanLaunches, GiveEachConfigurationToOneChunk) {
  constexpr std::uint32_t kConfigurations = 200000;
  UncertainCase c(2, 3);
  const engine::Engine engine(std::move(c.scene), {"cuda", 2});
  const std::uint64_t P = c.pairs.size(), M = c.bodies.size(), J = c.joints.size();
  c.q.configuration_count = kConfigurations;
  c.q.fields = kFieldLower | kFieldGradientJoints;
  std::vector<double> margins(P);
  for (std::size_t p = 0; p < P; ++p) margins[p] = 1e-3 * static_cast<double>(p);
  for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kAny}) {
    c.q.reduce = reduce;
    c.q.pair_margins = reduce == Reduce::kAny ? std::span<const double>(margins) : std::span<const double>();
    told_ = {};
    const auto plan = engine.plan_on_device(c.q);
    EXPECT_EQ(told_.reduce, reduce);
    EXPECT_EQ(plan->device(), 3);
    EXPECT_EQ(told_.margins, reduce == Reduce::kAny ? margins : std::vector<double>());
    EXPECT_EQ(told_.setup.moved.robots.joints, J);
    EXPECT_FALSE(told_.setup.by_teams) << "bodies have slack";
    EXPECT_FALSE(told_.setup.uncertainty.fixed_slack.empty());
    EXPECT_EQ(told_.mover_of_body.size(), engine.scene().bodies().size());
    EXPECT_EQ(plan->size().rows, kConfigurations * (reduce == Reduce::kNone ? P : 1));
    ReplyView rows;
    rows.joints = static_cast<std::uint32_t>(J);
    rows.lower = const_cast<double*>(somewhere<double>(1u << 20));
    rows.gradient_joints = const_cast<double*>(somewhere<double>(1u << 30));
    const GivenOnDevice given{somewhere<Pose>(4096), somewhere<double>(8192)};
    plan->run(given, rows, nullptr);
    ASSERT_GT(told_.launches.size(), 2u);
    std::uint64_t next = 0, all = 0;
    for (const Launch& l : told_.launches) {
      const cuda::ChunkSetup& chunk = l.chunk;
      if (chunk.first_configuration != next) {
        EXPECT_EQ(reduce, Reduce::kNone) << "parts of the pairs are of each configuration";
      }
      next = chunk.first_configuration + chunk.configurations;
      all += chunk.rows();
      EXPECT_LE(chunk.rows(), told_.rows);
      EXPECT_LE(chunk.configurations, told_.configurations);
      EXPECT_TRUE(chunk.given_on_device);
      EXPECT_EQ(chunk.poses, given.poses + chunk.first_configuration * M);
      EXPECT_EQ(chunk.positions, given.positions + chunk.first_configuration * J);
      const std::uint64_t row = chunk.first_configuration * (reduce == Reduce::kNone ? P : 1);
      EXPECT_EQ(chunk.first_row, row);
      EXPECT_EQ(l.rows.lower, rows.lower + row);
      EXPECT_EQ(l.rows.gradient_joints, rows.gradient_joints + row * J);
      EXPECT_EQ(l.rows.joints, J);
    }
    EXPECT_EQ(next, kConfigurations);
    EXPECT_EQ(all, kConfigurations * P);
    EXPECT_THROW(plan->run({given.poses, nullptr}, rows, nullptr), engine::QueryError) << "no positions";
    EXPECT_THROW(plan->run({nullptr, given.positions}, rows, nullptr), engine::QueryError) << "no poses";
    rows.joints = 1;
    EXPECT_THROW(plan->run(given, rows, nullptr), engine::QueryError) << "gradients of another number of joints";
    const ReplyView own = plan->own_rows();
    EXPECT_TRUE(own.lower && own.gradient_joints && own.joints == J && !own.upper);
  }
}

TEST_F(PlanLaunches, OfKnownBodiesTeamsFindTheLeastDistance) {
  const engine::Engine engine(spheres(20), {"cuda", 2});
  const std::vector<std::uint32_t> bodies{3, 10};
  QueryView q;
  q.reduce = Reduce::kMin;
  q.bodies = bodies;
  q.configuration_count = 5;
  const auto plan = engine.plan_on_device(q);
  EXPECT_TRUE(told_.setup.by_teams);
  EXPECT_TRUE(told_.setup.uncertainty.fixed_slack.empty() && told_.setup.movers.movers.empty());
  plan->run({somewhere<Pose>(4096), nullptr}, {}, nullptr);
  ASSERT_EQ(told_.launches.size(), 1u);
  EXPECT_EQ(told_.launches[0].chunk.configurations, 5u);
}

TEST_F(PlanLaunches, AreRejectedByName) {
  engine::Scene scene = uncertain_robot_scene(false);
  scene.add_box("mover", {0.1, 0.1, 0.1}, {.pose = Pose(), .max_speed = 1});
  scene.add_box("rider of it", {0.1, 0.1, 0.1}, {.parent = "mover", .pose = Pose()});
  scene.add_box("stands", {0.1, 0.1, 0.1}, {.is_static = true, .pose = Pose(), .max_speed = 1});
  const engine::Engine engine(std::move(scene), {"cuda", 2});
  const auto id = [&](const char* name) { return engine.scene().find_body(name); };
  const std::vector<std::uint32_t> joints{0, 1};
  std::vector<BodyPair> pairs{{id("known"), id("arm/flange")}};
  QueryView good;
  good.all_pairs = false;
  good.pairs = pairs;
  good.joints = joints;
  good.configuration_count = 8;
  EXPECT_EQ(rejection(engine, good), "");
  const auto expect_rejection = [&](const std::string& words, const std::function<void(QueryView&)>& change) {
    QueryView q = good;
    change(q);
    const std::string why = rejection(engine, q);
    EXPECT_NE(why.find(words), std::string::npos) << words << ": " << why;
  };
  for (const Reduce reduce : {Reduce::kNearest, Reduce::kWithin})
    expect_rejection("reduce: expected none, min or any", [&](QueryView& q) { q.reduce = reduce; });
  expect_rejection("signed_distance", [](QueryView& q) { q.signed_distance = true; });
  expect_rejection("max_evaluations", [](QueryView& q) { q.max_evaluations = 64; });
  expect_rejection("max_pose_age_ns", [](QueryView& q) { q.max_pose_age_ns = 1000; });
  expect_rejection("free_scale",
                   [](QueryView& q) { q.reduce = Reduce::kAny, q.fields = kFieldFreeScale | kFieldPair; });
  expect_rejection("no pairs", [](QueryView& q) { q.reduce = Reduce::kMin, q.pairs = {}; });
  for (const char* name : {"mover", "rider of it"}) {
    pairs[0].a = id(name);
    EXPECT_NE(rejection(engine, good).find("'" + std::string(name) + "' has slack that grows"), std::string::npos);
  }
  pairs[0].a = id("stands");
  EXPECT_EQ(rejection(engine, good), "") << "its pose has no age";
}

}  // namespace
}  // namespace clearance::test
