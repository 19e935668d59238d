// The contenders' problems: files preserve them, and their exact distances are correct.
#include <gtest/gtest.h>

#include <cmath>

#include "bench/peers/contender.h"
#include "bench/peers/driver.h"
#include "bench/peers/workloads.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

peers::Problem through_a_file(const peers::Problem& p) {
  const TemporaryFolder folder;
  const std::string path = folder / "problem.bin";
  peers::write_problem(p, path);
  return peers::read_problem(path);
}

std::vector<double> distances(const peers::Problem& p) {
  const engine::Engine engine(scene_of(p, 0));
  const std::vector<BodyPair> pairs = pairs_of(p);
  std::vector<double> distance(pairs.size());
  QueryView query;
  query.all_pairs = false;
  query.pairs = pairs;
  query.signed_distance = p.kind == peers::Kind::kDepth;
  query.fields = kFieldDistance;
  ReplyView reply;
  reply.distance = distance.data();
  Job job = engine.start(query, reply);
  while (!job.advance()) {
  }
  return distance;
}

TEST(Problem, SurvivesItsFile) {
  const exact::CaseClass& ordinary = exact::case_classes()[0];
  const peers::Problem p = make_class_problem(ordinary, 3, 20), q = through_a_file(p);
  EXPECT_EQ(q.kind, peers::Kind::kDepth);
  EXPECT_EQ(q.bodies, p.bodies);
  EXPECT_EQ(q.poses, p.poses);
  EXPECT_EQ(q.pairs, p.pairs);
  EXPECT_EQ(q.exact_value, p.exact_value);
  EXPECT_EQ(q.scale, p.scale);
  ASSERT_EQ(q.shapes.size(), p.shapes.size());
  for (std::size_t s = 0; s < q.shapes.size(); ++s) {
    EXPECT_EQ(q.shapes[s].vertices, p.shapes[s].vertices);
    EXPECT_EQ(q.shapes[s].triangles, p.shapes[s].triangles);
    EXPECT_EQ(q.shapes[s].radius, p.shapes[s].radius);
  }
  EXPECT_THROW(peers::read_problem("/dev/null"), std::runtime_error);
}

TEST(Problem, HasTheExactAnswerOfEveryClass) {
  for (const exact::CaseClass& c : exact::case_classes()) {
    const peers::Problem p = make_class_problem(c, 3, 10);
    const std::vector<double> d = distances(p);
    for (std::size_t i = 0; i < d.size(); ++i)
      EXPECT_NEAR(d[i], p.exact_value[i], 1e-6 * std::abs(p.exact_value[i]) + 16 * 0x1p-52 * p.scale[i])
          << c.name << ' ' << i;
  }
}

// Faces are given to libraries that rely on them: outward, and no vertex beyond any by more than rounding.
TEST(Problem, HasFacesOfTheHull) {
  int faces = 0;
  for (const char* name : {"ordinary", "size_nano", "shape_many_coplanar", "shape_duplicated"}) {
    const auto& all = exact::case_classes();
    const auto c = std::find_if(all.begin(), all.end(), [&](const exact::CaseClass& k) { return k.name == name; });
    const peers::Problem p = make_class_problem(*c, 3, 20);
    for (const peers::Shape& s : p.shapes) {
      double size = 0;
      for (const peers::Point& v : s.vertices) size = std::max(size, std::hypot(v[0], v[1], v[2]));
      for (const auto& t : s.triangles) {
        const auto at = [&](std::uint32_t i) { return Vec3d{s.vertices[i][0], s.vertices[i][1], s.vertices[i][2]}; };
        const Vec3d n = cross(at(t[1]) - at(t[0]), at(t[2]) - at(t[0]));
        if (norm(n) < 1e-6 * size * size) continue;
        ++faces;
        for (std::uint32_t i = 0; i < s.vertices.size(); ++i)
          ASSERT_LT(dot(n, at(i) - at(t[0])) / norm(n), 1e-9 * size) << name;
      }
    }
  }
  EXPECT_GT(faces, 1000);
}

TEST(Workload, OfOneMillimetreIsThat) {
  const peers::Problem p = make_workload("gap_1mm_1202", "", {});
  ASSERT_EQ(p.exact_value.size(), 2000u);
  for (const double t : p.exact_value) ASSERT_NEAR(t, 1e-3, 1e-9);
}

// The check of a list of near pairs is by membership: no checked pair may be at the limit.
TEST(Workload, WithinHasNoPairOnItsEdge) {
  const peers::Problem p = through_a_file(make_workload("within", "", {}));
  ASSERT_EQ(p.kind, peers::Kind::kWithin);
  ASSERT_EQ(p.exact_value.size(), p.answers());
  std::size_t known = 0, near = 0;
  for (const double t : p.exact_value) {
    if (std::isnan(t)) continue;
    ++known, near += t < p.max_distance;
    ASSERT_GT(std::abs(t - p.max_distance), 1e-9);
  }
  EXPECT_GT(known, 10'000u);
  EXPECT_NEAR(static_cast<double>(near) / static_cast<double>(known), 0.05, 1e-3);
}

TEST(Workload, AListIsSpreadInTheOrderOfThePairs) {
  peers::Problem p;
  p.pairs = {{0, 1}, {0, 2}, {1, 2}};
  double answers[3];
  peers::spread(p, {{2, 1, 0.5}, {0, 1, 2}}, answers);  // a tree may swap the bodies of a pair
  EXPECT_EQ(answers[0], 2);
  EXPECT_EQ(answers[1], peers::kBeyond);
  EXPECT_EQ(answers[2], 0.5);
}

}  // namespace
}  // namespace clearance
