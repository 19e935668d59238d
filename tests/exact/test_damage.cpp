// That the judge bites on wrong geometry: a vertex or a bounding-tree entry taken out of a piece behind the engine's
// back is found. And that edges may be missing: climbing only proposes.
#include <gtest/gtest.h>

#include "damage.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 12;

/// Whether two exact answers differ by more than an interval may be wide.
bool differs(const Case& c, const Result& x, const Result& y) {
  const double dx = x.distance.lower(), dy = y.distance.lower();
  return std::abs(dx - dy) > 4e-6 * std::max(std::abs(dx), std::abs(dy)) + 128 * 0x1p-52 * scale_of(c);
}

Setting with_depth(const char* backend) {
  Setting s;
  s.backend = backend;
  s.signed_distance = true;
  return s;
}

// Every way to lose one vertex that decides an answer.
TEST(Damage, ARemovedVertexIsFound) {
  int found = 0;
  for (const CaseClass& cls : case_classes()) {
    std::vector<Case> whole, cut;
    std::vector<Result> truth;
    for (int i = 0; i < (cls.cost > 3 ? 5 : 40); ++i) {
      const Case c = make_case(cls, kSeed, static_cast<std::uint64_t>(i));
      const Result exact = judge(c);
      for (const bool of_b : {false, true}) {
        const SolidPtr& from = of_b ? c.b : c.a;
        const std::vector<Vec3d> candidates = decisive(c, exact, of_b);
        if (candidates.empty() || from->vertices.size() < 2) continue;
        Solid less = *from;
        std::erase_if(less.vertices, [&](const Vec3d& v) { return holds({candidates[0]}, v); });
        if (less.vertices.empty()) continue;
        Case damaged = c;
        (of_b ? damaged.b : damaged.a) = std::make_shared<const Solid>(less);
        if (!differs(c, exact, judge(damaged))) continue;
        whole.push_back(c), cut.push_back(damaged), truth.push_back(exact);
      }
    }
    if (cut.empty()) continue;
    for (const char* backend : {"cpu", "reference"}) {
      const std::vector<Answer> answers = Bench(cut, backend).ask(with_depth(backend));
      for (std::size_t i = 0; i < cut.size(); ++i) {
        ++found;
        EXPECT_FALSE(hold_against(whole[i], truth[i], with_depth(backend), answers[i], false).violation.empty())
            << cls.name << ", " << backend << ": " << in_words(answers[i]) << " exact " << truth[i].distance.lower();
      }
    }
  }
  EXPECT_GT(found, 1000);
}

/// Pairs of spheres large enough for a tree, apart, as `dense_spheres` makes them.
std::vector<Case> separated_spheres() {
  std::vector<Case> cases;
  Random random(kSeed);
  for (int i = 0; i < 20; ++i) {
    const auto& spheres = *std::find_if(case_classes().begin(), case_classes().end(),
                                        [](const CaseClass& c) { return c.name == "shape_dense_spheres"; });
    Case c = make_case(spheres, kSeed, static_cast<std::uint64_t>(i));
    set_gap(c, random.log_uniform(1e-3, 1) * scale_of(c));
    cases.push_back(c);
  }
  return cases;
}

TEST(Damage, AMissingTreeEntryIsFound) {
  const std::vector<Case> cases = separated_spheres();
  std::vector<Result> truth;
  for (const Case& c : cases) truth.push_back(judge(c));
  int found = 0;
  const Bench bench(cases, "cpu", 1, [&](const PiecePtr& piece, std::size_t i, bool is_b) {
    EXPECT_TRUE(piece->tree);
    return is_b ? piece : without_tree_entries_of(*piece, decisive(cases[i], truth[i], false));
  });
  const std::vector<Answer> answers = bench.ask(with_depth("cpu"));
  for (std::size_t i = 0; i < cases.size(); ++i)
    found += !hold_against(cases[i], truth[i], with_depth("cpu"), answers[i], false).violation.empty();
  EXPECT_GT(found, 10) << "of " << cases.size();
}

TEST(Damage, MissingEdgesFoolNobody) {
  std::vector<Case> cases = separated_spheres();
  std::vector<Result> truth;
  for (const Case& c : cases) truth.push_back(judge(c));
  int edges_cut = 0, stuck = 0;
  const Bench bench(cases, "cpu", 1, [&](const PiecePtr& piece, std::size_t i, bool is_b) {
    const std::vector<Vec3d> decides = decisive(cases[i], truth[i], is_b);
    const PiecePtr cut = without_edges_to(*piece, decides);
    edges_cut += static_cast<int>(piece->adjacency.size() - cut->adjacency.size());
    // Climbing alone is fooled: it does not reach a vertex that has no edges to it.
    const Vec3d n = decides[0] - piece->centre;
    const std::uint32_t far = support(*cut, -n).index;
    stuck += climb(*cut, n, far).value < support(*cut, n, far).value;
    return cut;
  });
  EXPECT_GT(edges_cut, 100);
  EXPECT_GT(stuck, 30) << "of " << 2 * cases.size();
  for (const double rel_tol : {1e-6, 0.0}) {
    Setting s = with_depth("cpu");
    s.rel_tol = rel_tol;
    const std::vector<Answer> answers = bench.ask(s);
    for (std::size_t i = 0; i < cases.size(); ++i) {
      const Verdict v = hold_against(cases[i], truth[i], s, answers[i]);
      EXPECT_TRUE(v.good()) << i << ": " << v.violation << v.inaccuracy;
    }
  }
}

}  // namespace
}  // namespace clearance::exact
