// The kernel that looks at two meshes (engine/cuda/mesh_search.cuh), without a GPU: its code compiled for the host, its
// intervals held before the exact judge and against the CPU's, and what is left to the CPU beside it. With
// CLEARANCE_MUTANT its code is another, which the judge has to find.
#include "element_case.h"
#include "tests/exact/campaign.h"
#include "tests/exact/mesh_shapes.h"
// Behind all that is included elsewhere.
#include "emulated_reduction.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Cases of two meshes among those of the classes, with what is exact of them.
struct JudgedCases {
  struct Judged {
    double below, above;  // neighbours of the exact distance among the doubles; 0: they overlap
    bool is_held;         // they overlap, but no triangles do
  };
  std::vector<exact::Case> cases;
  std::vector<Judged> judged;
  std::vector<std::string> names;

  JudgedCases() {
    for (const exact::CaseClass& of : exact::mesh_classes()) {
      const bool holds = of.name == "mesh_held" || of.name == "mesh_shells" || of.name == "mesh_nested";
      std::size_t wanted = holds ? 8 : 2;
      for (std::uint64_t i = 0; i < 40 && wanted > 0; ++i) {
        exact::Case one = exact::make_case(of, 31, i);
        const auto is_mesh = [](const exact::Solid& s) { return s.cloud.empty() && !s.triangles.empty(); };
        if (!is_mesh(*one.a) || !is_mesh(*one.b) || one.a->triangles.size() * one.b->triangles.size() > 60000) continue;
        const exact::Value d = exact::judge(one).distance;
        const bool overlap = !(d.compare(0) > 0);
        judged.push_back({overlap ? 0 : d.lower(), overlap ? 0 : d.upper(), overlap && are_triangles_apart(one)});
        names.push_back(of.name);
        cases.push_back(std::move(one));
        --wanted;
      }
    }
  }

 private:
  static bool are_triangles_apart(const exact::Case& one) {
    exact::BodyView a = exact::body_view(*one.a), b = exact::body_view(*one.b);
    a.is_solid = b.is_solid = false;
    return exact::exact_distance(a, one.X_wa, b, one.X_wb).distance.compare(0) > 0;
  }
};

TEST(MeshKernels, HoldTheExactDistance) {
  const JudgedCases of;
  Scene scene;
  std::vector<BodyPair> pairs;
  for (std::uint32_t i = 0; i < of.cases.size(); ++i) {
    const exact::Case& one = of.cases[i];
    for (const bool is_b : {false, true}) {
      Body body;
      body.name = (is_b ? "b" : "a") + std::to_string(i);
      body.pieces = {exact::piece_of(is_b ? *one.b : *one.a)};
      body.pose = is_b ? one.X_wb : one.X_wa;
      scene.add_body(std::move(body));
    }
    pairs.push_back({2 * i, 2 * i + 1});
  }
  const Engine cpu(std::move(scene), {"cpu"});
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
      const JudgedCases::Judged& d = of.judged[number];
      wrong += !(reply.lower[i] <= d.below && reply.upper[i] >= d.above);
      const auto status = static_cast<Status>(reply.status[i]);
      wrong += (status == Status::kOverlap && d.above > 0) || (status == Status::kOk && d.above <= 0);
      left += is_left[number];
      ++rows;
      if (is_left[number]) {
        std::printf("left %s [%g %g] held %d\n", of.names[number].c_str(), d.below, d.above, d.is_held);
        continue;
      }
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
      wrong += is_hit[i] && of.judged[i].below > distance * (1 + 1e-9);
      wrong += !is_hit[i] && of.judged[i].above < distance;
    }
  }
#ifdef CLEARANCE_MUTANT
  EXPECT_GT(wrong, 0u) << "nobody would find this";
#else
  EXPECT_EQ(wrong, 0u);
  EXPECT_GT(apart, 30u);
  EXPECT_GT(overlap, 20u);
  EXPECT_GT(held, 8u);
  EXPECT_LT(left, rows / 2) << "the others are the kernel's";
  std::printf("%zu cases, apart %lu overlap %lu held %lu rows %lu left %lu\n", of.cases.size(), apart, overlap, held, rows, left);
#endif
}

#ifndef CLEARANCE_MUTANT
// Links that are meshes before a shelf that is one, a hull, a cloud, and bodies that the device cannot look at.
struct MeshCase {
  std::uint32_t shelf, hull, cloud, nothing, several;
  std::vector<std::uint32_t> links;

