// Consistency of distances: along a translation the signed distance of two convex parts is convex and 1-Lipschitz, that
// of bodies of several parts 1-Lipschitz. Answers must agree with that to within their intervals, and contain the exact
// distance throughout.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/engine.h"
#include "engine/hull/hull.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr int kSteps = 41;

struct Sample {
  Vec3d t;  // of b
  double lower, upper;
  Status status;
};

Body body_of(const std::string& name, const std::vector<SolidPtr>& solids, const Pose& X) {
  Body body;
  body.name = name;
  for (const SolidPtr& s : solids) body.parts.push_back(make_hull_part(s->vertices, {}, s->radius));
  body.pose = X;
  return body;
}

/// Moves b through kSteps positions t + i * step as configurations of one query.
std::vector<Sample> sweep(const std::vector<SolidPtr>& a, const Pose& X_wa, const std::vector<SolidPtr>& b, Pose X_wb,
                          Vec3d step) {
  engine::Scene scene;
  scene.add_body(body_of("a", a, X_wa));
  scene.add_body(body_of("b", b, X_wb));
  engine::Engine::Options options;
  options.backend = "cpu";
  options.threads = 1;
  const engine::Engine engine(std::move(scene), options);
  const std::vector<std::uint32_t> moved = {1};
  std::vector<Pose> poses;
  std::vector<Sample> samples(kSteps);
  for (int i = 0; i < kSteps; ++i) {
    Pose X = X_wb;
    X.translation += step * (i - kSteps / 2);
    samples[static_cast<std::size_t>(i)].t = X.translation;
    poses.push_back(X);
  }
  std::vector<double> lower(kSteps), upper(kSteps);
  std::vector<std::uint8_t> status(kSteps);
  QueryView query;
  query.configuration_count = kSteps;
  query.bodies = moved;
  query.configurations = poses;
  query.signed_distance = true;
  query.fields = kFieldLower | kFieldUpper | kFieldStatus;
  ReplyView reply;
  reply.lower = lower.data(), reply.upper = upper.data(), reply.status = status.data();
  Job job = engine.start(query, reply);
  while (!job.advance()) {
  }
  for (std::size_t i = 0; i < kSteps; ++i)
    samples[i].lower = lower[i], samples[i].upper = upper[i], samples[i].status = static_cast<Status>(status[i]);
  return samples;
}

void expect_lipschitz(const std::vector<Sample>& s, double rounding, const std::string& what) {
  for (std::size_t i = 0; i < s.size(); ++i)
    for (std::size_t j = i + 1; j < s.size(); ++j) {
      const double moved = norm(s[j].t - s[i].t) + rounding;
      ASSERT_LE(s[i].lower - s[j].upper, moved) << what << " steps " << i << ' ' << j;
      ASSERT_LE(s[j].lower - s[i].upper, moved) << what << " steps " << i << ' ' << j;
    }
}

void expect_convex(const std::vector<Sample>& s, double rounding, const std::string& what) {
  for (std::size_t i = 0; i < s.size(); ++i)
    for (std::size_t half = 1; i + 2 * half < s.size(); ++half)
      ASSERT_LE(s[i + half].lower, 0.5 * s[i].upper + 0.5 * s[i + 2 * half].upper + rounding)
          << what << " step " << i + half;
}

/// A sweep that runs through contact and beyond both ends of it.
Vec3d step_of(Random& random, const Case& c) {
  const double size = reach(*c.a) + reach(*c.b) + c.a->radius + c.b->radius;
  return random.direction() * (size * random.log_uniform(1e-6, 1.0) / kSteps);
}

