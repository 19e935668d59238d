// Compares cones, cylinders and ellipsoids with closed forms in 450 bits, and their directions with supports in as
// many.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "engine/hull/primitive.h"
#include "engine/narrow/proof.h"
#include "engine/pose/placed.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/exact/exact_round.h"

namespace clearance::exact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Reach of a part along n, in its own axes.
Real reach(const ConvexPart& convex_part, const Vec3r& n) {
  Real far;
  if (!convex_part.primitive) {
    for (std::size_t i = 0; i < convex_part.vertices.size(); ++i) {
      const Real at = product(n, real(convex_part.vertices[i]));
      if (i == 0 || at > far) far = at;
    }
  } else {
    const Vec3r size = real(convex_part.primitive->size);
    if (convex_part.primitive->kind == Primitive::Kind::kEllipsoid)
      far = length({size.x * n.x, size.y * n.y, size.z * n.z});
    else if (convex_part.primitive->kind == Primitive::Kind::kCone)
      far = larger(size.z * n.z, size.x * sqrt(Real(n.x * n.x + n.y * n.y)) - size.z * n.z);
    else
      far = size.x * sqrt(Real(n.x * n.x + n.y * n.y)) + size.z * abs(n.z);
  }
  return far + real(convex_part.radius) * length(n);
}

// The gap of the planes normal to n, axes of a: at most the signed distance.
Real gap(const ConvexPart& a, const Pose& X_wa, const ConvexPart& b, const Pose& X_wb, const Vec3r& n) {
  const Vec3r n_w = turned(X_wa, n), n_b = turned(X_wb, n_w, true);
  const Vec3r D = difference(real(X_wb.translation), real(X_wa.translation));
  const Vec3r minus{-n_b.x, -n_b.y, -n_b.z};
  return (product(n_w, D) - reach(a, n) - reach(b, minus)) / length(n);
}

PoseMatrix placed(const Pose& X) {
  return {rotation_of(X), X.translation, X};
}

Vec3d sizes(Random& random, bool extreme) {
  const auto one = [&] { return extreme ? random.log_uniform(1e-6, 1e3) : random.log_uniform(0.05, 2); };
  return {one(), one(), one()};
}

ConvexPartPtr round_part(Random& random, bool extreme) {
  const Vec3d s = sizes(random, extreme);
  const double radius = random.chance(0.3) ? random.log_uniform(1e-4, 0.5) : 0;
  const auto kind = random.integer(0, 2);
  if (kind == 0) return make_primitive_part({Primitive::Kind::kEllipsoid, s}, radius);
  const Primitive::Kind along_z = kind == 1 ? Primitive::Kind::kCone : Primitive::Kind::kCylinder;
  return make_primitive_part({along_z, {s.x, s.x, s.z}}, radius);
}

// Apart, touching or deep, near the origin or 10 km away, with simple rotations or any.
struct CheckedBalls {
  int requested = 0, converged = 0, near = 0, deep = 0;
  int of_kind[5] = {};                // round parts by their Primitive::Kind
  int depths = 0, narrow_depths = 0;  // of overlaps queried with depth; not included in `requested`
  double widest_depth = 0;            // relative to its length
  void print(const char* what) const {
    std::printf("%s: %d answers, %d settled, %d near, %d deep; %d depths, %d settled, widest %.2g\n", what, requested,
                converged, near, deep, depths, narrow_depths, widest_depth);
  }
  void take(const NarrowAnswer& answer, bool depth) {
    const auto [lower, upper] = answer.bounds;
    const bool has_converged = answer.converged || (lower <= 0 && upper > 0 && upper - lower <= 4 * answer.rounding);
    if (depth && upper <= 0) {
      ++depths;
      narrow_depths += has_converged;
      widest_depth = std::max(widest_depth, (upper - lower) / -lower);
    } else {
      ++requested;
      converged += has_converged;
    }
  }
};

