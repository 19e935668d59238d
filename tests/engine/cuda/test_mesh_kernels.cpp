// The kernel for two meshes (engine/cuda/mesh/mesh_search.cuh), compiled for the host: its intervals are checked by the
// exact oracle and compared with the CPU's, and so are pairs left to the CPU. The oracle must
// find each of its mutants (tests/mutants). No GPU needed.
#include "tests/engine/cuda/mesh_case.h"
#include "tests/oracle/oracle_run.h"
// After all other headers.
#include "tests/engine/cuda/emulated_reduction.h"

namespace clearance::test {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// Cases of two meshes among the oracle's classes, with their exact results.
struct CheckedCases {
  struct CheckedMesh {
    double below, above;  // the doubles next to the exact distance; 0 if they overlap
    bool is_held;         // they overlap, but no triangles do
  };
  std::vector<exact::Case> cases;
  std::vector<CheckedMesh> checked;

  CheckedCases() {
    for (const exact::CaseClass& of : exact::mesh_classes()) {
      std::size_t wanted = of.name == "mesh_held" ? 8 : 2;
      for (std::uint64_t i = 0; i < 40 && wanted > 0; ++i) {
        exact::Case one = exact::make_case(of, 31, i);
        const auto is_mesh = [](const exact::Solid& s) { return s.cloud.empty() && !s.triangles.empty(); };
        if (!is_mesh(*one.a) || !is_mesh(*one.b) || one.a->triangles.size() * one.b->triangles.size() > 60000) continue;
        add(std::move(one));
        --wanted;
      }
    }
    add_parts_held();
    add_rounded();
  }

 private:
  void add(exact::Case one) {
    const exact::Value d = exact::exact_answer(one).distance;
    const bool overlap = !(d.compare(0) > 0);
    checked.push_back({overlap ? 0 : d.lower(), overlap ? 0 : d.upper(), overlap && are_triangles_apart(one)});
    cases.push_back(std::move(one));
  }
  // A mesh of three parts, each of which in turn lies inside the other mesh.
  void add_parts_held() {
    exact::Random random(5);
    const exact::SolidPtr block = exact::solid(exact::box_mesh({1, 1, 1}), true);
    for (int held = 0; held < 3; ++held) {
      exact::Mesh mesh;
      for (int i = 0; i < 3; ++i)
        exact::append(mesh, exact::moved(exact::box_mesh({0.2, 0.3, 0.1}), {3.0 * (i - held), 0, 0}));
      const exact::SolidPtr parts = exact::solid(std::move(mesh), false);
      add({block, parts, random.rotation(), random.rotation()});
      add({parts, block, random.rotation(), random.rotation()});
    }
  }
  // Faces opposite each other, 5 mm apart after both radii.
  void add_rounded() {
    exact::Random random(6);
    const Pose turn = random.rotation();
    const exact::SolidPtr a = exact::solid(exact::box_mesh({1, 1, 1}), true, 0.1),
                          b = exact::solid(exact::box_mesh({0.5, 0.5, 1}), false, 0.2);
    add({a, b, turn, compose(turn, Pose{{0, 0, 2.305}})});
    add({b, a, turn, compose(turn, Pose{{0, 0, 2.305}})});
  }
  static bool are_triangles_apart(const exact::Case& one) {
    exact::BodyView a = exact::body_view(*one.a), b = exact::body_view(*one.b);
    a.is_solid = b.is_solid = false;
    return exact::exact_distance(a, one.X_wa, b, one.X_wb).distance.compare(0) > 0;
  }
};

TEST(MeshKernels, HoldTheExactDistance) {
  const CheckedCases of;
  engine::Scene scene;
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 0; i < of.cases.size(); ++i) {
    const exact::Case& one = of.cases[i];
    for (const bool is_b : {false, true}) {
      Body body;
      body.name = (is_b ? "b" : "a") + std::to_string(i);
      body.parts = {exact::part_of(is_b ? *one.b : *one.a)};
      body.pose = is_b ? one.X_wb : one.X_wa;
      scene.add_body(std::move(body));
    }
    pairs.push_back({2 * i, 2 * i + 1});
  }
  const engine::Engine cpu(std::move(scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.fields = kAllFields;
  std::uint64_t wrong = 0, apart = 0, overlap = 0, held = 0, rows = 0, left = 0;
  for (const Reduce reduce : {Reduce::kWithin, Reduce::kNearest}) {
    q.reduce = reduce;
    HostReduction reduction(cpu, q);
    reduction.answer();
    std::vector<std::uint8_t> is_left(pairs.size(), 0);
    for (const std::uint32_t row : reduction.left_rows()) is_left[row] = 1;
    const ReplyView& reply = reduction.rows();
    EXPECT_EQ(reduction.row_count(), reduce == Reduce::kWithin ? pairs.size() : 2 * pairs.size());
    for (std::uint64_t i = 0; i < reduction.row_count(); ++i) {
      const std::uint32_t number = reply.pair[i].a / 2;
      const CheckedCases::CheckedMesh& d = of.checked[number];
      wrong += !(reply.lower[i] <= d.below && reply.upper[i] >= d.above);
      const auto status = static_cast<Status>(reply.status[i]);
      wrong += (status == Status::kOverlap && d.above > 0) || (status == Status::kOk && d.above <= 0);
      left += is_left[number];
      ++rows;
      ASSERT_EQ(wrong, 0u) << "row " << i;
      if (is_left[number]) continue;
      apart += status == Status::kOk;
      overlap += status == Status::kOverlap;
      held += status == Status::kOverlap && d.is_held;
    }
  }
  // Each within its margin or beyond it.
  q.reduce = Reduce::kWithin;
  for (const double distance : {0.01, 0.3}) {
    q.max_distance = distance;
    HostReduction reduction(cpu, q);
    reduction.answer();
    std::vector<std::uint8_t> is_hit(of.cases.size(), 0);
    for (std::uint64_t i = 0; i < reduction.row_count(); ++i) is_hit[reduction.rows().pair[i].a / 2] = 1;
    for (std::size_t i = 0; i < of.cases.size(); ++i) {
      wrong += is_hit[i] && of.checked[i].below > distance * (1 + 1e-9);
      wrong += !is_hit[i] && of.checked[i].above < distance;
    }
  }
  EXPECT_EQ(wrong, 0u);
  EXPECT_GT(apart, 30u);
  EXPECT_GT(overlap, 20u);
  EXPECT_GT(held, 8u);
  EXPECT_LT(left, rows / 3) << "the others are the kernel's";
}

// Runs every reduction.
// \returns number of pairs left to the CPU
std::uint64_t compare_all(const engine::Engine& cpu, QueryView q, const std::string& what) {
  std::uint64_t left = 0;
  for (const double distance : {kNoLimit, 0.1})
    for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest, Reduce::kWithin}) {
      q.max_distance = distance;
      q.reduce = reduce;
      left += HostReduction(cpu, q).compare_bounds(what + ", reduce " + std::to_string(static_cast<int>(reduce)));
    }
  q.max_distance = kNoLimit;
  q.reduce = Reduce::kAny;
  for (const double margin : {0.0, 0.02, 0.3}) {
    q.margin = margin;
    left += HostReduction(cpu, q).compare_bounds(what + ", margin " + std::to_string(margin));
  }
  return left;
}