TEST(Sweeps, OfPartsAreConvexAndLipschitzAndContainTheExactDistance) {
  constexpr std::uint64_t kSeed = 31;
  int through_contact = 0, sweeps = 0;
  for (const CaseClass& cls : case_classes()) {
    Random random(kSeed);
    for (std::uint64_t i = 0; i < 8; ++i) {
      Case c = make_case(cls, kSeed, i);
      if (c.a->vertices.size() > 2000 || c.b->vertices.size() > 2000) continue;
      const Vec3d step = step_of(random, c);
      // A translation is only as exact as its coordinates.
      const double rounding = 4 * kEps * (norm(c.X_wb.translation) + kSteps * norm(step)), start = c.X_wb.translation.x;
      const std::string what = cls.name + " " + std::to_string(i);
      const std::vector<Sample> s = sweep({c.a}, c.X_wa, {c.b}, c.X_wb, step);
      expect_lipschitz(s, rounding, what);
      expect_convex(s, rounding, what);
      int apart = 0, overlapping = 0;
      for (const Sample& x : s) {
        Case at = c;
        at.X_wb.translation = x.t;
        const Value exact = exact_answer(at).distance;
        ASSERT_GE(exact.compare(x.lower), 0) << what;
        ASSERT_LE(exact.compare(x.upper), 0) << what;
        apart += exact.compare(0) > 0;
        overlapping += exact.compare(0) < 0;
      }
      ++sweeps;
      through_contact += apart > 0 && overlapping > 0;
      ASSERT_EQ(c.X_wb.translation.x, start);
    }
  }
  EXPECT_GT(sweeps, 200);
  EXPECT_GT(through_contact, 50);
}

/// Several convex parts of the classes' shapes, in one body.
std::vector<SolidPtr> several(Random& random, std::uint64_t seed) {
  std::vector<SolidPtr> solids;
  for (int n = random.integer(1, 4); n > 0; --n) {
    const CaseClass& cls =
        case_classes()[static_cast<std::size_t>(random.integer(0, static_cast<int>(case_classes().size()) - 1))];
    Case c = make_case(cls, seed, static_cast<std::uint64_t>(random.integer(0, 1000)));
    const double size = reach(*c.a) + c.a->radius;
    if (c.a->vertices.size() > 500 || !(size > 1e-3 && size < 1e3)) {
      ++n;
      continue;
    }
    Solid s = *c.a;
    const Vec3d offset = random.direction() * random.uniform(0, 2);
    for (Vec3d& v : s.vertices) v = v * (1 / size) + offset;
    s.radius /= size;
    solids.push_back(std::make_shared<const Solid>(std::move(s)));
  }
  return solids;
}

TEST(Sweeps, OfBodiesOfSeveralPartsAreLipschitzAndContainTheLeastOfTheirPairs) {
  constexpr std::uint64_t kSeed = 32;
  Random random(kSeed);
  int through_contact = 0;
  for (int i = 0; i < 40; ++i) {
    const std::vector<SolidPtr> a = several(random, kSeed), b = several(random, kSeed + 1);
    const Pose X_wa = random.rotation({random.uniform(-1, 1), 0, 0}),
               X_wb = random.rotation({random.uniform(-4, 4), random.uniform(-4, 4), 0});
    const Vec3d step = random.direction() * (random.uniform(1, 6) / kSteps);
    const std::string what = "body " + std::to_string(i);
    const std::vector<Sample> s = sweep(a, X_wa, b, X_wb, step);
    expect_lipschitz(s, 4 * kEps * 10, what);
    int apart = 0, overlapping = 0;
    for (const Sample& x : s) {
      bool all_above = true, one_below = false;  // the least of the pairs is in [lower, upper]
      for (const SolidPtr& p : a)
        for (const SolidPtr& q : b) {
          const Value exact = exact_answer({p, q, X_wa, {x.t, X_wb.qw, X_wb.qx, X_wb.qy, X_wb.qz}}).distance;
          all_above &= exact.compare(x.lower) >= 0;
          one_below |= exact.compare(x.upper) <= 0;
        }
      ASSERT_TRUE(all_above) << what << ": lower " << x.lower;
      ASSERT_TRUE(one_below) << what << ": upper " << x.upper;
      apart += x.status == Status::kOk;
      overlapping += x.status == Status::kOverlap;
    }
    through_contact += apart > 0 && overlapping > 0;
  }
  EXPECT_GT(through_contact, 10);
}

}  // namespace
}  // namespace clearance::exact