Pose any_pose(Random& random, double far) {
  const Vec3d at{random.uniform(-far, far), random.uniform(-far, far), random.uniform(-far, far)};
  return random.chance(0.3) ? Pose{at, 1, 0, 0, 0} : random.rotation(at);
}

// A ball next to a round part: the distance is a closed form.
CheckedBalls check_balls(bool extreme, int count, std::uint64_t seed) {
  mpf_set_default_prec(kBits);
  Random random(seed);
  CheckedBalls checked;
  for (int i = 0; i < count; ++i) {
    const ConvexPartPtr convex_part = round_part(random, extreme);
    const ConvexPartPtr ball = make_convex_part({{0, 0, 0}}, random.chance(0.5) ? random.log_uniform(1e-3, 1) : 0);
    const Pose X_wa = any_pose(random, random.chance(0.3) ? 1e4 : 1);
    // From a point of the surface, outwards or inwards.
    const FarthestPoint<double> on = farthest(*convex_part->primitive, random.direction());
    const double step[] = {random.log_uniform(1e-12, 1e-3), random.uniform(0, 2), -random.log_uniform(1e-9, 0.1), 0};
    const double grown = convex_part->radius + ball->radius;
    const Vec3d direction = random.direction();
    const double outward = dot(direction, on.point) < 0 ? -1 : 1;
    Pose X_wb = any_pose(random, 1);
    X_wb.translation = X_wa.translation +
                       rotation_of(X_wa) * (on.point + direction * (outward * (grown + step[random.integer(0, 3)])));
    if (random.chance(0.2)) X_wb.translation = X_wa.translation + rotation_of(X_wa) * (on.point * random.uniform(0, 1));
    const Vec3r p = turned(X_wa, difference(real(X_wb.translation), real(X_wa.translation)), true);
    if (p.x == 0 || p.y == 0 || p.z == 0) continue;  // there the closed form divides by zero
    const Real exact = from_round(*convex_part->primitive, p) - real(convex_part->radius) - real(ball->radius);
    const double tiny = 1e-60;  // of the oracle's own bits
    for (const bool depth : {true, false})
      for (const bool swapped : {false, true}) {
        NarrowLimits limits;
        limits.signed_distance = depth;
        const PoseMatrix a = placed(X_wa), b = placed(X_wb);
        const NarrowAnswer answer =
            swapped ? narrow_phase(*ball, b, *convex_part, a, limits) : narrow_phase(*convex_part, a, *ball, b, limits);
        const auto [lower, upper] = answer.bounds;
        EXPECT_TRUE(lower == -kInf || real(lower) <= exact + tiny) << i << ": " << lower << " > " << exact.get_d();
        EXPECT_TRUE(upper == kInf || real(upper) >= exact - tiny) << i << ": " << upper << " < " << exact.get_d();
        checked.take(answer, depth);
      }
    checked.near += abs(exact) < 1e-6;
    checked.deep += exact < -1e-3;
    ++checked.of_kind[static_cast<int>(convex_part->primitive->kind)];
  }
  checked.print(extreme ? "balls, extreme" : "balls");
  return checked;
}

TEST(RoundCores, HoldTheDistanceOfABall) {
  const CheckedBalls checked = check_balls(false, 1500, 1);
  EXPECT_GT(checked.near, 200);
  EXPECT_GT(checked.deep, 200);
  for (const auto kind : {Primitive::Kind::kCone, Primitive::Kind::kEllipsoid, Primitive::Kind::kCylinder})
    EXPECT_GT(checked.of_kind[static_cast<int>(kind)], 300);
  EXPECT_GE(checked.converged, checked.requested * 0.999);
  EXPECT_GT(checked.depths, 1000);
  EXPECT_GE(checked.narrow_depths, checked.depths * 0.9);
  EXPECT_LE(checked.widest_depth, 0.02);
}

