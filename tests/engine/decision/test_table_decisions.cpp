// Joint tables in decisions: a store makes them, and they decide what balls leave open, never wrongly.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <utility>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/decision/motion_decider.h"
#include "engine/decision/state_lanes.h"
#include "engine/joint_table/joint_table_record.h"
#include "engine/selection/configuration_poses.h"
#include "tests/engine/engine_test_util.h"
#include "tests/temporary_folder.h"

namespace clearance::test {
namespace {

constexpr std::chrono::minutes kPatience{10};

std::string box_shape(const std::string& origin, const std::string& size) {
  return "<collision><origin xyz='" + origin + "'/><geometry><box size='" + size + "'/></geometry></collision>";
}

/// Boxes on the links of joints `first`, `j` and `k`; `base` and `tip` have the last two between them.
engine::Scene arm_of_boxes(const std::string& range = "3") {
  const TemporaryFolder folder;
  const std::string limit = "<limit lower='-" + range + "' upper='" + range + "'/>";
  engine::RobotOptions options;
  options.urdf = folder.write(
      "r.urdf",
      "<robot name='r'><link name='root'/><link name='base'>" + box_shape("0.15 0 0", "0.3 0.1 0.1") +
          "</link><link name='mid'>" + box_shape("0 0 0", "0.02 0.02 0.02") + "</link><link name='tip'>" +
          box_shape("0.15 0 0", "0.3 0.06 0.05") +
          "</link><joint name='first' type='continuous'><parent link='root'/><child link='base'/><axis xyz='0 1 0'/>"
          "</joint><joint name='j' type='revolute'><parent link='base'/><child link='mid'/><origin xyz='0.1 0 0.1'/>"
          "<axis xyz='0 0 1'/>" +
          limit + "</joint><joint name='k' type='revolute'><parent link='mid'/><child link='tip'/><axis xyz='0 1 0'/>" +
          limit + "</joint></robot>");
  options.home.emplace();
  engine::Scene scene;
  scene.add_box("box", {0.2, 0.2, 0.2}, {.is_static = true, .pose = Pose{{0.6, 0, 0}}});
  scene.add_robot("r", options);
  return scene;
}

class TableDecisions : public testing::Test {
 protected:
  void SetUp() override { ::setenv("CLEARANCE_CACHE", "off", 1); }

  std::shared_ptr<const JointTable> table(const engine::Scene& scene, const JointTableStore& store) const {
    return store.find(*scene.robots()[0], scene.bodies()[scene.find_body("r/base")],
                      scene.bodies()[scene.find_body("r/tip")]);
  }
};

TEST_F(TableDecisions, StoreMakesATableOnce) {
  const engine::Scene scene = arm_of_boxes();
  JointTableStore store;
  EXPECT_EQ(table(scene, store), nullptr);
  store.request(scene);
  store.request(scene);
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_EQ(store.revision(), 1);
  ASSERT_TRUE(table(scene, store));
  EXPECT_EQ(table(scene, store)->column_count, 2);
  EXPECT_EQ(table(arm_of_boxes("2.5"), store), nullptr) << "other limits";
  EXPECT_TRUE(table(arm_of_boxes(), store)) << "the same robot in another scene";
}

TEST_F(TableDecisions, StoreDropsTablesWhoseOwnersAreGone) {
  const engine::Scene scene = arm_of_boxes(), other = arm_of_boxes("2.5");
  JointTableStore store;
  auto first = std::make_shared<int>(), second = std::make_shared<int>();
  store.request(scene, first);
  store.request(other, second);
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_EQ(store.count(), 2);
  EXPECT_EQ(store.bytes(), table(scene, store)->resident_bytes() + table(other, store)->resident_bytes());
  first.reset();
  store.request(other, second);
  EXPECT_EQ(table(scene, store), nullptr);
  ASSERT_TRUE(table(other, store));
  EXPECT_EQ(store.count(), 1);
  EXPECT_EQ(store.bytes(), table(other, store)->resident_bytes());
}

TEST_F(TableDecisions, StoreReadsTheCache) {
  const TemporaryFolder folder;
  ::setenv("CLEARANCE_CACHE", (folder / "cache").c_str(), 1);
  const engine::Scene scene = arm_of_boxes();
  const TablePair pair = *table_pair(scene.robots()[0], scene.bodies()[scene.find_body("r/base")],
                                     scene.bodies()[scene.find_body("r/tip")]);
  {
    JointTableStore store;
    store.request(scene);
    ASSERT_TRUE(store.wait(kPatience));
    const auto record = Cache::of_environment().read(joint_table_name(pair));
    ASSERT_TRUE(record);
    EXPECT_EQ(*record, joint_table_record(*table(scene, store)));
  }
  // A sound record of another table shows that records are read. A damaged one is replaced.
  std::vector<std::byte> other(joint_table_record(empty_joint_table(pair)).size(), std::byte{0});
  Cache::of_environment().write(joint_table_name(pair), other);
  {
    JointTableStore store;
    store.request(scene);
    ASSERT_TRUE(store.wait(kPatience));
    EXPECT_EQ(table(scene, store)->cells[0].high, 0);
  }
  other.pop_back();
  Cache::of_environment().write(joint_table_name(pair), other);
  JointTableStore store;
  store.request(scene);
  ASSERT_TRUE(store.wait(kPatience));
  EXPECT_EQ(joint_table_record(*table(scene, store)), *Cache::of_environment().read(joint_table_name(pair)));
}

// Covers and tables of arm_of_boxes(), made once.
struct Stores {
  CoverStore covers;
  JointTableStore tables;

