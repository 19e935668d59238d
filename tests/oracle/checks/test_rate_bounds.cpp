// Compares certified intervals of rates with one-sided differences of 60-digit distances, where the nearest points are
// unique and where they are not.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tests/engine/evaluate_query.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/oracle/nearest_spans.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {
namespace {

using Twists = std::vector<double>;  // six numbers of a, six of b

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// Two bodies that a query moves.
class MovingPair {
 public:
  explicit MovingPair(engine::Scene scene, bool signed_distance = false)
      : engine_(std::move(scene), test::kWithoutCovers), signed_(signed_distance) {}

  struct Bounds {
    double lower, upper, rate, distance, smooth_radius;
    bool hold(double value) const { return lower <= value && value <= upper; }
    double width() const { return upper - lower; }
  };
  Bounds at(const Pose& a, const Pose& b, const Twists& twists, std::span<const double> errors = {}) const {
    const BodyPair pair{0, 1};
    const std::uint32_t bodies[] = {0, 1};
    const Pose poses[] = {a, b};
    QueryView query = test::query_of_pair(pair);
    query.bodies = bodies;
    query.configurations = poses;
    query.configuration_count = 1;
    query.twists = twists;
    query.speed_errors = errors;
    query.signed_distance = signed_;
    query.fields = kDefaultFields | kFieldRate | kFieldRateBounds | kFieldSmoothRadius;
    const test::Answer r = test::evaluate(engine_, query);
    return {r.view.rate_bounds[0], r.view.rate_bounds[1], r.view.rate[0], r.view.distance[0], r.view.smooth_radius[0]};
  }
  const std::vector<Vec3d>& vertices(std::uint32_t body) const {
    return engine_.scene().bodies()[body].parts[0]->vertices;
  }

