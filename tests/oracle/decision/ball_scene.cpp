#include "tests/oracle/decision/ball_scene.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "engine/hull/convex_part.h"
#include "tests/temporary_folder.h"

namespace clearance::exact {
namespace {

std::string text_of(const Vec3d& v) {
  char text[100];
  std::snprintf(text, sizeof text, "%.17g %.17g %.17g", v.x, v.y, v.z);
  return text;
}

std::string urdf_of(const std::vector<BallLink>& links) {
  std::string text = "<robot name='r'>";
  for (std::size_t l = 0; l < links.size(); ++l) {
    const std::string name = "l" + std::to_string(l);
    text += "<link name='" + name + "'>";
    for (const OneBall& ball : links[l].balls) {
      char radius[40];
      std::snprintf(radius, sizeof radius, "%.17g", ball.radius);
      text += "<collision><origin xyz='" + text_of(ball.centre) + "'/><geometry><sphere radius='" + radius +
              "'/></geometry></collision>";
    }
    text += "</link>";
    if (l > 0)
      text += "<joint name='j" + std::to_string(l) + "' " + links[l].joint + "<parent link='l" +
              std::to_string(links[l].parent) + "'/><child link='" + name + "'/></joint>";
  }
  return text + "</robot>";
}

}  // namespace

std::string turning(const Vec3d& at, const Vec3d& axis) {
  return "type='continuous'><origin xyz='" + text_of(at) + "'/><axis xyz='" + text_of(axis) + "'/>";
}

std::string sliding(const Vec3d& at, const Vec3d& axis, double lower, double upper) {
  return "type='prismatic'><origin xyz='" + text_of(at) + "'/><axis xyz='" + text_of(axis) + "'/><limit lower='" +
         std::to_string(lower) + "' upper='" + std::to_string(upper) + "'/>";
}

test::RealVec point_of(const test::RealFrame& X, const Vec3d& p) {
  return (X * test::real_shift(p.x, p.y, p.z)).t;
}

double distance_of(const test::RealVec& a, const test::RealVec& b) {
  test::Real sum = 0;
  for (int k = 0; k < 3; ++k) sum += (a.x[k] - b.x[k]) * (a.x[k] - b.x[k]);
  return static_cast<double>(test::Real(sqrt(sum)));
}

BallScene::BallScene(const std::vector<BallLink>& links, engine::RobotOptions options) {
  const TemporaryFolder folder;
  options.urdf = folder.write("r.urdf", urdf_of(links));
  options.home.emplace();
  options.is_static = true;
  scene_.add_robot("r", options);
  for (std::size_t l = 0; l < links.size(); ++l) keep(link(l), links[l].balls);
}

void BallScene::keep(std::uint32_t body, const Balls& balls, double (*from)(const Vec3d&)) {
  balls_.resize(std::max<std::size_t>(balls_.size(), body + 1));
  uncertainty_.resize(balls_.size(), 0);
  distance_.resize(balls_.size(), nullptr);
  distance_[body] = from;
  balls_[body] = balls;
  const Body& b = scene_.bodies()[body];
  for (OneBall& ball : balls_[body]) ball.radius += b.padding + b.uncertainty.position;
}

std::uint32_t BallScene::add(const Balls& balls, Body body) {
  body.name = "body" + std::to_string(scene_.bodies().size());
  for (const OneBall& ball : balls) body.parts.push_back(make_convex_part(std::vector{ball.centre}, ball.radius));
  const std::uint32_t id = scene_.add_body(std::move(body));
  keep(id, balls);
  return id;
}

std::uint32_t BallScene::add_obstacle(const Balls& balls, const Pose& X, const Uncertainty& uncertainty) {
  Body body;
  body.pose = X;
  body.is_static = true;
  body.uncertainty = uncertainty;
  return add(balls, std::move(body));
}

std::uint32_t BallScene::add_tool(const Balls& balls, const std::string& link, const Pose& X) {
  Body body;
  body.parent = scene_.find_body(link);
  body.pose = X;
  const std::uint32_t id = add(balls, std::move(body));
  uncertainty_[id] = scene_.bodies()[scene_.find_body(link)].uncertainty.position;
  return id;
}

std::uint32_t BallScene::add_shape(const NearShape& shape, const Pose& X, const std::string& link) {
  Body body = shape.body;
  body.name = "body" + std::to_string(scene_.bodies().size());
  body.pose = X;
  body.is_static = link.empty();
  if (!link.empty()) body.parent = scene_.find_body(link);
  const std::uint32_t id = scene_.add_body(std::move(body));
  keep(id, {}, shape.distance);
  if (!link.empty()) uncertainty_[id] = scene_.bodies()[scene_.find_body(link)].uncertainty.position;
  return id;
}

std::vector<test::RealFrame> BallScene::frames(std::span<const double> positions) const {
  const SceneRobot& robot = *scene_.robots()[0];
  const Pose roots[] = {*scene_.bodies()[robot.base].pose};
  const auto links = test::real_links(robot.model, positions.data(), robot.kinematics.roots(), roots);
  std::vector<test::RealFrame> frames;
  for (const Body& body : scene_.bodies()) {
    if (body.robot != kNone)
      frames.push_back(links[body.link]);
    else if (body.parent != kNone)
      frames.push_back(frames[body.parent] * test::real_frame(*body.pose));
    else
      frames.push_back(test::real_frame(*body.pose));
  }
  return frames;
}

double BallScene::to_shape(std::uint32_t body, std::uint32_t shape, std::span<const test::RealFrame> frames) const {
  const test::RealFrame X = test::real_inverse(frames[shape]) * frames[body];
  double least = HUGE_VAL;
  for (const OneBall& ball : balls_[body]) {
    const test::RealVec p = point_of(X, ball.centre);
    const Vec3d rounded{double(p.x[0]), double(p.x[1]), double(p.x[2])};
    least = std::min(least, distance_[shape](rounded) - ball.radius);
  }
  return least;
}

double BallScene::distance(BodyPair pair, std::span<const test::RealFrame> frames) const {
  if (distance_[pair.a]) return to_shape(pair.b, pair.a, frames);
  if (distance_[pair.b]) return to_shape(pair.a, pair.b, frames);
  struct Placed {
    test::RealVec exact;
    Vec3d rounded;
    double radius;
  };
  const auto placed = [&](std::uint32_t body) {
    std::vector<Placed> all;
    for (const OneBall& ball : balls_[body]) {
      const test::RealVec p = point_of(frames[body], ball.centre);
      all.push_back({p, {double(p.x[0]), double(p.x[1]), double(p.x[2])}, ball.radius});
    }
    return all;
  };
  const std::vector<Placed> of_a = placed(pair.a), of_b = placed(pair.b);
  double least = HUGE_VAL;
  for (const Placed& a : of_a)
    for (const Placed& b : of_b) {
      constexpr double kRounding = 1e-6;  // metres, far above that of coordinates
      if (norm(a.rounded - b.rounded) - a.radius - b.radius > least + kRounding) continue;
      least = std::min(least, distance_of(a.exact, b.exact) - a.radius - b.radius);
    }
  return least;
}

}  // namespace clearance::exact
