// Tests that the oracle detects wrong geometry: a vertex or an entry of the direction table removed from a convex part
// after loading.
#include <gtest/gtest.h>

#include "tests/oracle/damage.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 12;

/// Whether two exact answers differ by more than an interval's allowed width.
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
    std::vector<Result> exact_value;
    for (int i = 0; i < (cls.cost > 3 ? 5 : 40); ++i) {
      const Case c = make_case(cls, kSeed, static_cast<std::uint64_t>(i));
      const Result exact = exact_answer(c);
      for (const bool of_b : {false, true}) {
        const SolidPtr& from = of_b ? c.b : c.a;
        const std::vector<Vec3d> candidates = decisive(c, exact, of_b);
        if (candidates.empty() || from->vertices.size() < 2) continue;
        Solid less = *from;
        std::erase_if(less.vertices, [&](const Vec3d& v) { return holds({candidates[0]}, v); });
        if (less.vertices.empty()) continue;
        Case damaged = c;
        (of_b ? damaged.b : damaged.a) = std::make_shared<const Solid>(less);
        if (!differs(c, exact, exact_answer(damaged))) continue;
        whole.push_back(c), cut.push_back(damaged), exact_value.push_back(exact);
      }
    }
    if (cut.empty()) continue;
    for (const char* backend : {"cpu", "reference"}) {
      const std::vector<Answer> answers = Bench(cut, backend).evaluate(with_depth(backend));
      for (std::size_t i = 0; i < cut.size(); ++i) {
        ++found;
        EXPECT_FALSE(hold_against(whole[i], exact_value[i], with_depth(backend), answers[i], false).violation.empty())
            << cls.name << ", " << backend << ": " << in_words(answers[i]) << " exact "
            << exact_value[i].distance.lower();
      }
    }
  }
  EXPECT_GT(found, 1000);
}

/// Pairs of spheres large enough for a table, apart, as `dense_spheres` makes them.
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

TEST(Damage, AMissingTableEntryIsFound) {
  const std::vector<Case> cases = separated_spheres();
  std::vector<Result> exact_value;
  for (const Case& c : cases) exact_value.push_back(exact_answer(c));
  int found = 0;
  const Bench bench(cases, "cpu", 1, [&](const ConvexPartPtr& part, std::size_t i, bool is_b) {
    EXPECT_TRUE(part->table);
    return is_b ? part : without_table_entries_of(*part, decisive(cases[i], exact_value[i], false));
  });
  const std::vector<Answer> answers = bench.evaluate(with_depth("cpu"));
  for (std::size_t i = 0; i < cases.size(); ++i)
    found += !hold_against(cases[i], exact_value[i], with_depth("cpu"), answers[i], false).violation.empty();
  EXPECT_GT(found, 10) << "of " << cases.size();
}

}  // namespace
}  // namespace clearance::exact
