// Device queries, compared with the CPU's answers, also in graphs.
#include "engine/device/query/device_plan.h"
#include "tests/engine/cuda/uncertain_scene.h"
#include "tests/gpu/device_memory.h"

namespace clearance::test {
namespace {

// Groups that share both hulls, ungrouped pairs, rounded bodies, and bodies of several convex parts.
engine::Scene scene_of_all_kinds(int count, double box) {
  Random random(23);
  engine::Scene scene;
  for (int i = 0; i < count; ++i) {
    const std::string name = "b" + std::to_string(i);
    const engine::Scene::BodyOptions options{.is_static = i % 6 == 5, .pose = random.pose(box)};
    if (i % 30 == 7) {
      scene.add_hull(name, cloud_on_sphere(600, 0.6, 3), options);
    } else if (i % 20 == 13) {
      Body body;
      body.name = name;
      body.is_static = options.is_static;
      body.pose = options.pose;
      body.parts = {make_convex_part(cloud_on_sphere(10, 0.3, 5)),
                    make_convex_part(random.cloud(10, {0.4, 0.1, 0.3}), 0.05)};
      scene.add_body(std::move(body));
    } else if (i % 4 == 0) {
      scene.add_capsule(name, 0.2, 0.5, options);
    } else if (i % 4 == 1) {
      scene.add_hull(name, cloud_on_sphere(200, 0.5, 4), options);
    } else if (i % 4 == 2) {
      scene.add_box(name, {0.5, 1, 0.25}, options);
    } else {
      scene.add_uv_sphere(name, 0.5, 5, options);
    }
  }
  return scene;
}

class DevicePlans : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

// Configurations of a query, some axis-aligned at round coordinates, so that bodies touch exactly.
struct Requested {
  std::vector<std::uint32_t> bodies;
  std::vector<Pose> poses;
  QueryView q;

  Requested(const engine::Scene& scene, std::uint32_t configurations, double box) {
    Random random(7);
    for (std::uint32_t b = 0; b < scene.bodies().size() && bodies.size() < 20; ++b)
      if (!scene.bodies()[b].is_static) bodies.push_back(b);
    for (std::uint32_t k = 0; k < configurations; ++k)
      for (std::size_t m = 0; m < bodies.size(); ++m) {
        Pose pose = random.pose(box);
        if (k % 5 == 2)
          pose = {{std::round(pose.translation.x), std::round(4 * pose.translation.y) / 4, 0.0}, 1, 0, 0, 0};
        poses.push_back(pose);
      }
    if (configurations > 3) poses[3 * bodies.size()].qw = std::numeric_limits<double>::quiet_NaN();
    q.configuration_count = configurations;
    if (configurations == 0) return;
    q.bodies = bodies;
    q.configurations = poses;
  }
};

// A device query with the caller's memory.
struct Running {
  std::unique_ptr<DevicePlan> plan;
  DeviceMemory poses, positions, rows;
  ReplyView view;
  DeviceStream stream;

