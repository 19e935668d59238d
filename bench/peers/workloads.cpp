#include "bench/peers/workloads.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "bench/peers/contender.h"
#include "engine/base/digest.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/hull.h"
#include "engine/hull/shapes.h"
#include "tests/oracle/cases/random_motion.h"

namespace clearance {

namespace {

using peers::Kind;
using peers::Problem;
using Random = PortableRandom;

constexpr double kRadius = 2;                        // of the spheres, in metres
constexpr double kNearest = 4.05, kFarthest = 8.05;  // distances between centres of separated pairs
constexpr std::uint64_t kExactValues = 20'000;       // approximate number of exact distances per workload
const double kNan = std::numeric_limits<double>::quiet_NaN();

std::array<double, 7> row(const Pose& X) {
  return {X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz};
}

peers::Shape shape_of(const std::vector<Vec3d>& vertices, const std::vector<Triangle>& triangles, double radius) {
  peers::Shape s;
  for (const Vec3d& v : vertices) s.vertices.push_back({v.x, v.y, v.z});
  s.triangles = triangles;
  s.radius = radius;
  return s;
}

// Replaces a cylinder by the prism around it, for peers that support hulls only.
ConvexPartPtr with_prism(const ConvexPartPtr& part) {
  if (!part->primitive || part->primitive->kind != Primitive::Kind::kCylinder) return part;
  const Vec3d& size = part->primitive->size;
  return geometry_of_shape(make_cylinder(size.x, 2 * size.z), part->radius, "cylinder").parts[0];
}

Problem of_spheres(int resolution, Kind kind) {
  const Shape sphere = make_uv_sphere(kRadius, resolution);
  Problem p;
  p.kind = kind;
  p.shapes.push_back(shape_of(sphere.vertices, sphere.triangles, 0));
  return p;
}

void add_pair(Problem& p, const Pose& X_wa, const Pose& X_wb) {
  const auto a = static_cast<std::uint32_t>(p.bodies.size());
  p.bodies.insert(p.bodies.end(), {{0}, {0}});
  p.poses.push_back(row(X_wa)), p.poses.push_back(row(X_wb));
  p.pairs.push_back({a, a + 1});
}

/// Random rotations, with centres at random distances drawn from `distance`.
template <class Distance>
Problem pairs_of_spheres(Random& random, int resolution, int count, Kind kind, Distance distance) {
  Problem p = of_spheres(resolution, kind);
  for (int i = 0; i < count; ++i) {
    const Pose X_wa = random.pose({20, 20, 20});
    Pose X_wb = random.pose({0, 0, 0});
    X_wb.translation = X_wa.translation + direction(random) * distance();
    add_pair(p, X_wa, X_wb);
  }
  return p;
}

/// Moves every body by half a percent of its radius and 0.01 rad per step.
void move(Problem& p, Random& random, std::uint64_t steps) {
  const std::size_t count = p.bodies.size();
  std::vector<Vec3d> drift, axis;
  for (std::size_t b = 0; b < count; ++b) drift.push_back(direction(random) * 0.01), axis.push_back(direction(random));
  for (std::uint64_t k = 1; k < steps; ++k)
    for (std::uint32_t b = 0; b < count; ++b) {
      Pose X = compose(pose_of(p, 0, b), turn(axis[b], 0.01 * static_cast<double>(k)));
      X.translation += drift[b] * static_cast<double>(k);
      p.poses.push_back(row(X));
    }
  p.configurations = steps;
}

/// Moves each pair to a distance of `gap`, according to the engine's own answers.
void set_gaps(Problem& p, double gap) {
  engine::Engine engine(scene_of(p, 0));
  const std::vector<BodyPair> pairs = pairs_of(p);
  std::vector<double> distance(pairs.size()), normal(3 * pairs.size());
  for (int round = 0; round < 4; ++round) {
    QueryView query;
    query.all_pairs = false;
    query.pairs = pairs;
    query.rel_tol = 0;
    query.fields = kFieldDistance | kFieldNormal;
    ReplyView reply;
    reply.distance = distance.data(), reply.normal = normal.data();
    Job job = engine.start(query, reply);
    while (!job.advance()) {
    }
    std::vector<BodyPose> poses;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      auto& pose = p.poses[pairs[i].b];
      for (std::size_t k = 0; k < 3; ++k) pose[k] += normal[3 * i + k] * (gap - distance[i]);
      poses.push_back({pairs[i].b, pose_of(p, 0, pairs[i].b)});
    }
    engine.set_poses(poses);
  }
}

double reach(const Problem& p, std::uint32_t body) {
  double most = 0;
  for (const std::uint32_t s : p.bodies[body])
    for (const peers::Point& v : p.shapes[s].vertices)
      most = std::max(most, std::hypot(v[0], v[1], v[2]) + p.shapes[s].radius);
  return most;
}

void add_scales(Problem& p) {
  std::vector<double> reaches;
  for (std::uint32_t b = 0; b < p.bodies.size(); ++b) reaches.push_back(reach(p, b));
  for (std::uint64_t k = 0; k < p.configurations; ++k)
    for (const auto& [a, b] : p.pairs)
      p.scale.push_back(norm(pose_of(p, k, b).translation - pose_of(p, k, a).translation) + reaches[a] + reaches[b]);
}

/// Computes the reference backend's distances of every n-th pair, or of every pair in every n-th configuration.
void add_exact_distances(Problem& p) {
  engine::Engine::Options options;
  options.backend = "reference";
  engine::Engine engine(scene_of(p, 0), options);
  const std::vector<BodyPair> all = pairs_of(p);
  p.exact_value.assign(p.configurations * all.size(), kNan);
  const std::uint64_t stride = 1 + p.exact_value.size() / kExactValues;
  const std::uint64_t every_k = p.configurations > 1 ? std::min(stride, (p.configurations + 3) / 4) : 1;
  const std::uint64_t every_pair = p.configurations > 1 ? 1 : stride;
  std::vector<BodyPair> pairs;
  for (std::size_t i = 0; i < all.size(); i += every_pair) pairs.push_back(all[i]);
  std::vector<double> lower(pairs.size()), upper(pairs.size());
  for (std::uint64_t k = 0; k < p.configurations; k += every_k) {
    std::vector<BodyPose> poses;
    for (std::uint32_t b = 0; b < p.bodies.size(); ++b) poses.push_back({b, pose_of(p, k, b)});
    engine.set_poses(poses);
    QueryView query;
    query.all_pairs = false;
    query.pairs = pairs;
    query.rel_tol = 0;
    query.signed_distance = p.kind == Kind::kDepth;
    query.fields = kFieldLower | kFieldUpper;
    ReplyView reply;
    reply.lower = lower.data(), reply.upper = upper.data();
    Job job = engine.start(query, reply);
    while (!job.advance()) {
    }
    for (std::size_t i = 0; i < pairs.size(); ++i)
      p.exact_value[k * all.size() + i * every_pair] = (lower[i] + upper[i]) / 2;
  }
}

/// Replaces the distances of each configuration by the least one.
void keep_least(Problem& p) {
  const std::size_t pairs = p.pairs.size();
  std::vector<double> exact_value, scale;
  for (std::uint64_t k = 0; k < p.configurations; ++k) {
    const auto begin = p.exact_value.begin() + static_cast<std::ptrdiff_t>(k * pairs);
    const auto least = std::min_element(begin, begin + static_cast<std::ptrdiff_t>(pairs));  // all NaN, or none
    exact_value.push_back(*least);
    scale.push_back(p.scale[static_cast<std::size_t>(least - p.exact_value.begin())]);
  }
  p.exact_value = std::move(exact_value), p.scale = std::move(scale);
  p.kind = Kind::kLeast;
}

/// A distance within which about a twentieth of the pairs lie.
double near_share(const Problem& p) {
  std::vector<double> known;
  for (const double t : p.exact_value)
    if (!std::isnan(t)) known.push_back(t);
  const auto twentieth = known.begin() + static_cast<std::ptrdiff_t>(known.size() / 20);
  std::nth_element(known.begin(), twentieth, known.end());
  // Between two known distances, so that no checked pair lies exactly at the limit.
  return (*twentieth + *std::min_element(twentieth + 1, known.end())) / 2;
}

Problem make_cell(const std::string& scenes, const LinkPoses& links) {
  const engine::Scene scene = engine::Scene::load(scenes + "/cell/scene.yaml");
  Problem p;
  std::map<const ConvexPart*, std::uint32_t> shapes;
  for (const Body& body : scene.bodies()) {
    auto& mine = p.bodies.emplace_back();
    for (const ConvexPartPtr& part : body.parts) {
      const auto [at, fresh] = shapes.try_emplace(part.get(), static_cast<std::uint32_t>(p.shapes.size()));
      if (fresh) {
        std::vector<Triangle> faces;
        const ConvexPartPtr hull = with_prism(part);
        make_hull_part(hull->vertices, {}, hull->radius, 0, true, &faces);
        p.shapes.push_back(shape_of(hull->vertices, faces, hull->radius));
      }
      mine.push_back(at->second);
    }
  }
  p.configurations = links.poses.size() / links.names.size();
  std::vector<bool> moved(scene.bodies().size());
  for (std::uint64_t k = 0; k < p.configurations; ++k) {
    std::vector<Pose> world;
    for (std::uint32_t b = 0; b < scene.bodies().size(); ++b) {
      const Body& body = scene.bodies()[b];
      const auto link = std::find(links.names.begin(), links.names.end(), body.name) - links.names.begin();
      if (static_cast<std::size_t>(link) < links.names.size()) {
        const auto& x = links.poses[k * links.names.size() + static_cast<std::size_t>(link)];
        world.push_back({{x[0], x[1], x[2]}, x[3], x[4], x[5], x[6]});
        moved[b] = !body.is_static;
      } else if (body.parent != kNone) {
        world.push_back(compose(world[body.parent], *body.pose));
        moved[b] = moved[body.parent];
      } else {
        world.push_back(*body.pose);
      }
      p.poses.push_back(row(world.back()));
    }
  }
  for (const BodyPair& pair : engine::Engine(scene).pairs({}))
    if (moved[pair.a] || moved[pair.b]) p.pairs.push_back({pair.a, pair.b});
  return p;
}

Problem make(const std::string& name, const std::string& scenes, const LinkPoses& links) {
  Digest digest;
  digest.add(std::string_view(name == "cut" || name == "within" ? "all_pairs" : name));
  Random random(digest.value());
  const auto apart = [&] { return random.uniform(kNearest, kFarthest); };
  const auto overlapping = [&] { return random.uniform(0.5, 3.8); };
  if (name == "separated_42") return pairs_of_spheres(random, 5, 20'000, Kind::kDistance, apart);
  if (name == "separated_1202") return pairs_of_spheres(random, 25, 5000, Kind::kDistance, apart);
  if (name == "separated_19802") return pairs_of_spheres(random, 100, 1000, Kind::kDistance, apart);
  if (name == "depth_42") return pairs_of_spheres(random, 5, 4000, Kind::kDepth, overlapping);
  if (name == "depth_1202") return pairs_of_spheres(random, 25, 500, Kind::kDepth, overlapping);
  if (name == "cell" || name == "cell_least") return make_cell(scenes, links);
  if (name == "gap_1mm_42" || name == "gap_1mm_1202") {
    const bool small = name == "gap_1mm_42";
    Problem p = pairs_of_spheres(random, small ? 5 : 25, small ? 10'000 : 2000, Kind::kDistance, [] { return 4.05; });
    set_gaps(p, 1e-3);
    return p;
  }
  if (name == "motion_42" || name == "motion_1202" || name == "motion_19802") {
    const bool small = name == "motion_42", large = name == "motion_19802";
    Problem p = pairs_of_spheres(random,
                                 small   ? 5
                                 : large ? 100
                                         : 25,
                                 small   ? 500
                                 : large ? 40
                                         : 200,
                                 Kind::kMotion, [&] { return random.uniform(5.05, 9.05); });
    move(p, random, 50);
    return p;
  }
  if (name == "two_2M") {
    Problem p = of_spheres(1000, Kind::kDistance);
    add_pair(p, random.pose({0, 0, 0}), random.pose({0, 0, 0}));
    for (int k = 1; k < 500; ++k)
      p.poses.push_back(row(random.pose({0, 0, 0}))), p.poses.push_back(row(random.pose({0, 0, 0})));
    for (std::size_t k = 1; k < p.poses.size(); k += 2) {
      const Vec3d t = direction(random) * apart();
      p.poses[k][0] = t.x, p.poses[k][1] = t.y, p.poses[k][2] = t.z;
    }
    p.configurations = p.poses.size() / 2;
    return p;
  }
  if (name == "all_pairs" || name == "cut" || name == "within") {
    Problem p = of_spheres(5, Kind::kDistance);
    for (std::uint32_t i = 0; i < 1000; ++i) {
      p.bodies.push_back({0});
      p.poses.push_back(row(random.pose({100, 100, 100})));
      for (std::uint32_t j = i + 1; j < 1000; ++j) p.pairs.push_back({i, j});
    }
    return p;
  }
  throw std::invalid_argument("there is no workload \"" + name + "\"");
}

}  // namespace

const std::vector<Workload>& workloads() {
  static const std::vector<Workload> kWorkloads = {
      {"all_pairs", "1000 spheres of 42 vertices, all pairs"},
      {"cut", "the same with max_distance, 95 % of pairs farther"},
      {"within", "the same, only those within it as a list"},
      {"separated_42", "separated pairs, 42 vertices"},
      {"separated_1202", "separated pairs, 1202 vertices"},
      {"separated_19802", "separated pairs, 19,802 vertices"},
      {"gap_1mm_42", "1 mm apart, 42 vertices"},
      {"gap_1mm_1202", "1 mm apart, 1202 vertices"},
      {"motion_42", "coherent motion, 42 vertices"},
      {"motion_1202", "coherent motion, 1202 vertices"},
      {"motion_19802", "coherent motion, 19,802 vertices"},
      {"two_2M", "two spheres of 1,998,002 vertices"},
      {"cell", "robot cell, 4096 configurations, enabled pairs"},
      {"cell_least", "the same, only the nearest pair of each configuration (time for each)"},
      {"depth_42", "penetration depth, 42 vertices"},
      {"depth_1202", "penetration depth, 1202 vertices"},
  };
  return kWorkloads;
}

Problem make_workload(const std::string& name, const std::string& scenes, const LinkPoses& links) {
  Problem p = make(name, scenes, links);
  add_exact_distances(p);
  add_scales(p);
  if (name == "cut" || name == "within") p.max_distance = near_share(p);
  if (name == "within") p.kind = Kind::kWithin;
  if (name == "cell_least") keep_least(p);
  return p;
}

Problem make_class_problem(const exact::CaseClass& c, std::uint64_t seed, int count) {
  Problem p;
  p.kind = Kind::kDepth;
  std::map<const exact::Solid*, std::uint32_t> shapes;
  const auto add = [&](const exact::SolidPtr& solid, const Pose& X) {
    const auto [at, fresh] = shapes.try_emplace(solid.get(), static_cast<std::uint32_t>(p.shapes.size()));
    if (fresh) {
      std::vector<Triangle> faces;
      const ConvexPartPtr part = make_hull_part(solid->vertices, {}, solid->radius, 0, false, &faces);
      const auto same = [](const Vec3d& v, const Vec3d& w) { return v.x == w.x && v.y == w.y && v.z == w.z; };
      for (Triangle& face : faces)  // from indices of kept vertices to those of given ones
        for (std::uint32_t& i : face)
          i = static_cast<std::uint32_t>(std::find_if(solid->vertices.begin(), solid->vertices.end(),
                                                      [&](const Vec3d& v) { return same(v, part->vertices[i]); }) -
                                         solid->vertices.begin());
      p.shapes.push_back(shape_of(solid->vertices, faces, solid->radius));
    }
    p.bodies.push_back({at->second});
    p.poses.push_back(row(X));
    return static_cast<std::uint32_t>(p.bodies.size() - 1);
  };
  std::vector<exact::Case> kept;  // keeps shapes alive, so that no two have the same address
  for (int i = 0; i < count; ++i) {
    kept.push_back(exact::make_case(c, seed, static_cast<std::uint64_t>(i)));
    const std::uint32_t a = add(kept.back().a, kept.back().X_wa), b = add(kept.back().b, kept.back().X_wb);
    p.pairs.push_back({a, b});
    p.exact_value.push_back(exact::exact_answer(kept.back()).distance.lower());
  }
  add_scales(p);
  return p;
}

}  // namespace clearance