  explicit MeshCase(std::uint32_t configurations, double room, std::uint64_t seed) {
    Random random(seed);
    exact::Random shapes(seed);
    const auto add = [&](const std::string& name, exact::Mesh mesh, double size, bool is_solid,
                         const Scene::BodyOptions& options) {
      mesh = exact::scaled(std::move(mesh), {size, size, size});
      scene.add_mesh(name, mesh.vertices, mesh.triangles, is_solid ? Convexify::kSolid : Convexify::kSurface, options);
      return static_cast<std::uint32_t>(scene.bodies().size() - 1);
    };
    links = {add("ring", exact::ring(shapes), 0.2, true, {}), add("bent", exact::bent(shapes), 0.2, true, {}),
             add("comb", exact::comb(shapes, 0.05), 0.2, false, {}),
             add("ball", exact::ball(shapes), 0.1, true, {.radius = 0.01})};
    const MeshOfCase mesh(2);
    scene.add_mesh("shelf", mesh.vertices, mesh.triangles, Convexify::kSolid,
                   {.is_static = true, .pose = random.pose(0.2)});
    shelf = static_cast<std::uint32_t>(scene.bodies().size() - 1);
    scene.add_hull("hull", cloud_on_sphere(60, 0.3, 4), {.is_static = true, .pose = random.pose(0.5)});
    hull = shelf + 1;
    scene.add_points("cloud", points_of_case(random, 60, 0), 0, {.is_static = true, .pose = random.pose(0.5)});
    cloud = hull + 1;
    scene.add_points("nothing", std::vector<CloudPoint>(), 0, {.is_static = true, .pose = random.pose(0.5)});
    nothing = cloud + 1;
    Body both;
    both.name = "several";
    both.pieces = {scene.bodies()[links[0]].pieces[0], make_piece({{0.3, 0, 0}, {0.5, 0, 0}, {0.4, 0.2, 0}, {0.4, 0, 0.3}})};
    both.is_static = true;
    both.pose = random.pose(0.5);
    scene.add_body(std::move(both));
    several = nothing + 1;
    for (std::size_t i = 0; i < configurations * links.size(); ++i) poses.push_back(random.pose(room));
    q.all_pairs = false;
    q.fields = kAllFields;
    q.configuration_count = configurations;
  }
  void ask_about(std::vector<BodyPair> of) {
    pairs = std::move(of);
    q.pairs = pairs;
    q.bodies = links;
    q.configurations = poses;
  }

  Scene scene;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;
};

// Every reduction. \returns how many pairs were left to the CPU
std::uint64_t compare_all(const Engine& cpu, QueryView q, const std::string& what) {
  std::uint64_t left = 0;
  for (const double distance : {kInf, 0.1})
    for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest, Reduce::kWithin}) {
      q.max_distance = distance;
      q.reduce = reduce;
      left += HostReduction(cpu, q).compare_bounds(what + ", reduce " + std::to_string(static_cast<int>(reduce)));
    }
  q.max_distance = kInf;
  q.reduce = Reduce::kAny;
  for (const double margin : {0.0, 0.02, 0.3}) {
    q.margin = margin;
    left += HostReduction(cpu, q).compare_bounds(what + ", margin " + std::to_string(margin));
  }
  return left;
}

TEST(MeshKernels, HoldWhatTheCpuHolds) {
  for (const double room : {0.6, 1.5}) {
    MeshCase c(8, room, 5);
    std::vector<BodyPair> pairs;
    for (const std::uint32_t link : c.links) pairs.push_back(link % 2 ? BodyPair{link, c.shelf} : BodyPair{c.shelf, link});
    for (std::size_t i = 1; i < c.links.size(); ++i) pairs.push_back({c.links[i - 1], c.links[i]});
    for (const std::uint32_t link : c.links) pairs.push_back({link, c.hull});
    c.ask_about(pairs);
    c.poses[5].translation.x = std::numeric_limits<double>::quiet_NaN();
    const Engine cpu(std::move(c.scene), {"cpu"});
    EXPECT_LT(compare_all(cpu, c.q, "room " + std::to_string(room)), 4u);
  }
}

// Those pairs alone, and among others that the device answers.
TEST(MeshKernels, LeaveSinglePairsToTheCpu) {
  MeshCase c(6, 0.8, 7);
  std::vector<BodyPair> pairs;
  for (const std::uint32_t link : c.links)
    for (const std::uint32_t other : {c.hull, c.cloud, c.nothing, c.several, c.shelf}) pairs.push_back({other, link});
  c.ask_about(pairs);
  const Engine cpu(std::move(c.scene), {"cpu"});
  EXPECT_GT(compare_all(cpu, c.q, "left"), 100u);
}

// Where nothing is cut off, no bound leaves out any of two large meshes at first: the stack has room all the same.
TEST(MeshKernels, HaveRoomForLargeTrees) {
  Scene scene;
  const MeshOfCase mesh(24);
  Random random(3);
  for (const char* name : {"a", "b"})
    scene.add_mesh(name, mesh.vertices, mesh.triangles, Convexify::kSurface, {.pose = random.pose(0)});
  const Engine cpu(std::move(scene), {"cpu"});
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
#endif

}  // namespace
}  // namespace clearance::test
