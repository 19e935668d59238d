#include "bench/tradeoff/scenes.h"

#include <cmath>
#include <stdexcept>

#include "engine/base/digest.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/shapes.h"
#include "tests/oracle/cases/random_motion.h"

namespace clearance::tradeoff {

namespace {

using Random = PortableRandom;

constexpr double kStepShare = 0.01;  // motion of a body per step, relative to its size
constexpr double kStepAngle = 0.01;  // rotation per step, in rad

/// X rotated about a world axis through its own origin.
Pose turned(const Pose& X, const Vec3d& axis, double angle) {
  Pose out = compose(turn(axis, angle), X);
  out.translation = X.translation;
  return out;
}

/// Points on an ellipsoid: a hull with exactly this many vertices.
std::vector<Vec3d> egg(Random& random, int count, double size) {
  const Vec3d half{size * random.uniform(0.6, 1), size * random.uniform(0.6, 1), size * random.uniform(0.6, 1)};
  std::vector<Vec3d> points;
  for (int i = 0; i < count; ++i) {
    const Vec3d d = direction(random);
    points.push_back({half.x * d.x, half.y * d.y, half.z * d.z});
  }
  return points;
}

double size_of(const Body& body) {
  double size = 0;
  for (const ConvexPartPtr& part : body.parts) size = std::max(size, part->spread + part->radius);
  return size;
}

/// Moves and rotates every free body, each in its own way.
void sway(MovingScene& s, Random& random, int steps) {
  s.steps.resize(static_cast<std::size_t>(steps));
  for (std::uint32_t b = 0; b < s.scene.bodies().size(); ++b) {
    const Body& body = s.scene.bodies()[b];
    const Vec3d drift = direction(random) * (kStepShare * size_of(body)), axis = direction(random);
    if (body.is_static || body.parent != kNone || !body.pose) continue;
    for (int i = 0; i < steps; ++i) {
      Pose X = compose(*body.pose, turn(axis, kStepAngle * i));
      X.translation += drift * i;
      s.steps[static_cast<std::size_t>(i)].push_back({b, X});
    }
  }
}

void request_all(MovingScene& s) {
  s.pairs = engine::Engine(s.scene).pairs({});
}

/// Hulls of 20 to 60 vertices in pairs, at least `gap` sizes apart along some direction. They rotate about that
/// direction, and b slides perpendicular to it, so that the gap stays constant.
MovingScene couples(Random& random, int steps, double least_gap, double most_gap) {
  MovingScene s;
  s.steps.resize(static_cast<std::size_t>(steps));
  for (std::uint32_t i = 0; i < 128; i += 2) {
    const double size_a = random.uniform(0.05, 0.3), size_b = random.uniform(0.05, 0.3);
    const std::vector<Vec3d> a = egg(random, 20 + static_cast<int>(40 * random.uniform()), size_a);
    const std::vector<Vec3d> b = egg(random, 20 + static_cast<int>(40 * random.uniform()), size_b);
    const Pose X_wa = random.pose({10, 10, 10});
    Pose X_wb = random.pose({0, 0, 0});
    const Mat3d R_wa = rotation_of(X_wa), R_wb = rotation_of(X_wb);
    const Vec3d n = direction(random);
    double reach = 0, least = 0;
    for (const Vec3d& v : a) reach = std::max(reach, dot(n, R_wa * v));
    for (const Vec3d& v : b) least = std::min(least, dot(n, R_wb * v));
    X_wb.translation = X_wa.translation + n * (reach - least + random.uniform(least_gap, most_gap) * (size_a + size_b));
    engine::Scene::BodyOptions at_a, at_b;
    at_a.pose = X_wa;
    at_b.pose = X_wb;
    s.scene.add_hull("a" + std::to_string(i / 2), a, at_a);
    s.scene.add_hull("b" + std::to_string(i / 2), b, at_b);
    s.pairs.push_back({i, i + 1});
    const Vec3d across = cross(n, direction(random));
    const Vec3d slide = across * (kStepShare * size_b / norm(across));
    const double turn_a = random.uniform(-kStepAngle, kStepAngle), turn_b = random.uniform(-kStepAngle, kStepAngle);
    for (int k = 0; k < steps; ++k) {
      s.steps[static_cast<std::size_t>(k)].push_back({i, turned(X_wa, n, turn_a * k)});
      Pose moved = turned(X_wb, n, turn_b * k);
      moved.translation += slide * k;
      s.steps[static_cast<std::size_t>(k)].push_back({i + 1, moved});
    }
  }
  return s;
}

/// Bodies that rest on boxes at gaps from -1e-9 m to 1e-4 m, and slide over them.
MovingScene touching(Random& random, int steps) {
  constexpr double kGaps[] = {0, 0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, -1e-9};
  MovingScene s;
  s.steps.resize(static_cast<std::size_t>(steps));
  for (std::uint32_t i = 0; i < 128; i += 2) {
    const double edge = random.uniform(0.3, 0.6), size = random.uniform(0.03, 0.1);
    std::vector<Vec3d> top;
    Pose lie;  // pose of the body on top, in the frame of the box's upper face
    if (i / 2 % 4 < 2) {
      top = make_box({size, 0.7 * size, 0.5 * size}).vertices;
      if (i / 2 % 4 == 1) lie = turn({1, 0, 0}, random.uniform(0.1, 1));  // on an edge
    } else {
      top = egg(random, 40, size);  // on a vertex
      lie = random.pose({0, 0, 0});
    }
    const Mat3d R = rotation_of(lie);
    double least = 0;
    for (const Vec3d& v : top) least = std::min(least, (R * v).z);
    lie.translation.z = edge / 2 - least + kGaps[i / 2 / 4 % std::size(kGaps)];
    const Pose X_wa = random.pose({5, 5, 5});
    const double heading = random.uniform(0, 6.28);
    const Vec3d slide{std::cos(heading) * kStepShare * size, std::sin(heading) * kStepShare * size, 0};
    for (int k = 0; k < steps; ++k) {
      Pose moved = lie;
      moved.translation += slide * k;
      s.steps[static_cast<std::size_t>(k)].push_back({i, X_wa});
      s.steps[static_cast<std::size_t>(k)].push_back({i + 1, compose(X_wa, moved)});
    }
    s.scene.add_box("box" + std::to_string(i / 2), {edge, edge, edge}, {});
    s.scene.add_hull("top" + std::to_string(i / 2), top, {});
    s.pairs.push_back({i, i + 1});
  }
  return s;
}

/// `count` bodies in a cube of edge `box`, with all pairs; `add` adds one at a pose.
template <class Add>
MovingScene crowd(Random& random, int steps, int count, double box, Add add) {
  MovingScene s;
  for (int i = 0; i < count; ++i) {
    engine::Scene::BodyOptions at;
    at.pose = random.pose({box, box, box});
    add(s.scene, "body" + std::to_string(i), i, at);
  }
  sway(s, random, steps);
  request_all(s);
  return s;
}

/// The arm of scenes/cell rotates about its base; everything else is fixed.
MovingScene cell(const std::string& folder, int steps) {
  MovingScene s;
  s.scene = engine::Scene::load(folder + "/cell/scene.yaml");
  const Group& arm = s.scene.groups().at(s.scene.find_group("arm"));
  s.steps.resize(static_cast<std::size_t>(steps));
  for (int i = 0; i < steps; ++i)
    for (const std::uint32_t b : arm.bodies) {
      const Body& body = s.scene.bodies()[b];
      if (body.is_static || body.parent != kNone) continue;
      const Pose about_base = turn({0, 0, 1}, kStepAngle * i);  // the base is at x = y = 0
      s.steps[static_cast<std::size_t>(i)].push_back({b, compose(about_base, *body.pose)});
    }
  request_all(s);
  return s;
}

// The same bodies as exactly represented hulls, which the oracle supports: a cylinder becomes its prism. Only the
// effect of refinement is measured; slack is the same for all settings.
engine::Scene as_parts(const engine::Scene& scene) {
  engine::Scene exact;
  for (Body body : scene.bodies()) {
    body.model_error = body.model_inner = 0;
    for (ConvexPartPtr& part : body.parts) part = with_prism(part);
    exact.add_body(std::move(body));
  }
  return exact;
}

}  // namespace

const std::vector<std::string>& scene_names() {
  static const std::vector<std::string> names{"near", "far",      "touching", "dense",    "fine",
                                              "cell", "extremes", "spheres",  "capsules", "boxes"};
  return names;
}

MovingScene make_moving_scene(const std::string& name, const std::string& folder, std::uint64_t seed, int steps) {
  Digest digest;
  digest.add(std::string_view(name));
  digest.add(seed);
  Random random(digest.value());
  const auto in = [&](double low, double high) { return random.uniform(low, high); };
  using Options = engine::Scene::BodyOptions;
  MovingScene s;
  if (name == "near") {
    s = couples(random, steps, 0.01, 0.1);
    s.what = "64 pairs of hulls of 20 to 60 vertices, 1 to 10 % of their size apart";
  } else if (name == "far") {
    s = couples(random, steps, 10, 30);
    s.what = "the same, 10 to 30 sizes apart";
  } else if (name == "touching") {
    s = touching(random, steps);
    s.what = "64 bodies sliding on boxes on a face, an edge or a vertex, gaps from -1e-9 to 1e-4 m";
  } else if (name == "dense") {
    s = crowd(random, steps, 20, 0.9, [&](engine::Scene& scene, const std::string& body, int i, const Options& at) {
      switch (i % 5) {
        case 0:
          scene.add_box(body, {in(0.1, 0.4), in(0.1, 0.4), in(0.1, 0.4)}, at);
          break;
        case 1:
          scene.add_cylinder(body, in(0.05, 0.15), in(0.1, 0.4), at);
          break;
        case 2:
          scene.add_capsule(body, in(0.05, 0.1), in(0.1, 0.4), at);
          break;
        case 3:
          scene.add_uv_sphere(body, in(0.1, 0.2), 12, at);
          break;
        default:
          scene.add_hull(body, egg(random, 100, in(0.1, 0.2)), at);
          break;
      }
    });
    s.what = "20 bodies of every kind packed into 0.9 m, all pairs; some overlap";
  } else if (name == "fine") {
    s = crowd(random, steps, 12, 4, [&](engine::Scene& scene, const std::string& body, int, const Options& at) {
      scene.add_hull(body, egg(random, 3000, in(0.3, 0.6)), at);
    });
    s.what = "12 hulls of 3000 vertices, all pairs";
  } else if (name == "cell") {
    s = cell(folder, steps);
    s.what = "scenes/cell: the arm turns about its base, all enabled pairs";
  } else if (name == "extremes") {
    s.scene = engine::Scene::load(folder + "/extremes/scene.yaml");
    sway(s, random, steps);
    request_all(s);
    s.what = "scenes/extremes: tiny, huge, flat, thin and far bodies, all pairs";
  } else if (name == "spheres") {
    s = crowd(random, steps, 16, 2, [&](engine::Scene& scene, const std::string& body, int, const Options& at) {
      scene.add_sphere(body, in(0.05, 0.3), at);
    });
    s.what = "16 spheres, all pairs";
  } else if (name == "capsules") {
    s = crowd(random, steps, 16, 2, [&](engine::Scene& scene, const std::string& body, int, const Options& at) {
      scene.add_capsule(body, in(0.05, 0.1), in(0.1, 0.6), at);
    });
    s.what = "16 capsules, all pairs";
  } else if (name == "boxes") {
    s = crowd(random, steps, 16, 2, [&](engine::Scene& scene, const std::string& body, int, const Options& at) {
      scene.add_box(body, {in(0.1, 0.5), in(0.1, 0.5), in(0.1, 0.5)}, at);
    });
    s.what = "16 boxes, all pairs";
  } else {
    throw std::invalid_argument("there is no scene \"" + name + "\" in the sweep");
  }
  s.name = name;
  s.scene = as_parts(s.scene);
  return s;
}

}  // namespace clearance::tradeoff
