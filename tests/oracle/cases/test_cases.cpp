// The case classes: each has its property, and is the same again for the same seed.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>
#include <set>

#include "tests/oracle/cases/cases.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 3;

bool same(const Case& a, const Case& b) {
  const auto same_solid = [](const Solid& s, const Solid& t) {
    return s.radius == t.radius && s.vertices.size() == t.vertices.size() &&
           std::memcmp(s.vertices.data(), t.vertices.data(), s.vertices.size() * sizeof(Vec3d)) == 0 &&
           s.triangles == t.triangles && s.is_solid == t.is_solid;
  };
  return same_solid(*a.a, *b.a) && same_solid(*a.b, *b.b) && std::memcmp(&a.X_wa, &b.X_wa, sizeof(Pose)) == 0 &&
         std::memcmp(&a.X_wb, &b.X_wb, sizeof(Pose)) == 0;
}

std::vector<CaseClass> all_classes() {
  std::vector<CaseClass> all = case_classes();
  all.insert(all.end(), mesh_classes().begin(), mesh_classes().end());
  return all;
}

TEST(Cases, RepeatForTheSameSeedAndDifferForAnother) {
  for (const CaseClass& c : all_classes()) {
    const Case third = make_case(c, kSeed, 3);
    make_case(c, kSeed, 1);
    EXPECT_TRUE(same(third, make_case(c, kSeed, 3))) << c.name;
    EXPECT_FALSE(same(third, make_case(c, kSeed + 1, 3))) << c.name;
    EXPECT_FALSE(same(third, make_case(c, kSeed, 4))) << c.name;
  }
}

TEST(Cases, NamesAreUnique) {
  std::set<std::string> names;
  for (const CaseClass& c : all_classes()) EXPECT_TRUE(names.insert(c.name).second) << c.name;
}

TEST(Cases, HitWhatTheyAreForAndAreLegal) {
  for (const CaseClass& c : case_classes()) {
    constexpr int kCount = 200;
    int hits = 0, apart = 0, touching = 0, deep = 0;
    for (int i = 0; i < kCount; ++i) {
      const Case k = make_case(c, kSeed, static_cast<std::uint64_t>(i));
      ASSERT_NE(check(k.X_wa), PoseQuality::kBad) << c.name;
      ASSERT_NE(check(k.X_wb), PoseQuality::kBad) << c.name;
      const Result r = exact_answer(k);
      const int side = r.distance.compare(0);
      (side > 0 ? apart : side == 0 ? touching : deep)++;
      hits += !c.hits || c.hits(k, r);
    }
    EXPECT_GE(hits, c.least_share * kCount) << c.name;
    if (c.name == "gap_exact_contact") {
      EXPECT_EQ(touching, kCount);
    }
    // Unless a class is for one side of contact, it must have both.
    const std::set<std::string> one_sided = {"gap_exact_contact", "gap_far", "relation_coincident",
                                             "relation_concentric", "relation_deep"};
    if (!one_sided.contains(c.name)) {
      EXPECT_GE(apart, kCount / 10) << c.name;
      EXPECT_GE(deep, kCount / 20) << c.name;
    }
  }
}

TEST(Cases, OfMeshesHitWhatTheyAreForAndAreLegal) {
  for (const CaseClass& c : mesh_classes()) {
    constexpr int kCount = 40;
    int hits = 0, apart = 0, overlapping = 0, near = 0;
    for (int i = 0; i < kCount; ++i) {
      const Case k = make_case(c, kSeed, static_cast<std::uint64_t>(i));
      ASSERT_NE(check(k.X_wa), PoseQuality::kBad) << c.name;
      ASSERT_NE(check(k.X_wb), PoseQuality::kBad) << c.name;
      const Result r = exact_answer(k);
      const bool is_apart = r.distance.compare(0) > 0;
      (is_apart ? apart : overlapping)++;
      near += is_apart && r.distance.compare(1e-3 * scale_of(k)) < 0;
      hits += c.hits(k, r);
    }
    std::printf("%-20s %3d hit, %3d apart (%d nearly touch), %3d overlap\n", c.name.c_str(), hits, apart, near,
                overlapping);
    EXPECT_GE(hits, c.least_share * kCount) << c.name;
    EXPECT_GE(apart, kCount / 8) << c.name;
    EXPECT_GE(overlapping, 1) << c.name;
    const bool is_elsewhere = c.name == "mesh_lattice" || c.name == "cloud_in_solid";  // in contact; within
    EXPECT_GE(near, is_elsewhere ? 0 : kCount / 20) << c.name;
  }
}

TEST(Cases, SetGapSetsTheGap) {
  Random random(5);
  for (int i = 0; i < 100; ++i) {
    Case c = make_case(case_classes()[0], kSeed, static_cast<std::uint64_t>(i));
    const double gap = random.log_uniform(1e-3, 10);
    set_gap(c, gap);
    EXPECT_NEAR(exact_answer(c).distance.lower(), gap, 1e-12);
  }
}

}  // namespace
}  // namespace clearance::exact
