// A cell of free bodies and obstacles, with states next to one another. Included by the tests of decisions.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/engine/same_rows.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

using engine::Scene;
using test::Answer;
using Options = Scene::BodyOptions;

inline constexpr std::uint32_t kRows = test::kAllFields & ~kFieldGradient;
// On the pallet: as far as given poses may be, and farther.
inline constexpr Vec3d kFar{-9, 9, 8.5}, kFarther{-8.8, 14, 16};

inline std::vector<Vec3d> cloud(Random& random, int count, double size) {
  std::vector<Vec3d> points;
  for (int i = 0; i < count; ++i) points.push_back(random.direction() * (size * random.uniform(0.5, 1)));
  return points;
}

/// Free bodies, one of them on a pallet of uncertain rotation and one with a tool, and one obstacle of each kind.
inline Scene made_cell() {
  Random random(1);
  Scene scene;
  const auto free = [](double x, double y) { return Options{.pose = Pose{{x, y, 0}}}; };
  scene.add_hull("rock", cloud(random, 20, 0.1), free(0, 0));
  scene.add_hull("bar", std::vector<Vec3d>{{-0.2, 0, 0}, {0.2, 0, 0}, {0, 0.01, 0}, {0, 0, 0.01}}, free(0, 1));
  Options padded = free(1, 0);
  padded.padding = 0.01;
  padded.uncertainty = {0.002, 0.01};
  scene.add_box("crate", {0.2, 0.1, 0.15}, padded);
  scene.add_capsule("rod", 0.03, 0.3, free(1, 1));
  scene.add_box("tool", {0.05, 0.05, 0.3}, {.parent = "rock", .pose = Pose{{0, 0.2, 0.1}, 0.5, 0.5, 0.5, 0.5}});
  scene.add_box("pallet", {0.1, 0.1, 0.1}, {.pose = Pose{{0, 0, 2}, 0.8, 0, 0.6, 0}, .uncertainty = {0, 0.002}});
  scene.add_hull("load", cloud(random, 12, 0.1), {.parent = "pallet", .pose = Pose{{0.5, 0, 0}}});
  const auto still = [&](double x, double y) { return Options{.is_static = true, .pose = random.rotation({x, y, 0})}; };
  scene.add_half_space("floor", {.is_static = true, .pose = Pose{{0, 0, -3}}});
  scene.add_box("box", {0.3, 0.2, 0.1}, still(2, 0));
  scene.add_cylinder("post", 0.08, 0.8, still(2, 1));
  scene.add_hull("stone", cloud(random, 40, 0.2), still(2, 2));
  scene.add_capsule("rail", 0.05, 0.6, still(0, 2));
  Options loose = still(1, 2);
  loose.is_static = false;
  scene.add_box("drone", {0.2, 0.2, 0.2}, loose);
  const BodyPlacement pallet = place(&*scene.bodies()[scene.find_body("pallet")].pose, nullptr);
  const auto on_pallet = [&](const Vec3d& at) {
    return Options{.is_static = true, .pose = random.rotation(pallet.pose.t_w + pallet.pose.R_wb * at)};
  };
  scene.add_box("far", {0.2, 0.2, 0.2}, on_pallet(kFar));
  scene.add_box("farther", {0.2, 0.2, 0.2}, on_pallet(kFarther));
  scene.ignore("rock", "tool");
  return scene;
}

/// States of the free bodies, in each of which one is moved next to another body.
class PoseStates {
 public:
  explicit PoseStates(const Scene& scene) : scene_(scene) {
    for (const char* name : {"rock", "bar", "crate", "rod", "load"}) bodies.push_back(scene.find_body(name));
  }