TEST(MeshKernels, HoldWhatTheCpuHolds) {
  for (const double room : {0.6, 1.5}) {
    MeshCase c(6, room, 5);
    c.request_about(c.pairs_of_meshes());
    c.poses[5].translation.x = std::numeric_limits<double>::quiet_NaN();
    const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    EXPECT_LT(compare_all(cpu, c.q, "room " + std::to_string(room)), 4u);
  }
}

// These pairs alone, and among others that the device answers.
TEST(MeshKernels, LeaveSinglePairsToTheCpu) {
  MeshCase c(4, 0.8, 7);
  c.request_about(c.pairs_of_all());
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  EXPECT_GT(compare_all(cpu, c.q, "left"), 60u);
}

// Without a cutoff no bound excludes any of two large meshes at first; the stack must still suffice.
TEST(MeshKernels, HoldEnoughForLargeTrees) {
  engine::Scene scene;
  const MeshOfCase mesh(24);
  Random random(3);
  for (const char* name : {"a", "b"})
    scene.add_mesh(name, mesh.vertices, mesh.triangles, MeshAs::kSurface, {.pose = random.pose(0)});
  const engine::Engine cpu(std::move(scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  const std::vector<std::uint32_t> moved{1};
  const std::vector<Pose> poses{random.pose(6)};
  const std::vector<BodyPair> pairs{{0, 1}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.bodies = moved;
  q.configurations = poses;
  q.configuration_count = 1;
  q.fields = kAllFields;
  q.reduce = Reduce::kWithin;
  EXPECT_EQ(HostReduction(cpu, q).compare_bounds("62,208 triangles"), 0u);
}

}  // namespace
}  // namespace clearance::test
