// Compares second derivatives of distances with differences of 60-digit distances of the features that meet.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tests/engine/evaluate_query.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/engine/robot/random_robot.h"
#include "tests/oracle/nearest_spans.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {
namespace {

using test::Answer;
using test::evaluate;

constexpr std::uint32_t kFields = kDefaultFields | kFieldGradientJoints | kFieldHessianJoints | kFieldRate |
                                  kFieldCurvature | kFieldSmoothRadius | kFieldRateBounds;

// A robot of boxes, capsules and balls on random joints, and such bodies in the world.
class ShapeScene {
 public:
  explicit ShapeScene(test::RobotRandom& random, int joints = 5) : random_(random) {
    const TemporaryFolder folder;
    const std::string urdf = folder.write("r.urdf", urdf_of(joints));
    engine::Scene scene;
    scene.add_box("box", {0.7, 0.4, 0.9}, {.is_static = true, .pose = random.pose(1.5, 1)});
    scene.add_capsule("capsule", 0.05, 0.6, {.is_static = true, .pose = random.pose(1.5, 1)});
    scene.add_sphere("ball", 0.1, {.is_static = true, .pose = random.pose(1.5, 1)});
    std::vector<Vec3d> wedge;
    for (int i = 0; i < 6; ++i) wedge.push_back(random.direction() * 0.4);
    scene.add_hull("wedge", wedge, {.is_static = true, .pose = random.pose(1.5, 1)});
    engine::RobotOptions options;
    options.urdf = urdf;
    options.home.emplace();
    scene.add_robot("r", options);
    robot_ = scene.robots()[0];
    for (std::uint32_t j = 0; j < scene.joints().size(); ++j) joints_.push_back(j);
    // Without covers, for whose thread of low priority each scene's end would wait on a busy machine.
    engine_ = std::make_unique<engine::Engine>(
        std::move(scene), engine::Engine::Options{.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  }

  const engine::Engine& engine() const { return *engine_; }
  std::span<const std::uint32_t> joints() const { return joints_; }
  std::vector<double> row() const {
    std::vector<double> q;
    for (std::size_t j = 0; j < joints_.size(); ++j) q.push_back(random_.uniform(-1.5, 1.5));
    return q;
  }
  /// Frames of all bodies.
  std::vector<RealFrame> frames(std::span<const Real> q) const {
    const std::vector<Pose> roots = {Pose{}};
    const auto links = test::real_links(robot_->model, q.data(), robot_->kinematics.roots(), roots);
    std::vector<RealFrame> frames;
    for (const Body& body : engine_->scene().bodies()) frames.push_back(test::real_frame(body.pose.value_or(Pose{})));
    for (std::size_t l = 0; l < links.size(); ++l) frames[robot_->bodies[l]] = links[l];
    return frames;
  }
  const std::vector<Vec3d>& vertices(std::uint32_t body) const {
    return engine_->scene().bodies()[body].parts[0]->vertices;
  }

 private:
  std::string urdf_of(int joints) {
    const auto xyz = [&](double most) {
      return std::to_string(random_.uniform(-most, most)) + " " + std::to_string(random_.uniform(-most, most)) + " " +
             std::to_string(random_.uniform(-most, most));
    };
    const char* const shapes[] = {"<box size='0.2 0.3 0.25'/>", "<sphere radius='0.07'/>",
                                  "<capsule radius='0.04' length='0.3'/>"};
    std::string text = "<robot name='r'>";
    for (int l = 0; l <= joints; ++l)
      text += "<link name='l" + std::to_string(l) + "'><collision><origin xyz='" + xyz(0.1) + "' rpy='" + xyz(1) +
              "'/><geometry>" + shapes[l % 3] + "</geometry></collision></link>";
    for (int j = 1; j <= joints; ++j) {
      const Vec3d axis = random_.direction();
      const bool slides = j % 4 == 3, mimics = j == joints;
      text += "<joint name='j" + std::to_string(j) + "' type='" + (slides ? "prismatic" : "continuous") +
              "'><parent link='l" + std::to_string(j - 1) + "'/><child link='l" + std::to_string(j) +
              "'/><origin xyz='" + xyz(0.4) + "' rpy='" + xyz(1.5) + "'/><axis xyz='" + std::to_string(axis.x) + " " +
              std::to_string(axis.y) + " " + std::to_string(axis.z) + "'/><limit lower='-9' upper='9'/>" +
              (mimics ? "<mimic joint='j1' multiplier='-0.7' offset='0.1'/>" : "") + "</joint>";
    }
    return text + "</robot>";
  }

  test::RobotRandom& random_;
  std::shared_ptr<const SceneRobot> robot_;
  std::vector<std::uint32_t> joints_;
  std::unique_ptr<engine::Engine> engine_;
};

// Hessians of several pairs, (P, J, J), by differences in 60 digits, whose error is about 1e-28.
std::vector<Real> differences(const ShapeScene& scene, std::span<const BodyPair> pairs, const std::vector<Spans>& spans,
                              std::span<const double> row) {
  const std::size_t J = row.size();
  const Real step = Real(1) / Real(1e15);
  std::vector<Real> hessians(pairs.size() * J * J);
  const std::vector<Real> q(row.begin(), row.end());
  for (std::size_t i = 0; i < J; ++i)
    for (std::size_t j = 0; j <= i; ++j)
      for (int corner = 0; corner < 4; ++corner) {
        std::vector<Real> near = q;
        near[i] += corner & 1 ? -step : step;
        near[j] += corner & 2 ? -step : step;
        const std::vector<RealFrame> frames = scene.frames(near);
        const Real sign = corner == 0 || corner == 3 ? 1 : -1;
        for (std::size_t p = 0; p < pairs.size(); ++p) {
          const Real d = real_distance(spans[p], frames[pairs[p].a], frames[pairs[p].b]);
          hessians[(p * J + i) * J + j] += sign * d / (4 * step * step);
        }
      }
  for (std::size_t p = 0; p < pairs.size(); ++p)
    for (std::size_t i = 0; i < J; ++i)
      for (std::size_t j = i + 1; j < J; ++j) hessians[(p * J + i) * J + j] = hessians[(p * J + j) * J + i];
  return hessians;
}

const Real kRealStep = Real(1) / Real(1e15);

// Frames a step before or after a row, along velocities.
std::vector<RealFrame> moving_frames(const ShapeScene& scene, std::span<const double> row, std::span<const double> v,
                                     int sign) {
  std::vector<Real> q;
  for (std::size_t j = 0; j < row.size(); ++j) q.push_back(Real(row[j]) + sign * kRealStep * Real(v[j]));
  return scene.frames(q);
}

TEST(SecondOrder, IsTheSecondDerivativeOfTheExactDistance) {
  test::RobotRandom random(47);
  std::map<std::string, int> met;
  double worst = 0, widest = 0;
  for (int i = 0; i < 40; ++i) {
    const ShapeScene scene(random);
    const std::size_t J = scene.joints().size();
    const std::vector<double> row = scene.row();
    std::vector<double> v;
    for (std::size_t j = 0; j < J; ++j) v.push_back(random.uniform(-1, 1));
    QueryView query;
    query.joints = scene.joints();
    query.positions = row;
    query.velocities = v;
    query.configuration_count = 1;
    query.fields = kFields;
    const std::vector<BodyPair> pairs = scene.engine().pairs(query);
    const Answer answer = evaluate(scene.engine(), query);
    const std::vector<Real> q(row.begin(), row.end());
    const std::vector<RealFrame> frames = scene.frames(q);
    std::vector<BodyPair> smooth;
    std::vector<Spans> spans;
    std::vector<std::size_t> rows;
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      if (!(answer.view.smooth_radius[p] > 1e-4) || !(answer.view.lower[p] > 0.01)) continue;
      const auto [a, b] = pairs[p];
      spans.push_back(nearest_spans(scene.vertices(a), frames[a], scene.vertices(b), frames[b]));
      smooth.push_back(pairs[p]);
      rows.push_back(p);
      const double radii =
          scene.engine().scene().bodies()[a].parts[0]->radius + scene.engine().scene().bodies()[b].parts[0]->radius;
      ASSERT_NEAR(static_cast<double>(real_distance(spans.back(), frames[a], frames[b])) - radii, answer.view.lower[p],
                  2e-6)
          << "the oracle has the nearest features";
      ++met[std::to_string(std::min(spans.back().a.size(), spans.back().b.size())) +
            std::to_string(std::max(spans.back().a.size(), spans.back().b.size()))];
    }
    const std::vector<RealFrame> ahead = moving_frames(scene, row, v, 1), behind = moving_frames(scene, row, v, -1);
    for (std::size_t p = 0; p < smooth.size(); ++p) {
      const auto [a, b] = smooth[p];
      const Real slope = (real_distance(spans[p], ahead[a], ahead[b]) - real_distance(spans[p], behind[a], behind[b])) /
                         (2 * kRealStep);
      const double* const bounds = answer.view.rate_bounds + 2 * rows[p];
      EXPECT_TRUE(bounds[0] <= slope && slope <= bounds[1]) << bounds[0] << " " << slope << " " << bounds[1];
      widest = std::max(widest, bounds[1] - bounds[0]);
    }
    const std::vector<Real> expected = differences(scene, smooth, spans, row);
    for (std::size_t p = 0; p < smooth.size(); ++p) {
      const double* const hessian = answer.view.hessian_joints + rows[p] * J * J;
      const Real* const exact = expected.data() + p * J * J;
      double size = 0, curvature = 0;
      for (std::size_t k = 0; k < J * J; ++k) {
        size = std::max(size, std::abs(static_cast<double>(exact[k])));
        curvature += static_cast<double>(exact[k]) * v[k / J] * v[k % J];
      }
      for (std::size_t k = 0; k < J * J; ++k) {
        const double error = std::abs(hessian[k] - static_cast<double>(exact[k]));
        worst = std::max(worst, error / std::max(size, 1.0));
        EXPECT_LE(error, 1e-9 * std::max(size, 1.0))
            << "bodies " << smooth[p].a << ", " << smooth[p].b << ", entry " << k << " of scene " << i;
      }
      EXPECT_NEAR(answer.view.curvature[rows[p]], curvature, 1e-9 * std::max(size * static_cast<double>(J), 1.0));
      double rate = 0;
      for (std::size_t j = 0; j < J; ++j) rate += answer.view.gradient_joints[rows[p] * J + j] * v[j];
      EXPECT_NEAR(answer.view.rate[rows[p]], rate, 1e-2) << "of the refined normal";
    }
  }
  RecordProperty("worst", std::to_string(worst));
  RecordProperty("widest_rate_bounds", std::to_string(widest));
  EXPECT_LT(worst, 1e-9);
  EXPECT_LT(widest, 1e-3) << "m/s, where features are smooth";
  EXPECT_GT(met["11"], 20) << "vertex and vertex";
  EXPECT_GT(met["12"], 50) << "vertex and edge";
  EXPECT_GT(met["13"], 20) << "vertex and face";
  EXPECT_GT(met["22"], 10) << "edge and edge";
}

// Three sliding joints along the world's axes, which carry a body.
class Slider {
 public:
  explicit Slider(const std::string& geometry) {
    std::string text = "<robot name='s'><link name='l0'/>";
    for (int j = 1; j <= 3; ++j) {
      text += "<link name='l" + std::to_string(j) + "'>" +
              (j == 3 ? "<collision><geometry>" + geometry + "</geometry></collision>" : "") + "</link>" +
              "<joint name='j" + std::to_string(j) + "' type='prismatic'><parent link='l" + std::to_string(j - 1) +
              "'/><child link='l" + std::to_string(j) + "'/><axis xyz='" + (j == 1 ? "1" : "0") + " " +
              (j == 2 ? "1" : "0") + " " + (j == 3 ? "1" : "0") + "'/><limit lower='-9' upper='9'/></joint>";
    }
    urdf_ = folder_.write("s.urdf", text + "</robot>");
    options_.urdf = urdf_;
    options_.home.emplace();
  }
  /// The row of the body at a place and the scene's first body.
  Answer at(engine::Scene scene, const Vec3d& place, bool signed_distance = false) {
    scene.add_robot("s", options_);
    for (std::uint32_t j = 0; j < 3; ++j) joints_[j] = scene.find_joint("s/j" + std::to_string(j + 1));
    pair_ = {0, scene.find_body("s/l3")};
    const engine::Engine engine(std::move(scene), test::kWithoutCovers);
    const double row[] = {place.x, place.y, place.z};
    QueryView query = test::query_of_pair(pair_);
    query.joints = joints_;
    query.positions = row;
    query.configuration_count = 1;
    query.signed_distance = signed_distance;
    query.fields = kFields;
    return evaluate(engine, query);
  }