  Running(const engine::Engine& engine, const QueryView& q)
      : plan(engine.plan_on_device(q)),
        poses(q.configurations.size_bytes()),
        positions(q.positions.size_bytes()),
        rows(bytes_of(plan->size())),
        view(view_over(rows.data())) {
    put(q);
  }
  static std::size_t bytes_of(const QuerySize& size) {
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, size.rows, size.fields, &bytes, size.joints);
    return bytes;
  }
  ReplyView view_over(std::byte* memory) const {
    const QuerySize& size = plan->size();
    return reply_view_over(memory, size.rows, size.fields, nullptr, size.joints);
  }
  void put(const QueryView& q) {
    poses.put(q.configurations.data(), q.configurations.size_bytes());
    positions.put(q.positions.data(), q.positions.size_bytes());
  }
  GivenOnDevice given() const {
    return {reinterpret_cast<const Pose*>(poses.data()), reinterpret_cast<const double*>(positions.data())};
  }
  void run() { plan->run(given(), view, stream.get()); }
  Answer answer() {
    stream.wait();
    Answer a;
    a.size = plan->size();
    const std::vector<std::byte> all = rows.get();
    a.memory.resize(all.size() + 64);
    void* base = a.memory.data();
    std::size_t room = a.memory.size();
    std::align(64, all.size(), base, room);
    std::memcpy(base, all.data(), all.size());
    a.view = view_over(static_cast<std::byte*>(base));
    a.info.rows = a.info.total = a.size.rows;
    return a;
  }
};

bool same_row(const ReplyView& a, const ReplyView& b, std::uint64_t row) {
  bool same = true;
  const auto compare = [&](auto* x, auto* y, std::uint64_t width) {
    for (std::uint64_t i = row * width; x && i < (row + 1) * width; ++i) same = same && same_bits(x[i], y[i]);
  };
  for_each_column(compare, a, b);
  return same;
}

// The CPU's bits, except for few rows whose intervals intersect the CPU's and whose points are as far apart as
// reported.
void expect_the_cpus(const Answer& got, const Answer& cpu, const std::string& what) {
  ASSERT_EQ(got.size.rows, cpu.info.rows) << what;
  std::uint64_t others = 0;
  for (std::uint64_t row = 0; row < got.size.rows; ++row) {
    if (same_row(got.view, cpu.view, row)) continue;
    ++others;
    const auto bounds = [&](const ReplyView& v) {
      return v.lower ? std::pair(v.lower[row], v.upper[row])
                     : std::pair<double, double>(v.bounds[2 * row], v.bounds[2 * row + 1]);
    };
    const auto [lower, upper] = bounds(got.view);
    const auto [cpu_lower, cpu_upper] = bounds(cpu.view);
    EXPECT_TRUE(lower <= cpu_upper && cpu_lower <= upper) << what << ", row " << row << ": [" << lower << ", " << upper
                                                          << "] and [" << cpu_lower << ", " << cpu_upper << "]";
    if (!got.view.status) continue;
    const auto status = static_cast<Status>(got.view.status[row]);
    EXPECT_TRUE(status == Status::kUnconverged || status == Status::kContact || status == Status::kOverlap ||
                status == Status::kOk || status == Status::kBeyond)
        << what << ", row " << row;
  }
  EXPECT_LE(others, got.size.rows / 20 + 2) << what << ": few are left to the CPU";
}

const std::uint32_t kBounds = kFieldLower | kFieldUpper;

TEST_F(DevicePlans, HaveTheBitsOfTheCpuWhereverTheDeviceFinishesARow) {
  for (const double box : {2.0, 12.0}) {
    const engine::Engine device(scene_of_all_kinds(120, box), {"cuda"}),
        cpu(scene_of_all_kinds(120, box), {.backend = "cpu", .covers = engine::Covers::kOff});
    for (const std::uint32_t configurations : {0u, 1u, 50u})
      for (const Precision precision : {Precision::kF64, Precision::kF32})
        for (const std::uint32_t fields : {kBounds, kDefaultFields | kFieldBounds, kAllFields | kFloat32, kFloat32})
          for (const double max_distance : {std::numeric_limits<double>::infinity(), 1.0}) {
            Requested requested(device.scene(), configurations, box);
            requested.q.fields = fields;
            requested.q.precision = precision;
            requested.q.max_distance = max_distance;
            Running running(device, requested.q);
            running.rows.fill(0x5a);
            running.run();
            expect_the_cpus(running.answer(), evaluate(cpu, requested.q),
                            "box " + std::to_string(box) + ", K " + std::to_string(configurations) + ", fields " +
                                std::to_string(fields) + (precision == Precision::kF32 ? ", f32" : "") +
                                (max_distance < 2 ? ", near" : ""));
          }
  }
}

TEST_F(DevicePlans, GoThroughMoreRowsThanAChunkHolds) {
  const auto scene = [] { return scene_of_all_kinds(60, 6); };
  const engine::Engine device(scene(), {"cuda"}), cpu(scene(), {.backend = "cpu", .covers = engine::Covers::kOff});
  Requested requested(device.scene(), 6000, 6);
  requested.q.fields = kBounds;
  Running running(device, requested.q);
  ASSERT_GT(running.plan->size().rows, std::uint64_t{1} << 22);
  running.run();
  expect_the_cpus(running.answer(), evaluate(cpu, requested.q), "several chunks");
}

// Captured in a graph, a device query reads its input memory again on each launch.
// \param plain a device query that was created with `others`
void expect_captured(const engine::Engine& device, Running& running, Running& plain, const QueryView& others) {
  plain.run();
  const Answer expected = plain.answer();
  const std::uint64_t allocations = counter(device, "cuda.allocations");
  running.stream.capture([&] { running.run(); });
  running.put(others);
  for (int round = 0; round < 3; ++round) {
    running.rows.fill(0x5a);
    running.stream.launch();
    const Answer got = running.answer();
    std::uint64_t different = 0;
    for (std::uint64_t row = 0; row < got.size.rows; ++row) different += !same_row(got.view, expected.view, row);
    EXPECT_EQ(different, 0u) << "round " << round;
  }
  EXPECT_EQ(counter(device, "cuda.allocations"), allocations) << "a run takes no memory";
}

TEST_F(DevicePlans, AreCapturedInGraphsThatReadPosesAgain) {
  const engine::Engine device(scene_of_all_kinds(80, 4), {"cuda"});
  Requested requested(device.scene(), 64, 4), others(device.scene(), 64, 3);
  requested.q.fields = others.q.fields = kDefaultFields;
  Running running(device, requested.q), plain(device, others.q);
  expect_captured(device, running, plain, others.q);
}

TEST_F(DevicePlans, HaveMemoryOfTheirOwnForRows) {
  const engine::Engine device(scene_of_all_kinds(40, 4), {"cuda"});
  Requested requested(device.scene(), 8, 4);
  requested.q.fields = kDefaultFields;
  Running running(device, requested.q);
  const ReplyView own = running.plan->own_rows();
  EXPECT_TRUE(own.lower && own.upper && own.status && own.distance && !own.point_a);
  EXPECT_EQ(running.plan->own_rows().lower, own.lower) << "the same each time";
  EXPECT_EQ(running.plan->device(), 0);
  running.plan->run(running.given(), own, nullptr);
  running.plan->run(running.given(), running.view, nullptr);
}

// A robot on an uncertain cart, bodies that follow its links, bodies of several convex parts, all with slack, and
// certain bodies. Some configurations are bad, some beyond limits.
struct JointRequested : UncertainCase {
  JointRequested(std::uint32_t configurations, std::uint64_t seed) : UncertainCase(configurations, seed) {
    poses[3].qw = poses[3].qx = poses[3].qy = poses[3].qz = 0;
    positions[1] = 5;  // beyond its limits
    positions[2 * joints.size()] = std::numeric_limits<double>::quiet_NaN();
  }
};

TEST_F(DevicePlans, TakeThePositionsOfJoints) {
  for (const std::uint32_t fields :
       {kBounds, kDefaultFields, kAllFields | kFieldBounds, kAllFields | kFieldGradientJoints})
    for (const Precision precision : {Precision::kF64, Precision::kF32})
      for (const double max_distance : {std::numeric_limits<double>::infinity(), 0.2}) {
        JointRequested requested(200, 11);
        const engine::Engine device(uncertain_robot_scene(false), {"cuda"}),
            cpu(std::move(requested.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
        requested.q.fields = fields;
        requested.q.precision = precision;
        requested.q.max_distance = max_distance;
        Running running(device, requested.q);
        running.rows.fill(0x5a);
        running.run();
        expect_the_cpus(running.answer(), evaluate(cpu, requested.q),
                        "fields " + std::to_string(fields) + (precision == Precision::kF32 ? ", f32" : "") +
                            (max_distance < 1 ? ", near" : ""));
        if (fields != kDefaultFields) continue;
        requested.bodies.clear();  // joints alone
        requested.poses.clear();
        requested.point();
        Running alone(device, requested.q);
        alone.run();
        expect_the_cpus(alone.answer(), evaluate(cpu, requested.q), "joints alone");
      }
}

// Rows that equal the CPU's, or come from pairs left open by the device and have valid bounds.
struct Soundness {
  std::uint64_t rows = 0, others = 0, beyond = 0, within = 0;
  std::uint64_t other_points = 0;  // of otherwise equal rows

  void add(const Answer& got, const Answer& cpu, bool any, const std::string& what) {
    rows += got.size.rows;
    for (std::uint64_t row = 0; row < got.size.rows; ++row) {
      const auto mine = static_cast<Status>(got.view.status[row]), theirs = static_cast<Status>(cpu.view.status[row]);
      const auto is_hit = [](Status s) { return s == Status::kOk || s == Status::kOverlap || s == Status::kContact; };
      const std::string where = what + ", row " + std::to_string(row);
      beyond += mine == Status::kBeyond;
      within += is_hit(mine);
      if (same_row(got.view, cpu.view, row)) continue;
      if (says_the_same(got.view, cpu.view, row)) {  // a common point of two bodies is not unique
        ++other_points;
        EXPECT_TRUE(mine == Status::kOverlap || mine == Status::kContact) << where;
        continue;
      }
      ++others;
      if (any) {  // proofs must not contradict each other
        EXPECT_FALSE(mine == Status::kBeyond && theirs != Status::kBeyond) << where;
        EXPECT_FALSE(theirs == Status::kBeyond && is_hit(mine)) << where;
      } else {
        EXPECT_TRUE(got.view.lower[row] <= cpu.view.upper[row] && cpu.view.lower[row] <= got.view.upper[row])
            << where << ": [" << got.view.lower[row] << ", " << got.view.upper[row] << "] and [" << cpu.view.lower[row]
            << ", " << cpu.view.upper[row] << "]";
      }
    }
  }

 private:
  static bool says_the_same(ReplyView a, ReplyView b, std::uint64_t row) {
    for (ReplyView* view : {&a, &b}) {
      view->point_a = view->point_b = view->normal = view->gradient = view->gradient_joints = nullptr;
      view->parts = nullptr;
      view->flags = nullptr;
    }
    return same_row(a, b, row);
  }
};

TEST_F(DevicePlans, ReduceEachConfiguration) {
  for (const Reduce reduce : {Reduce::kMin, Reduce::kAny})
    for (const std::uint32_t fields : {kDefaultFields | kFieldPairLower, kAllFields | kFieldGradientJoints}) {
      Soundness all;
      for (const int way : {0, 1, 2})
        for (std::size_t first = 0; first < 12; ++first) {
          JointRequested requested(100, 13 + first);
          // Few of the pairs at a time, since otherwise every configuration has an overlap.
          std::size_t at = 0;
          std::erase_if(requested.pairs, [&](BodyPair) { return at++ % 12 != first; });
          requested.point();
          const engine::Engine device(uncertain_robot_scene(false), {"cuda"}),
              cpu(std::move(requested.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
          std::vector<double> margins(requested.pairs.size());
          Random random(8);
          for (double& margin : margins) margin = random.uniform(0, 0.05);
          requested.q.fields = fields;
          requested.q.reduce = reduce;
          if (reduce == Reduce::kMin) {
            if (way == 1) requested.q.max_distance = 0.05;
            if (way == 2) requested.q.rel_tol = 0.1;
          } else {
            if (way == 1) requested.q.margin = 0.02;
            if (way == 2) requested.q.pair_margins = margins;
          }
          Running running(device, requested.q);
          running.rows.fill(0x5a);
          running.run();
          all.add(running.answer(), evaluate(cpu, requested.q), reduce == Reduce::kAny,
                  "reduce " + std::to_string(int(reduce)) + ", way " + std::to_string(way));
        }
      EXPECT_EQ(all.rows, 3600u);
      EXPECT_GT(all.within, 500u);
      EXPECT_GT(all.beyond, 30u);
      EXPECT_LT(all.others, all.rows / 20);
      EXPECT_LT(all.other_points, all.rows / 2);
    }
}

// Without uncertainty, teams decide the least distance of poses: in several chunks, and without configurations.
TEST_F(DevicePlans, ReduceWhatIsKnownToo) {
  for (const Reduce reduce : {Reduce::kMin, Reduce::kAny})
    for (const std::uint32_t configurations : {0u, 1u, 50u, 3000u}) {
      // With single and with several convex parts.
      for (const bool several : {false, true}) {
        const auto scene = [&] { return several ? scene_of_all_kinds(60, 9) : mixed_scene(60, 9, 5); };
        const engine::Engine device(scene(), {"cuda"}),
            cpu(scene(), {.backend = "cpu", .covers = engine::Covers::kOff});
        Requested requested(device.scene(), configurations, 9);
        requested.q.fields = kDefaultFields | kFieldPoints;
        requested.q.reduce = reduce;
        Running running(device, requested.q);
        running.rows.fill(0x5a);
        running.run();
        const Answer got = running.answer(), expected = evaluate(cpu, requested.q);
        const std::uint64_t K = std::max(configurations, 1u);
        Soundness all;
        all.add(got, expected, reduce == Reduce::kAny, "reduce " + std::to_string(int(reduce)));
        EXPECT_EQ(all.rows, K);
        EXPECT_LE(all.others, K / 4 + 2) << (several ? "several pieces" : "single ones");
      }
    }
}

// A box exactly on another: neither contact nor clearance can be proved, and the result must not be free.
TEST_F(DevicePlans, CallNothingFreeThatTouches) {
  engine::Scene scene;
  scene.add_box("floor", {4, 4, 1}, {.is_static = true, .pose = Pose()});
  scene.add_box("box", {1, 1, 1}, {});
  scene.add_capsule("capsule", 0.5, 1, {});
  const engine::Engine device(std::move(scene), {"cuda"});
  const std::vector<std::uint32_t> bodies{1, 2};
  const std::vector<Pose> poses{Pose{{0, 0, 1}},   Pose{{5, 0, 9}}, Pose{{0, 0, 3}},
                                Pose{{1, 1, 1.5}}, Pose{{0, 0, 3}}, Pose{{3, 0, 3}}};
  QueryView q;
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = 3;
  q.fields = kDefaultFields;
  for (const Reduce reduce : {Reduce::kAny, Reduce::kMin}) {
    q.reduce = reduce;
    Running running(device, q);
    running.run();
    const Answer got = running.answer();
    for (int k = 0; k < 2; ++k) {
      const auto status = static_cast<Status>(got.view.status[k]);
      EXPECT_TRUE(status == Status::kUnconverged || status == Status::kContact) << k << ": " << int(status);
      EXPECT_LE(got.view.lower[k], 0) << k;
      EXPECT_GE(got.view.upper[k], 0) << k;
      EXPECT_LT(got.view.upper[k], 1e-9) << k << ": but the bound that a run proves is a good one";
    }
    EXPECT_EQ(got.view.status[2], static_cast<std::uint8_t>(reduce == Reduce::kAny ? Status::kBeyond : Status::kOk));
  }
}

TEST_F(DevicePlans, ReducedFromJointsAreCapturedInGraphs) {
  for (const Reduce reduce : {Reduce::kMin, Reduce::kAny}) {
    JointRequested requested(64, 3), others(64, 4);
    const engine::Engine device(std::move(requested.scene), {"cuda"});
    requested.q.fields = others.q.fields = kDefaultFields | kFieldGradientJoints;
    requested.q.reduce = others.q.reduce = reduce;
    Running running(device, requested.q), plain(device, others.q);
    expect_captured(device, running, plain, others.q);
  }
}

std::string rejection(const engine::Engine& engine, const QueryView& q) {
  try {
    engine.plan_on_device(q);
  } catch (const engine::QueryError& e) {
    return e.what();
  }
  return "";
}

TEST_F(DevicePlans, RejectByNameWhatOnlyTheCpuAnswers) {
  engine::Scene scene = scene_of_all_kinds(12, 4);
  scene.add_box("can", {0.2, 0.2, 0.5}, {.pose = Pose(), .max_speed = 1});
  const engine::Engine device(std::move(scene), {"cuda"});
  QueryView q;
  EXPECT_NE(rejection(device, q).find("'can' has slack that grows"), std::string::npos) << rejection(device, q);
  const std::vector<BodyPair> pairs{{0, 1}};
  q.all_pairs = false;
  q.pairs = pairs;
  EXPECT_EQ(rejection(device, q), "");
  for (const Reduce reduce : {Reduce::kNearest, Reduce::kWithin}) {
    q.reduce = reduce;
    EXPECT_NE(rejection(device, q).find("reduce: expected none, min or any"), std::string::npos);
  }
  q.reduce = Reduce::kNone;
  q.max_pose_age_ns = 1;
  EXPECT_NE(rejection(device, q).find("max_pose_age_ns"), std::string::npos);
  q.max_pose_age_ns = 0;
  q.signed_distance = true;
  EXPECT_NE(rejection(device, q).find("depths"), std::string::npos);
  q.signed_distance = false;
  q.fields = kBounds;
  const auto plan = device.plan_on_device(q);
  DeviceMemory column(64);
  ReplyView view;
  view.distance = reinterpret_cast<double*>(column.data());
  EXPECT_THROW(plan->run({}, view, nullptr), engine::QueryError) << "a column that it was not made for";
  view = {};
  view.lower = reinterpret_cast<double*>(column.data() + 4);
  EXPECT_THROW(plan->run({}, view, nullptr), engine::QueryError) << "not aligned";
}

TEST(DevicePlansWithoutADevice, AreRejected) {
  const engine::Engine cpu(scene_of_all_kinds(6, 4), {.backend = "cpu", .covers = engine::Covers::kOff});
  EXPECT_NE(rejection(cpu, {}).find("no device"), std::string::npos) << rejection(cpu, {});
}

}  // namespace
}  // namespace clearance::test
