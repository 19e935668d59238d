// Compares slack with the oracle (slack_oracle.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "engine/uncertainty/pose_uncertainty.h"
#include "tests/oracle/slack_oracle.h"

namespace clearance::exact {
namespace {

Findings run(const std::function<void(Random&, Findings&)>& attempt, int times, std::uint64_t seed) {
  Findings findings;
  Random random(seed);
  for (int i = 0; i < times; ++i) attempt(random, findings);
  std::printf("%d answers: %d misses, %d untrue, %d wide, %d unsettled\n", findings.requested, findings.misses,
              findings.untrue, findings.wide, findings.unresolved);
  return findings;
}

TEST(Slack, HoldsAllThatIsAllowed) {
  const Findings found = run(try_uncertain, 100, 5);
  EXPECT_GT(found.requested, 4000);
  EXPECT_EQ(found.all(), 0);
}

TEST(Slack, HoldsShapesThatPartsMiss) {
  for (const bool depth : {false, true}) {
    const Findings found = run([depth](Random& random, Findings& f) { try_shapes(random, depth, f); }, 400, 6);
    EXPECT_EQ(found.requested, 800);
    EXPECT_EQ(found.all(), 0);
  }
}

TEST(Slack, HoldsTrueCylinders) {
  for (const CylinderAs as : {CylinderAs::kItself, CylinderAs::kPrism}) {
    int missed_by_prism = 0;
    const auto attempt = [&](Random& random, Findings& f) { missed_by_prism += try_cylinder(random, as, f); };
    EXPECT_EQ(run(attempt, 200, 8).all(), 0);
    if (as == CylinderAs::kPrism) {
      EXPECT_GT(missed_by_prism, 60);
    }
    std::printf("%d of 200 outside of the pieces' interval\n", missed_by_prism);
    const auto crossed = [&](Random& random, Findings& f) { try_crossed_cylinders(random, as, f); };
    EXPECT_EQ(run(crossed, 40, 9).all(), 0);
  }
}

TEST(Slack, HoldsForNow) {
  EXPECT_EQ(run(try_age, 5, 10).all(), 0);
}

// Along a chain of poses the composition in double-double stays within the documented error of the published pose.
TEST(Slack, HoldsTheRoundingOfChains) {
  using D = DoubleDouble;
  struct Frame {
    D q[4], t[3];
  };
  const auto rotated = [](const D(&q)[4], const D(&v)[3], D(&out)[3]) {
    const D n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    const D &w = q[0], &x = q[1], &y = q[2], &z = q[3], two(2.0);
    out[0] = ((w * w + x * x - y * y - z * z) * v[0] + two * (x * y - w * z) * v[1] + two * (x * z + w * y) * v[2]) / n;
    out[1] = (two * (x * y + w * z) * v[0] + (w * w - x * x + y * y - z * z) * v[1] + two * (y * z - w * x) * v[2]) / n;
    out[2] = (two * (x * z - w * y) * v[0] + two * (y * z + w * x) * v[1] + (w * w - x * x - y * y + z * z) * v[2]) / n;
  };
  Random random(12);
  double worst = 0;
  int links = 0;
  for (int chain = 0; chain < 200; ++chain) {
    engine::Scene scene;
    std::vector<Pose> local;
    for (int i = 0; i < 8; ++i) {
      engine::Scene::BodyOptions options;
      options.pose = random.rotation(random.direction() * random.log_uniform(1e-3, 1e3));
      const double length = random.log_uniform(1e-3, 1e3);  // of the quaternion: any
      for (double* q : {&options.pose->qw, &options.pose->qx, &options.pose->qy, &options.pose->qz}) *q *= length;
      if (i > 0) options.parent = std::to_string(i - 1);
      local.push_back(*options.pose);
      scene.add_box(std::to_string(i), {0.5, 0.25, 0.125}, options);
    }
    const PoseStore store(scene, std::chrono::seconds(1));
    const auto snapshot = store.snapshot();
    const std::vector<PoseUncertainty> uncertainties = uncertainties_of(scene, *snapshot, monotonic_ns());
    ASSERT_EQ(uncertainties.size(), 8u);
    EXPECT_EQ(uncertainties[0].slack.inner, 0);
    EXPECT_EQ(uncertainties[0].slack.outer, 0);
    Frame exact;
    for (std::size_t i = 0; i < 8; ++i) {
      const Pose& l = local[i];
      const D t[3] = {D(l.translation.x), D(l.translation.y), D(l.translation.z)}, q[4] = {l.qw, l.qx, l.qy, l.qz};
      if (i == 0) {
        std::copy(t, t + 3, exact.t);
        std::copy(q, q + 4, exact.q);
        continue;
      }
      D moved[3];
      rotated(exact.q, t, moved);
      for (int k = 0; k < 3; ++k) exact.t[k] = exact.t[k] + moved[k];
      const D &w = exact.q[0], &x = exact.q[1], &y = exact.q[2], &z = exact.q[3];
      const D product[4] = {w * q[0] - x * q[1] - y * q[2] - z * q[3], w * q[1] + x * q[0] + y * q[3] - z * q[2],
                            w * q[2] - x * q[3] + y * q[0] + z * q[1], w * q[3] + x * q[2] - y * q[1] + z * q[0]};
      std::copy(product, product + 4, exact.q);
      const Pose& X = snapshot->placed[i].pose.X_wb;
      const D q_published[4] = {X.qw, X.qx, X.qy, X.qz},
              t_published[3] = {X.translation.x, X.translation.y, X.translation.z};
      for (const Vec3d& v : scene.bodies()[i].parts[0]->vertices) {
        const D p[3] = {v.x, v.y, v.z};
        D there[3], here[3];
        rotated(exact.q, p, there);
        rotated(q_published, p, here);
        double off = 0;
        for (int k = 0; k < 3; ++k) {
          const D d = (there[k] + exact.t[k]) - (here[k] + t_published[k]);
          off = std::hypot(off, d.hi);
        }
        ++links;
        EXPECT_LE(off, uncertainties[i].slack.inner);
        EXPECT_LE(off, uncertainties[i].slack.outer);
        worst = std::max(worst, off / uncertainties[i].slack.inner);
      }
    }
  }
  std::printf("%d points: at most %.2f of what is claimed\n", links, worst);
  EXPECT_GT(worst, 0.05);
}

}  // namespace
}  // namespace clearance::exact