// Half axes from 1 um to 1 km, needles and discs: bounds are valid, narrow or not.
TEST(RoundCores, HoldItWhateverTheirShape) {
  const CheckedBalls checked = check_balls(true, 800, 2);
  EXPECT_GT(checked.near, 100);
  EXPECT_GE(checked.converged, checked.requested * 0.9);
}

ConvexPartPtr any_part(Random& random) {
  if (random.chance(0.5)) return round_part(random, false);
  std::vector<Vec3d> vertices;
  for (int i = random.integer(1, 30); i > 0; --i) vertices.push_back(random.direction() * random.uniform(0.2, 1));
  return make_convex_part(std::move(vertices), random.chance(0.3) ? random.uniform(0, 0.3) : 0);
}

// Whether a point, in body axes, lies in a part's core or no farther from it than the radius; all to 1e-12.
bool holds_point(const ConvexPart& convex_part, const Vec3d& p) {
  if (!convex_part.primitive) {  // no farther along any of many directions
    Random random(5);
    for (int i = 0; i < 100; ++i) {
      const Vec3d n = random.direction();
      if (real(dot(n, p)) > reach(convex_part, real(n)) + 1e-12) return false;
    }
    return true;
  }
  return from_round(*convex_part.primitive, real(p)) <= convex_part.radius + 1e-12;
}

// Pairs of all kinds: the direction proves the lower bound in 450 bits, and the witness points lie in their parts with
// the distance of the upper bound.
TEST(RoundCores, AreProvedByDirectionsAndPoints) {
  mpf_set_default_prec(kBits);
  Random random(3);
  CheckedBalls checked;
  for (int i = 0; i < 2000; ++i) {
    const ConvexPartPtr a = any_part(random), b = any_part(random);
    if (!is_round(*a) && !is_round(*b)) continue;
    const Pose X_wa = any_pose(random, 1);
    Pose X_wb = any_pose(random, random.chance(0.5) ? 1 : 4);
    const PoseMatrix pose_a = placed(X_wa);
    NarrowLimits limits;
    limits.signed_distance = random.chance(0.5);
    NarrowProof proof;
    if (random.chance(0.4)) {  // touching, nearly
      const NarrowAnswer first = narrow_phase(*a, pose_a, *b, placed(X_wb), limits);
      if (std::isfinite(first.bounds.lower))
        X_wb.translation += first.normal * (random.log_uniform(1e-10, 1e-2) - first.bounds.lower);
    }
    const PoseMatrix pose_b = placed(X_wb);
    const NarrowAnswer answer = narrow_phase_proved(*a, pose_a, *b, pose_b, limits, proof);
    const auto [lower, upper] = answer.bounds;
    checked.take(answer, limits.signed_distance);
    checked.near += std::abs(upper) < 1e-6;
    checked.deep += upper < -1e-3;
    ASSERT_LE(lower, upper);
    if (lower > -kInf) {
      const auto exactly = [](const DoubleDouble& x) { return Real(real(x.hi) + real(x.lo)); };
      const Vec3r n{exactly(proof.direction.x), exactly(proof.direction.y), exactly(proof.direction.z)};
      EXPECT_TRUE(real(lower) <= gap(*a, X_wa, *b, X_wb, n)) << i;
    }
    const Vec3d p_a = pose_a.R_wb.transpose_times(answer.point_a), p_b = pose_b.R_wb.transpose_times(answer.point_b);
    EXPECT_TRUE(holds_point(*a, p_a)) << i;
    EXPECT_TRUE(holds_point(*b, p_b)) << i;
    const double apart = norm(answer.point_b + X_wb.translation - answer.point_a - X_wa.translation);
    if (upper > 0) {
      EXPECT_NEAR(apart, upper, 1e-11 + 1e-9 * upper) << i;
    }
  }
  checked.print("pairs");
  EXPECT_GT(checked.requested, 1000);
  EXPECT_GT(checked.near, 200);
  EXPECT_GT(checked.deep, 100);
  EXPECT_GE(checked.converged, checked.requested * 0.995);
}

}  // namespace
}  // namespace clearance::exact