 private:
  TemporaryFolder folder_;
  std::string urdf_;
  engine::RobotOptions options_;
  std::uint32_t joints_[3];
  BodyPair pair_;
};

// Its joints are columns of a query, but nothing moves them.
TEST(SecondOrder, OfCurrentPosesHasNoHessian) {
  test::RobotRandom random(7);
  const ShapeScene scene(random);
  const std::uint32_t joint = scene.joints().back();
  QueryView query;
  query.joints = {&joint, 1};
  query.fields = kFields;
  const Answer r = evaluate(scene.engine(), query);
  ASSERT_GT(r.size.rows, 10u);
  int known = 0;
  for (std::uint64_t row = 0; row < r.size.rows; ++row) {
    EXPECT_TRUE(std::isnan(r.view.hessian_joints[row]));
    known += std::isfinite(r.view.curvature[row]);
  }
  EXPECT_GT(known, 5);
}

TEST(SecondOrder, OfTwoBallsIsTheIdentityAcrossTheNormalByTheDistanceOfTheirCentres) {
  Slider slider("<sphere radius='0.1'/>");
  engine::Scene scene;
  scene.add_sphere("ball", 0.2, {.pose = Pose{}});
  const double x[3] = {0.3, 0.4, 0.5}, d = std::sqrt(0.5);
  const Answer r = slider.at(std::move(scene), {x[0], x[1], x[2]});
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(r.view.hessian_joints[3 * i + j], ((i == j) - x[i] * x[j] / (d * d)) / d, 1e-13);
  EXPECT_NEAR(r.view.hessian_joints[1], -0.3394, 1e-4) << "a term of 1 / d off the diagonal makes it 1.0748";
  EXPECT_EQ(r.view.smooth_radius[0], std::numeric_limits<double>::infinity());
}

TEST(SecondOrder, TheRadiusIsTheDistanceToTheNextFeature) {
  const auto box = [] {
    engine::Scene scene;
    scene.add_box("box", {2, 2, 2}, {.pose = Pose{}});
    return scene;
  };
  Slider ball("<sphere radius='0.25'/>");
  EXPECT_NEAR(ball.at(box(), {0.7, 0.2, 2}).view.smooth_radius[0], 0.3, 1e-12) << "of a face";
  EXPECT_NEAR(ball.at(box(), {0.7, 0.7, 2}).view.smooth_radius[0], 0.3, 1e-12) << "on a face's diagonal";
  EXPECT_NEAR(ball.at(box(), {1.5, 0.2, 1.6}).view.smooth_radius[0], 0.5, 1e-12) << "of an edge next to a face";
  EXPECT_NEAR(ball.at(box(), {1.5, 0.9, 1.6}).view.smooth_radius[0], 0.1, 1e-12) << "of an edge, near its end";
  EXPECT_NEAR(ball.at(box(), {1.4, 1.3, 1.6}).view.smooth_radius[0], 0.3, 1e-12) << "of a vertex next to an edge";
  EXPECT_NEAR(ball.at(box(), {1 - 1e-6, 0.2, 2}).view.smooth_radius[0], 1e-6, 1e-12);
  EXPECT_NEAR(ball.at(box(), {1 + 1e-6, 0.2, 2}).view.smooth_radius[0], 1e-6, 1e-12);
}

TEST(SecondOrder, WhereFeaturesChangeTheRadiusIsZero) {
  engine::Scene scene;
  scene.add_box("box", {2, 2, 2}, {.pose = Pose{}});
  Slider ball("<sphere radius='0.25'/>"), box("<box size='1 1 1'/>"), capsule("<capsule radius='0.1' length='1'/>");
  struct {
    Slider& body;
    Vec3d place;
  } cases[] = {{ball, {1, 0.2, 2}}, {ball, {1, 1, 2}},    {box, {0.3, 0.1, 3}},
               {box, {2, 2, 0.2}},  {capsule, {2, 0, 0}}, {capsule, {2, 2, 0}}};
  for (auto& [body, place] : cases) {
    engine::Scene own;
    own.add_box("box", {2, 2, 2}, {.pose = Pose{}});
    const Answer r = body.at(std::move(own), place);
    EXPECT_EQ(r.view.smooth_radius[0], 0) << place.x << " " << place.y << " " << place.z;
    for (int k = 0; k < 9; ++k) EXPECT_TRUE(std::isfinite(r.view.hessian_joints[k]));
  }
}

TEST(SecondOrder, OfAPlaneIsZeroForABallThatSlides) {
  Slider ball("<sphere radius='0.25'/>");
  engine::Scene scene;
  scene.add_half_space("floor", {.pose = Pose{}});
  const Answer r = ball.at(std::move(scene), {3, 4, 1});
  for (int k = 0; k < 9; ++k) EXPECT_NEAR(r.view.hessian_joints[k], 0, 1e-15);
  EXPECT_EQ(r.view.smooth_radius[0], std::numeric_limits<double>::infinity());
}

TEST(SecondOrder, ThereIsNoneForOverlappingCores) {
  Slider ball("<sphere radius='0.25'/>");
  const auto box = [] {
    engine::Scene scene;
    scene.add_box("box", {2, 2, 2}, {.pose = Pose{}});
    return scene;
  };
  for (const bool depths : {false, true}) {
    const Answer inside = ball.at(box(), {0.2, 0.1, 0.5}, depths);
    EXPECT_TRUE(std::isnan(inside.view.hessian_joints[0]));
    EXPECT_TRUE(std::isnan(inside.view.smooth_radius[0]));
  }
  const Answer shallow = ball.at(box(), {0.2, 0.1, 1.125}, true);
  EXPECT_LT(shallow.view.upper[0], 0);
  EXPECT_NEAR(shallow.view.smooth_radius[0], 0.125, 1e-12) << "the cores are apart";
}

TEST(SecondOrder, TwistsOfBodiesAddUp) {
  engine::Scene scene;
  const std::uint32_t a = scene.add_sphere("a", 0.1, {.pose = Pose{}});
  const std::uint32_t b = scene.add_box("b", {1, 1, 1}, {.pose = Pose{}});
  const engine::Engine engine(std::move(scene), test::kWithoutCovers);
  const BodyPair pair{a, b};
  const std::uint32_t bodies[] = {a, b};
  const Pose poses[] = {Pose{{0, 0, 2}}, Pose{{0.25, 0, 0}}};
  // The ball moves sideways and down; the box turns about y.
  const double twists[] = {0, 0, 0, 0.5, 0, -1, 0, 2, 0, 0, 0, 0};
  QueryView query = test::query_of_pair(pair);
  query.bodies = bodies;
  query.configurations = poses;
  query.configuration_count = 1;
  query.twists = twists;
  query.fields = kDefaultFields | kFieldRate | kFieldCurvature;
  const Answer r = evaluate(engine, query);
  // Height above the top face of the ball at (x, z) from the box's origin: x sin t + z cos t - 1/2, t = 2 s.
  const double x = -0.25, z = 2, vx = 0.5, vz = -1, w = 2;
  EXPECT_NEAR(r.view.rate[0], vz + x * w, 1e-12);
  EXPECT_NEAR(r.view.curvature[0], 2 * vx * w - z * w * w, 1e-12);
}

}  // namespace
}  // namespace clearance::exact
