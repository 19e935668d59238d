// Lanes against one pair alone: the same bits, on every instruction set that this machine has, for every class of cases.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <span>

#include "cases.h"
#include "engine/lanes.h"
#include "engine/narrow_phase.h"

namespace clearance::exact {
namespace {

constexpr int kCases = 12, kPairs = 21;  // not a multiple of any number of lanes: some end while others wait to be filled

bool same_bits(double p, double q) { return std::memcmp(&p, &q, sizeof p) == 0; }
bool same_bits(const Vec3d& p, const Vec3d& q) { return same_bits(p.x, q.x) && same_bits(p.y, q.y) && same_bits(p.z, q.z); }

struct Placed {
  PlacedPose a, b;
};

// A case as it is, then moved a little and a lot.
std::vector<Placed> placements(const Case& c, Random& random) {
  std::vector<Placed> placed;
  for (int i = 0; i < kPairs; ++i) {
    Pose X_wa = c.X_wa, X_wb = c.X_wb;
    if (i % 3 == 1) X_wb.translation += random.direction() * (random.uniform() * norm(X_wb.translation - X_wa.translation));
    if (i % 3 == 2) X_wa = random.rotation(X_wa.translation);
    placed.push_back({{rotation_of(X_wa), X_wa.translation, X_wa}, {rotation_of(X_wb), X_wb.translation, X_wb}});
  }
  return placed;
}

NarrowLimits limits_of_kind(int kind, double distance) {
  NarrowLimits limits;
  if (kind == 1) limits.rel_tol = 0;
  if (kind == 2) limits.abs_tol = 0.1 * distance;
  if (kind == 3) limits.max_distance = 0.5 * distance;
  return limits;
}

class Lanes : public testing::TestWithParam<std::string_view> {};

TEST_P(Lanes, GiveTheBitsOfOnePairAlone) {
  const LaneKernel& kernel = lane_kernel(GetParam());
  EXPECT_EQ(kernel.name, GetParam());
  EXPECT_GE(kernel.lanes, 1);
  int settled = 0, unsettled = 0, beyond = 0;
  for (const CaseClass& cls : case_classes())
    for (int i = 0; i < kCases; ++i) {
      const Case c = make_case(cls, 5, static_cast<std::uint64_t>(i));
      const PiecePtr a = make_piece(c.a->vertices, c.a->radius), b = make_piece(c.b->vertices, c.b->radius);
      Random random(static_cast<std::uint64_t>(i));
      const std::vector<Placed> placed = placements(c, random);
      const double distance = norm(c.X_wb.translation - c.X_wa.translation);
      const NarrowLimits limits = limits_of_kind(i % 4, distance);

      std::vector<LanePair> pairs;
      for (const Placed& p : placed) pairs.push_back({&p.a.R_wb, &p.b.R_wb, &p.a.t_w, &p.b.t_w});
      std::vector<LaneAnswer> answers(pairs.size());
      std::vector<LaneWitness> witnesses(pairs.size());
      std::vector<Gjk<double>> rest(pairs.size());
      kernel.run({LaneHull(*a), LaneHull(*b), pairs.data(), pairs.size(), limits.abs_tol, limits.rel_tol, limits.max_distance, limits.max_iterations,
                  answers.data(), witnesses.data(), rest.data()});

      for (std::size_t k = 0; k < pairs.size(); ++k) {
        const auto& [at_a, at_b] = placed[k];
        const NarrowAnswer alone = narrow_phase(*a, at_a, *b, at_b, limits);
        const auto where = [&] { return cls.name + " case " + std::to_string(i) + " pair " + std::to_string(k); };
        if (!answers[k].settled) {
          ++unsettled;
          const NarrowAnswer finished = narrow_phase(*a, at_a, *b, at_b, limits, nullptr, &rest[k]);
          EXPECT_TRUE(same_bits(finished.bounds.lower, alone.bounds.lower)) << where();
          EXPECT_TRUE(same_bits(finished.bounds.upper, alone.bounds.upper)) << where();
          EXPECT_TRUE(same_bits(finished.point_a, alone.point_a)) << where();
          continue;
        }
        ++settled;
        EXPECT_TRUE(alone.settled) << where();
        EXPECT_TRUE(same_bits(answers[k].lower, alone.bounds.lower)) << where() << ' ' << answers[k].lower << ' ' << alone.bounds.lower;
        EXPECT_TRUE(same_bits(answers[k].upper, alone.bounds.upper)) << where() << ' ' << answers[k].upper << ' ' << alone.bounds.upper;
        if (alone.beyond) {
          ++beyond;
          continue;
        }
        Vec3d point_a, point_b, normal;
        take_lane_witness(*a, at_a.R_wb, *b, at_b.R_wb, witnesses[k], point_a, point_b, normal);
        EXPECT_TRUE(same_bits(point_a, alone.point_a)) << where();
        EXPECT_TRUE(same_bits(point_b, alone.point_b)) << where();
        EXPECT_TRUE(same_bits(normal, alone.normal)) << where();
      }
      if (HasFailure()) return;
    }
  std::printf("%d settled in lanes (%d beyond), %d handed on\n", settled, beyond, unsettled);
  EXPECT_GT(settled, 1000);
  EXPECT_GT(unsettled, 1000);
  EXPECT_GT(beyond, 100);
}

// A warm start ends at once where nothing moved, proves as much as a cold one, and takes no index on trust.
TEST_P(Lanes, WarmStartsEndSoonerAndProveTheSame) {
  const LaneKernel& kernel = lane_kernel(GetParam());
  int cold_in_two_steps = 0, warm_in_two_steps = 0, settled = 0;
  for (const CaseClass& cls : case_classes())
    for (int i = 0; i < kCases; ++i) {
      const Case c = make_case(cls, 6, static_cast<std::uint64_t>(i));
      const PiecePtr a = make_piece(c.a->vertices, c.a->radius), b = make_piece(c.b->vertices, c.b->radius);
      Random random(static_cast<std::uint64_t>(i));
      const std::vector<Placed> placed = placements(c, random);
      std::vector<LanePair> pairs;
      std::vector<WarmSimplex> warm(placed.size());
      for (std::size_t k = 0; k < placed.size(); ++k) {
        pairs.push_back({&placed[k].a.R_wb, &placed[k].b.R_wb, &placed[k].a.t_w, &placed[k].b.t_w, &warm[k]});
        for (std::uint32_t& index : warm[k].a) index = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
        for (std::uint32_t& index : warm[k].b) index = static_cast<std::uint32_t>(random.integer(0, 1 << 30));
        warm[k].size = static_cast<std::uint8_t>(random.integer(0, 255));
      }
      const auto run = [&](std::span<const LanePair> which, int steps) {
        std::vector<LaneAnswer> answers(which.size());
        std::vector<Gjk<double>> rest(which.size());
        kernel.run({LaneHull(*a), LaneHull(*b), which.data(), which.size(), 0, 1e-6, std::numeric_limits<double>::infinity(), steps,
                    answers.data(), nullptr, rest.data()});
        return answers;
      };
      std::vector<LanePair> cold = pairs;
      for (LanePair& p : cold) p.warm = nullptr;
      const std::vector<LaneAnswer> first = run(cold, 256), from_rubbish = run(pairs, 256), again = run(pairs, 2), cold_again = run(cold, 2);
      for (std::size_t k = 0; k < placed.size(); ++k) {
        EXPECT_TRUE(from_rubbish[k].lower <= first[k].upper && first[k].lower <= from_rubbish[k].upper) << cls.name << ' ' << i;
        EXPECT_TRUE(again[k].lower <= first[k].upper && first[k].lower <= again[k].upper) << cls.name << ' ' << i;
        settled += from_rubbish[k].settled;
        warm_in_two_steps += again[k].settled;
        cold_in_two_steps += cold_again[k].settled;
      }
    }
  std::printf("of %d pairs, %d settled in two steps warm, %d cold\n", settled, warm_in_two_steps, cold_in_two_steps);
  EXPECT_GT(settled, 1000);
  EXPECT_GT(warm_in_two_steps, settled * 9 / 10);
  EXPECT_LT(cold_in_two_steps, settled * 8 / 10);
}

std::vector<std::string_view> kernel_names() {
  std::vector<std::string_view> names;
  for (const LaneKernel& k : lane_kernels()) names.push_back(k.name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(Sets, Lanes, testing::ValuesIn(kernel_names()),
                         [](const auto& set) { return std::string(set.param); });

TEST(LaneKernels, AreChosenByName) {
  EXPECT_EQ(lane_kernel("auto").name, lane_kernels()[0].name);
  EXPECT_EQ(lane_kernels().back().name, "baseline") << "what every machine has";
  try {
    lane_kernel("mmx");
    FAIL();
  } catch (const std::invalid_argument& e) {
    EXPECT_STREQ(e.what(), "instruction set: expected auto, avx512, avx2 or baseline, got 'mmx'");
  }
}

}  // namespace
}  // namespace clearance::exact