  static Stores& made() {
    static Stores stores;
    return stores;
  }

 private:
  Stores() {
    const engine::Scene scene = arm_of_boxes();
    for (const char* name : {"r/base", "r/mid", "r/tip"}) covers.request({scene.bodies()[scene.find_body(name)].parts});
    tables.request(scene);
    EXPECT_TRUE(covers.wait(kPatience) && tables.wait(kPatience));
  }
};

// A query of random states, or motions between them, with its covers and tables.
struct Decided {
  engine::Scene scene = arm_of_boxes();
  CoverStore& covers = Stores::made().covers;
  JointTableStore& tables = Stores::made().tables;
  PoseStore poses{scene, std::chrono::seconds(60)};
  std::vector<std::uint32_t> joints;
  std::vector<double> positions;
  QueryView query;
  Plan plan;

  /// \param names of the joints that move
  Decided(const std::vector<std::string>& names, std::uint32_t states, double margin) {
    Random random(3);
    for (const std::string& name : names) joints.push_back(scene.find_joint("r/" + name));
    for (std::size_t i = 0; i < states * joints.size(); ++i) positions.push_back(random.uniform(-3.1, 3.1));
    query.joints = joints;
    query.reduce = Reduce::kAny;
    query.margin = margin;
    query.fields = kFieldVerdict;
    query.positions = positions;
    query.configuration_count = states;
  }
  const Plan& make() {
    plan = make_plan(query, scene, poses.snapshot(), 1u << 20, true);
    plan.uncertainties = uncertainties_of(scene, *plan.snapshot, plan.begun_ns);
    return plan;
  }
  /// Whether each configuration, or motion, is free: from the exact engine.
  std::vector<bool> exact() const {
    const engine::Engine engine(engine::Scene(scene), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
    QueryView q = query;
    q.fields = kFieldStatus;
    const Answer answer = evaluate(engine, q);
    std::vector<bool> free;
    for (std::uint64_t i = 0; i < answer.info.rows; ++i)
      free.push_back(answer.view.status[i] == std::uint8_t(Status::kBeyond));
    return free;
  }
};

TEST_F(TableDecisions, TablesDecideStatesThatBallsLeaveOpen) {
  constexpr std::uint32_t kStates = 2000;
  std::size_t all_open[2] = {0, 0};  // without and with tables
  for (const std::vector<std::string>& names :
       {std::vector<std::string>{"first", "j", "k"}, {"j", "k"}, {"k", "first"}})
    for (const double margin : {0.0, 0.01}) {
      Decided decided(names, kStates, margin);
      const Plan& plan = decided.make();
      const std::vector<bool> free = decided.exact();
      ConfigurationPoses at(plan);
      const auto block = at.at(0, kStates);
      const std::vector<std::uint8_t> usable(kStates, 1);
      std::size_t open_without = 0, open_with = 0;
      for (const bool with : {false, true})
        for (const DecisionKernel& kernel : decision_kernels()) {
          const auto covers = CoverPlan::make(decided.scene, plan, decided.covers, with ? &decided.tables : nullptr);
          ASSERT_TRUE(covers);
          EXPECT_EQ(covers->view().tabled_count, with ? 1 : 0);
          std::vector<Decision> decisions(kStates);
          std::vector<std::uint64_t> open(kStates * 8);
          kernel.run({&covers->view(), block.poses.data(), plan.bodies.size(), kStates, usable.data(), true,
                      decided.positions.data(), names.size()},
                     {decisions.data(), open.data(), static_cast<std::uint32_t>(open.size())});
          std::size_t& count = with ? open_with : open_without;
          count = 0;
          for (std::uint32_t i = 0; i < kStates; ++i) {
            count += decisions[i].verdict == Verdict::kUnresolved;
            if (decisions[i].verdict != Verdict::kUnresolved) {
              EXPECT_EQ(decisions[i].verdict == Verdict::kFree, free[i]) << i << " " << kernel.name << " " << with;
            }
          }
        }
      EXPECT_LE(open_with, open_without) << names.size() << " " << margin;
      all_open[0] += open_without;
      all_open[1] += open_with;
    }
  EXPECT_GT(all_open[0], 100);
  EXPECT_LT(5 * all_open[1], 4 * all_open[0]);
  std::printf("%zu states left open without tables, %zu with them\n", all_open[0], all_open[1]);
}

// The cells that are found before the bodies are placed, of one state and of eight: the same decisions.
TEST_F(TableDecisions, CellsOfStatesInLanesDecideAsThePositionsDo) {
  constexpr std::uint32_t kStates = 203;
  Decided decided({"first", "j", "k"}, kStates, 0);
  decided.positions[3 * 17 + 1] = std::numeric_limits<double>::quiet_NaN();
  const Plan& plan = decided.make();
  const auto covers = CoverPlan::make(decided.scene, plan, decided.covers, &decided.tables);
  ASSERT_TRUE(covers);
  const DecisionView& view = covers->view();
  ASSERT_EQ(view.tabled_count, 1u);
  StateLanes lanes(*covers, plan);
  ASSERT_TRUE(lanes.can_place());
  const auto decide = [&](const DecisionBatch& batch) {
    std::vector<Decision> decisions(batch.states);
    std::vector<std::uint64_t> open(batch.states * std::size_t{plan.pairs.size()});
    decision_kernels()[0].run(batch, {decisions.data(), open.data(), static_cast<std::uint32_t>(open.size())});
    std::vector<std::pair<Verdict, std::size_t>> found;  // with the number of open pairs
    for (const Decision& d : decisions) found.emplace_back(d.verdict, d.open_end - d.open_begin);
    return found;
  };
  ConfigurationPoses at(plan);
  const auto block = at.at(0, kStates);
  std::vector<std::uint8_t> usable(kStates, 1);
  usable[17] = 0;
  DecisionBatch by_positions{&view, block.poses.data(), plan.bodies.size(), kStates, usable.data(), true};
  const auto without = decide(by_positions);
  by_positions.positions = decided.positions.data();
  by_positions.position_stride = 3;
  const auto with = decide(by_positions);
  EXPECT_NE(with, without) << "the table decides some";
  for (std::uint32_t k = 0; k < kStates; ++k) {
    const Pose* const poses = lanes.place_one(k);
    EXPECT_EQ(decide({.view = &view,
                      .poses = poses,
                      .stride = plan.bodies.size(),
                      .states = 1,
                      .usable = lanes.usable(),
                      .any_hit = true,
                      .cells = lanes.cells()})[0],
              with[k]);
  }
  for (std::uint32_t first = 0; first < kStates; first += kMostLanes) {
    const std::size_t count = std::min<std::size_t>(kMostLanes, kStates - first);
    lanes.place(first, count);
    const auto found = decide({.view = &view,
                               .poses = nullptr,
                               .stride = 0,
                               .states = count,
                               .usable = lanes.usable(),
                               .any_hit = true,
                               .frames = lanes.frames(),
                               .cells = lanes.cells()});
    for (std::size_t k = 0; k < count; ++k) EXPECT_EQ(found[k], with[first + k]);
  }
}

TEST_F(TableDecisions, TablesDecideMotionsThatBallsLeaveOpen) {
  constexpr std::uint32_t kMotions = 300;
  Decided decided({"first", "j", "k"}, 2 * kMotions, 0);
  decided.query.max_evaluations = 1000;
  const Plan& plan = decided.make();
  const std::vector<bool> free = decided.exact();
  ASSERT_EQ(free.size(), kMotions);
  std::size_t open[2] = {0, 0}, frees = 0;
  for (const bool with : {false, true}) {
    const auto covers = CoverPlan::make(decided.scene, plan, decided.covers, with ? &decided.tables : nullptr);
    ASSERT_TRUE(covers && covers->rates());
    MotionDecider decider(*covers, plan);
    for (std::uint32_t i = 0; i < kMotions; ++i) {
      const Verdict verdict = decider.decide(i);
      open[with] += verdict == Verdict::kUnresolved;
      frees += verdict == Verdict::kFree;
      if (verdict != Verdict::kUnresolved) {
        EXPECT_EQ(verdict == Verdict::kFree, free[i]) << i << " " << with;
      }
    }
  }
  EXPECT_LT(open[1], open[0]);
  EXPECT_GT(frees, 20);
}

}  // namespace
}  // namespace clearance::test