 private:
  engine::Engine engine_;
  bool signed_;
};

Twists twists_of(const Vec3d& turn_a, const Vec3d& shift_a, const Vec3d& turn_b = {0, 0, 0},
                 const Vec3d& shift_b = {0, 0, 0}) {
  return {turn_a.x, turn_a.y, turn_a.z, shift_a.x, shift_a.y, shift_a.z,
          turn_b.x, turn_b.y, turn_b.z, shift_b.x, shift_b.y, shift_b.z};
}

// A frame after a time, to first order.
RealFrame after(const RealFrame& X, const double* twist, const Real& time) {
  RealFrame next = X;
  for (int i = 0; i < 3; ++i) {
    const int y = (i + 1) % 3, z = (i + 2) % 3;
    for (int k = 0; k < 3; ++k) next.R[i][k] += time * (twist[y] * X.R[z][k] - twist[z] * X.R[y][k]);
    next.t.x[i] += time * twist[3 + i];
  }
  return next;
}

// All spans of two hulls that are nearest up to rounding.
std::vector<Spans> near_spans(const std::vector<Vec3d>& a, const RealFrame& X_a, const std::vector<Vec3d>& b,
                              const RealFrame& X_b) {
  std::vector<std::pair<double, Spans>> all;
  double least = kInfinite;
  for_each_spans(a, X_a, b, X_b, [&](const Spans& s, double d, double weight) {
    if (!(weight > -1e-6)) return;
    least = std::min(least, d);
    all.emplace_back(d, s);
  });
  std::vector<Spans> near;
  for (const auto& [d, s] : all)
    if (d < least + 1e-9) near.push_back(s);
  return near;
}

Real least_distance(const std::vector<Spans>& spans, const RealFrame& X_a, const RealFrame& X_b) {
  Real least = kInfinite;
  for (const Spans& s : spans) {
    std::vector<RealPoint> a, b;
    for (const Vec3d& v : s.a) a.push_back(moved<Real>(X_a, v));
    for (const Vec3d& v : s.b) b.push_back(moved<Real>(X_b, v));
    double weight = 0;
    const Real d = distance_of(a, b, &weight);
    if (weight >= 0 && d < least) least = d;
  }
  return least;
}

// The derivatives before and after the present.
std::pair<double, double> one_sided(const MovingPair& pair, const Pose& a, const Pose& b, const Twists& twists) {
  const RealFrame X_a = test::real_frame(a), X_b = test::real_frame(b);
  const std::vector<Spans> spans = near_spans(pair.vertices(0), X_a, pair.vertices(1), X_b);
  const Real step = Real(1) / Real(1e15);
  const auto at = [&](const Real& time) {
    return least_distance(spans, after(X_a, twists.data(), time), after(X_b, twists.data() + 6, time));
  };
  const Real now = at(0);
  return {static_cast<double>((now - at(-step)) / step), static_cast<double>((at(step) - now) / step)};
}

engine::Scene boxes(const Vec3d& a, const Vec3d& b) {
  engine::Scene scene;
  scene.add_box("a", a, {});
  scene.add_box("b", b, {});
  return scene;
}

Twists random_twists(test::RobotRandom& random) {
  Twists twists;
  for (int k = 0; k < 12; ++k) twists.push_back(random.uniform(-1, 1));
  return twists;
}

TEST(RateBounds, OfUniqueNearestPointsAreNarrowAndHoldTheDerivative) {
  test::RobotRandom random(48);
  const MovingPair pair(boxes({0.5, 0.7, 0.3}, {0.4, 0.2, 0.6}));
  double widest = 0;
  int apart = 0;
  for (int i = 0; i < 300; ++i) {
    const Pose a = random.pose(0.8, 1), b = random.pose(0.8, 1);
    const Twists twists = random_twists(random);
    const auto r = pair.at(a, b, twists);
    if (!(r.distance > 0.01)) continue;
    ++apart;
    const auto [before, after_it] = one_sided(pair, a, b, twists);
    EXPECT_NEAR(before, after_it, 1e-9) << "they are unique";
    EXPECT_TRUE(r.hold(before) && r.hold(after_it)) << r.lower << " " << before << " " << r.upper;
    EXPECT_TRUE(r.hold(r.rate));
    widest = std::max(widest, r.width());
  }
  EXPECT_GT(apart, 150);
  EXPECT_LT(widest, 1e-4);
}

TEST(RateBounds, OfParallelFacesAndEdgesHoldBothDerivatives) {
  test::RobotRandom random(49);
  const MovingPair pair(boxes({0.5, 0.7, 0.3}, {0.4, 0.2, 0.6}));
  int different = 0;
  for (int i = 0; i < 100; ++i) {
    // Faces meet, or edges along x, at a random place of the pair.
    const bool edges = i % 2 == 1;
    const Pose a{{0, 0, 0}}, b{{random.uniform(-0.3, 0.3), edges ? 0.9 : random.uniform(-0.3, 0.3), 0.8}};
    const Twists twists = random_twists(random);
    const auto r = pair.at(a, b, twists);
    const auto [before, after_it] = one_sided(pair, a, b, twists);
    different += before > after_it + 0.01;
    EXPECT_LE(after_it, before + 1e-9) << "a least distance bends downwards";
    EXPECT_TRUE(r.hold(before) && r.hold(after_it)) << r.lower << " " << after_it << " " << before << " " << r.upper;
    EXPECT_LT(r.width(), 6) << "narrower than the speeds of the bodies";
  }
  EXPECT_GT(different, 80);
}

TEST(RateBounds, OfATurningBoxAreThoseOfItsEdges) {
  const MovingPair pair(boxes({4, 4, 1}, {1, 1, 1}));
  const auto r = pair.at(Pose{{0, 0, 0}}, Pose{{0.2, 0.1, 2}}, twists_of({0, 0, 0}, {0, 0, 0}, {0, 2, 0}, {0, 0, 0.5}));
  EXPECT_TRUE(r.hold(0.5 - 2 * 0.5) && r.hold(0.5 + 2 * 0.5));
  EXPECT_NEAR(r.lower, -0.5, 1e-4) << "its left edge sinks";
  EXPECT_NEAR(r.upper, 1.5, 1e-4) << "its right edge rose";
}

TEST(RateBounds, OfBallsAreNarrow) {
  engine::Scene scene;
  scene.add_sphere("a", 0.2, {});
  scene.add_sphere("b", 0.1, {});
  const MovingPair pair(std::move(scene));
  const auto r = pair.at(Pose{{0, 0, 0}}, Pose{{3, 4, 0}}, twists_of({5, 6, 7}, {0, 0, 0}, {1, 2, 3}, {1, 0.5, 0.25}));
  EXPECT_TRUE(r.hold(0.6 * 1 + 0.8 * 0.5));
  EXPECT_LT(r.width(), 1e-4) << "balls that turn stay where they are";
}

TEST(RateBounds, OfHalfSpacesAndRoundCores) {
  engine::Scene scene;
  scene.add_half_space("floor", {.pose = Pose{}});
  scene.add_cylinder("b", 0.3, 1, {});
  const engine::Engine engine(std::move(scene), test::kWithoutCovers);
  const BodyPair pair{0, 1};
  const std::uint32_t body = 1;
  const double s = std::sqrt(0.5), twist[] = {0, 2, 0, 0.1, 0, 0.25};
  QueryView query = test::query_of_pair(pair);
  query.bodies = {&body, 1};
  query.configuration_count = 1;
  query.twists = twist;
  query.fields = kDefaultFields | kFieldRateBounds;
  const auto at = [&](const Pose& pose) {
    query.configurations = {&pose, 1};
    const test::Answer r = test::evaluate(engine, query);
    return std::pair(r.view.rate_bounds[0], r.view.rate_bounds[1]);
  };
  const auto [low, high] = at(Pose{{0, 0, 2}, s, 0, s, 0});  // it lies along x
  EXPECT_NEAR(low, 0.25 - 2 * 0.5, 1e-4) << "one end sinks";
  EXPECT_NEAR(high, 0.25 + 2 * 0.5, 1e-4);
  const double c8 = std::cos(M_PI / 8), s8 = std::sin(M_PI / 8);  // leans by 45 degrees about y
  const auto [below, above] = at(Pose{{0, 0, 2}, c8, 0, s8, 0});
  // Its lowest point, in its own axes (0.3, 0, -0.5), is at x = s (0.3 - 0.5) from the middle; a turn about y moves it
  // by -2 x along z.
  const double exact = 0.25 - 2 * s * (0.3 - 0.5);
  EXPECT_TRUE(below <= exact && exact <= above) << below << " " << exact << " " << above;
  EXPECT_LT(above - below, 1e-4);
}

// A ball, and a body of two balls at some distance from it on either side.
engine::Scene ball_between_two(double distance, double radius) {
  engine::Scene scene;
  scene.add_sphere("a", 0.1, {});
  Body two;
  two.name = "b";
  for (const double x : {-distance, distance}) {
    const Vec3d centre{x, 0, 0};
    two.parts.push_back(make_convex_part({centre}, radius));
  }
  scene.add_body(std::move(two));
  return scene;
}

TEST(RateBounds, OfBodiesOfSeveralPartsHoldThoseOfAllNearestParts) {
  const MovingPair pair(ball_between_two(1, 0.1));
  const Twists twists = twists_of({0, 0, 0}, {1, 0, 0});
  const auto middle = pair.at(Pose{}, Pose{}, twists);
  EXPECT_TRUE(middle.hold(-1) && middle.hold(1));
  EXPECT_LT(middle.width(), 2 + 1e-4);
  const auto right = pair.at(Pose{{0.01, 0, 0}}, Pose{}, twists);
  EXPECT_TRUE(right.hold(-1));
  EXPECT_LT(right.width(), 1e-4) << "the other part is not the nearest";
  EXPECT_NEAR(right.smooth_radius, 0.01, 1e-6) << "it is 0.02 m farther";
}

TEST(RateBounds, OfPartsThatOverlapEquallyHoldThoseOfBoth) {
  const MovingPair pair(ball_between_two(0.1, 0.15), true);
  const auto middle = pair.at(Pose{}, Pose{}, twists_of({0, 0, 0}, {1, 0, 0}));
  EXPECT_NEAR(middle.distance, -0.15, 1e-12);
  EXPECT_TRUE(middle.hold(-1) && middle.hold(1));
  EXPECT_LT(middle.width(), 2 + 1e-4);
}

// So many pairs of parts at one place that keeping them all could exhaust the memory.
TEST(RateBounds, OfVeryManyNearestPartsAreTheSpeeds) {
  const auto at = [](int parts) {
    engine::Scene scene;
    for (const char* name : {"a", "b"}) {
      Body body;
      body.name = name;
      for (int i = 0; i < parts; ++i) body.parts.push_back(make_convex_part({Vec3d{0, 0, 0}}, 0.1));
      scene.add_body(std::move(body));
    }
    return MovingPair(std::move(scene)).at(Pose{}, Pose{{0, 0, 1}}, twists_of({0, 0, 0}, {1, 0, 0}));
  };
  const auto few = at(8), many = at(40);
  EXPECT_TRUE(few.hold(0) && many.hold(0));
  EXPECT_LT(few.width(), 1e-4);
  EXPECT_NEAR(many.lower, -1, 1e-9);
  EXPECT_NEAR(many.upper, 1, 1e-9);
}

TEST(RateBounds, OfOverlapsAreTheSpeedsAndWithDepthsThoseOfTheCores) {
  const auto balls = [] {
    engine::Scene scene;
    scene.add_sphere("a", 0.2, {});
    scene.add_sphere("b", 0.2, {});
    return scene;
  };
  const Twists apart = twists_of({0, 0, 0}, {-1, 0, 0});
  const auto unsigned_one = MovingPair(balls()).at(Pose{}, Pose{{0.3, 0, 0}}, apart);
  EXPECT_TRUE(unsigned_one.hold(0) && unsigned_one.hold(1)) << "when they touch no more";
  const auto signed_one = MovingPair(balls(), true).at(Pose{}, Pose{{0.3, 0, 0}}, apart);
  EXPECT_LT(signed_one.distance, 0);
  EXPECT_TRUE(signed_one.hold(1));
  EXPECT_LT(signed_one.width(), 1e-4);
}

TEST(RateBounds, HoldTheRatesOfAllVelocitiesWithinTheirErrors) {
  test::RobotRandom random(50);
  const MovingPair pair(boxes({0.5, 0.7, 0.3}, {0.4, 0.2, 0.6}));
  const double errors[] = {0.1, 0.05, 0.2, 0.02};  // turn and shift of a, of b
  double nearest = kInfinite;
  for (int i = 0; i < 12; ++i) {
    const Pose a{{0, 0, 0}}, b = random.pose(0.2, 1);
    const Pose away{b.translation + Vec3d{0, 0, 1}, b.qw, b.qx, b.qy, b.qz};
    const Twists twists = random_twists(random);
    const auto r = pair.at(a, away, twists, errors);
    for (int n = 0; n < 40; ++n) {
      Twists other = twists;
      for (int k = 0; k < 4; ++k) {
        const Vec3d error = random.direction() * errors[k];
        for (int c = 0; c < 3; ++c) other[3 * k + c] += error[c];
      }
      const auto exact = pair.at(a, away, other);
      EXPECT_TRUE(r.hold(exact.rate)) << r.lower << " " << exact.rate << " " << r.upper;
      nearest = std::min({nearest, r.upper - exact.rate, exact.rate - r.lower});
    }
    EXPECT_LT(r.width(), 2 * (0.1 * 1.4 + 0.05 + 0.2 * 1.4 + 0.02) + 1e-3);
  }
  EXPECT_LT(nearest, 0.2) << "of the least half width";
}

// A ball a metre from a vertical axis, or on a horizontal slide, and one far above it: only a tilt of the base lets the
// joint move the first up or down.
TEST(RateBounds, HoldTheRatesOfUncertainAxesWithinErrorsOfSpeeds) {
  for (const std::string kind :
       {"type='continuous'><axis xyz='0 0 1'/>", "type='prismatic'><axis xyz='1 0 0'/><limit lower='-1' upper='1'/>"}) {
    const TemporaryFolder folder;
    const std::string geometry = "<collision><geometry><sphere radius='0.1'/></geometry></collision>";
    engine::RobotOptions options;
    options.urdf = folder.write(
        "r.urdf", "<robot name='r'><link name='base'/><link name='arm'/><link name='tip'>" + geometry +
                      "</link><joint name='j' " + kind + "<parent link='base'/><child link='arm'/></joint>" +
                      "<joint name='f' type='fixed'><parent link='arm'/><child link='tip'/><origin xyz='1 0 0'/>" +
                      "</joint></robot>");
    options.home.emplace();
    options.parent = "stand";
    engine::Scene scene;
    scene.add_sphere("above", 0.1, {.is_static = true, .pose = Pose{{1, 0, 100}}});
    scene.add_box("stand", {0.1, 0.1, 0.1}, {.pose = Pose{}, .uncertainty = {.position = 0, .angle = 0.05}});
    scene.add_robot("r", options);
    const BodyPair pair{0, scene.find_body("r/tip")};
    const engine::Engine engine(std::move(scene), test::kWithoutCovers);
    const std::uint32_t joint = 0;
    const double position = 0, speed = 0, error = 1;
    QueryView query = test::query_of_pair(pair);
    query.joints = {&joint, 1};
    query.positions = {&position, 1};
    query.velocities = {&speed, 1};
    query.speed_errors = {&error, 1};
    query.configuration_count = 1;
    query.fields = kDefaultFields | kFieldRateBounds;
    const test::Answer r = test::evaluate(engine, query);
    EXPECT_LT(r.view.rate_bounds[0], -std::sin(0.05)) << kind;
    EXPECT_GT(r.view.rate_bounds[1], std::sin(0.05)) << kind;
  }
}

// The distance of uncertain bodies is the least of all permitted placements.
TEST(RateBounds, HoldTheRatesOfUncertainPlacements) {
  engine::Scene exact = boxes({0.5, 0.7, 0.3}, {0.4, 0.2, 0.6}), uncertain;
  uncertain.add_box("a", {0.5, 0.7, 0.3}, {});
  uncertain.add_box("b", {0.4, 0.2, 0.6}, {.uncertainty = {.position = 0, .angle = 0.02}});
  const MovingPair known(std::move(exact)), pair(std::move(uncertain));
  test::RobotRandom random(51);
  for (int i = 0; i < 12; ++i) {
    const Pose b = random.pose(0.2, 1);
    const Pose away{b.translation + Vec3d{0, 0, 1}, b.qw, b.qx, b.qy, b.qz};
    const Twists twists = random_twists(random);
    const auto r = pair.at(Pose{}, away, twists);
    for (int n = 0; n < 40; ++n) {
      const Vec3d half = random.direction() * std::sin(0.5 * random.uniform(0, 0.02));
      const Pose turned = compose(Pose{{0, 0, 0}, std::sqrt(1 - squared_norm(half)), half.x, half.y, half.z},
                                  Pose{{0, 0, 0}, away.qw, away.qx, away.qy, away.qz});
      const Pose placed{away.translation, turned.qw, turned.qx, turned.qy, turned.qz};
      EXPECT_TRUE(r.hold(known.at(Pose{}, placed, twists).rate));
    }
  }
}

// A ball above a face whose angle is uncertain, and with it the normal. Neither turns, so nothing else widens the bounds.
TEST(RateBounds, HoldTheRatesOfAllNormals) {
  const auto boxes = [](double angle) {
    engine::Scene scene;
    scene.add_sphere("a", 0.1, {});
    Body b;
    b.name = "b";
    std::vector<Vec3d> corners;
    for (const double x : {-0.5, 0.5})
      for (const double y : {-0.5, 0.5})
        for (const double z : {-0.5, 0.5}) corners.push_back({x, y, z});
    b.parts.push_back(make_convex_part(corners, 0));
    b.uncertainty.angle = angle;
    scene.add_body(std::move(b));
    return scene;
  };
  const MovingPair known(boxes(0)), pair(boxes(0.05));
  const Twists twists = twists_of({0, 0, 0}, {0, 1, 0});
  const Pose a{{0, 0, 1}};
  const auto r = pair.at(a, Pose{}, twists);
  for (const double angle : {-0.05, -0.02, 0.03, 0.05}) {
    const auto exact = known.at(a, Pose{{0, 0, 0}, std::cos(angle / 2), std::sin(angle / 2), 0, 0}, twists);
    EXPECT_NEAR(std::abs(exact.rate), std::abs(angle), 1e-3);
    EXPECT_TRUE(r.hold(exact.rate)) << r.lower << " " << exact.rate << " " << r.upper;
  }
}

}  // namespace
}  // namespace clearance::exact