  /// Adds states in which a body is `margin` and a little more or less from another one, for convex bodies exactly.
  /// \param mover index in `bodies`; its follower may be named instead
  /// \param most greatest deviation from the margin, metres
  void add(const engine::Engine& exact, std::size_t mover, const char* near, const char* other, double margin,
           double most, int count, Random& random) {
    const std::size_t first = poses.size();
    const std::uint32_t parent = scene_.bodies()[bodies[mover]].parent;
    const std::uint32_t target = scene_.find_body(other);
    const BodyPlacement on = parent == kNone ? BodyPlacement{} : place(&*scene_.bodies()[parent].pose, nullptr);
    for (int k = 0; k < count; ++k)
      for (std::size_t m = 0; m < bodies.size(); ++m) {
        Pose X = random.rotation(scene_.bodies()[bodies[m]].pose->translation);
        if (m == mover) {
          const Vec3d at = scene_.bodies()[target].pose->translation + random.direction() * 0.9;
          X.translation = parent == kNone ? at : on.pose.R_wb.transpose_times(at - on.pose.t_w);
        }
        const double length = random.log_uniform(0.01, 100);
        for (double* q : {&X.qw, &X.qx, &X.qy, &X.qz}) *q *= length;
        poses.push_back(X);
      }
    const BodyPair pair{scene_.find_body(near), target};
    QueryView query = of(first);
    query.all_pairs = false;
    query.pairs = std::span(&pair, 1);
    query.reduce = Reduce::kNone;
    query.fields = kFieldPointA | kFieldPointB | kFieldUpper;
    const Answer answer = test::evaluate(exact, query);
    for (int k = 0; k < count; ++k) {
      const double *a = answer.view.point_a + 3 * k, *b = answer.view.point_b + 3 * k;
      const Vec3d way{b[0] - a[0], b[1] - a[1], b[2] - a[2]};
      const double d = norm(way), from = margin + random.sign() * random.log_uniform(1e-5, most);
      const Vec3d shift = way * (1 - from / d);
      Pose& X = poses[first + static_cast<std::size_t>(k) * bodies.size() + mover];
      X.translation += parent == kNone ? shift : on.pose.R_wb.transpose_times(shift);
    }
  }

  QueryView of(std::size_t first = 0) const {
    QueryView query;
    query.bodies = bodies;
    query.configurations = std::span(poses).subspan(first);
    query.configuration_count = static_cast<std::uint32_t>((poses.size() - first) / bodies.size());
    return query;
  }
  std::vector<std::uint32_t> bodies;
  std::vector<Pose> poses;

 private:
  const Scene& scene_;
};

struct Engines {
  explicit Engines(const Scene& scene)
      : with(Scene(scene), {.backend = "cpu", .threads = 1}),
        without(Scene(scene), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff}) {
    if (!with.wait_covers(std::chrono::minutes(10))) throw std::runtime_error("covers are not made in time");
  }
  engine::Engine with, without;
};

using Counts = std::array<std::uint64_t, 8>;

/// Expects the same rows, and the same verdicts and pairs without other columns.
inline Counts expect_same(const Engines& engines, QueryView query) {
  query.reduce = Reduce::kAny;
  query.fields = kRows;
  const Answer without = test::evaluate(engines.without, query), with = test::evaluate(engines.with, query);
  const Counts counts = test::expect_same_rows(without, 0, with, query.configuration_count);
  EXPECT_LE(with.info.pairs_evaluated, without.info.pairs_evaluated);
  for (const std::uint32_t fields : {kFieldVerdict + 0u, kFieldVerdict | kFieldPair}) {
    query.fields = fields;
    const Answer off = test::evaluate(engines.without, query), on = test::evaluate(engines.with, query);
    for (std::uint32_t k = 0; k < query.configuration_count; ++k) {
      EXPECT_EQ(off.view.verdict[k], on.view.verdict[k]) << k;
      if (!(fields & kFieldPair)) continue;
      EXPECT_EQ(off.view.pair[k].a, on.view.pair[k].a) << k;
      EXPECT_EQ(off.view.pair[k].b, on.view.pair[k].b) << k;
    }
  }
  return counts;
}

}  // namespace clearance::exact
