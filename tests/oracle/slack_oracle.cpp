#include "tests/oracle/slack_oracle.h"

#include <algorithm>
#include <cmath>

#include "engine/engine.h"
#include "engine/geometry/make_geometry.h"
#include "engine/state/pose_store.h"

namespace clearance::exact {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct Row {
  double lower, upper;
  Status status;
  std::uint16_t flags;
};

// Lanes take a single pair only if they are few, so that all their code is tested on every machine. The bits are the
// same.
const engine::Engine::Options kFewLanes{.instruction_set = "baseline", .covers = engine::Covers::kOff};

std::vector<Row> evaluate(const engine::Engine& engine, QueryView query) {
  query.fields = kDefaultFields | kFieldFlags;
  const QuerySize size = engine.size(query);
  std::vector<double> distance(size.rows), lower(size.rows), upper(size.rows);
  std::vector<std::uint8_t> status(size.rows);
  std::vector<std::uint16_t> flags(size.rows);
  ReplyView reply;
  reply.distance = distance.data(), reply.lower = lower.data(), reply.upper = upper.data();
  reply.status = status.data(), reply.flags = flags.data();
  Job job = engine.start(query, reply);
  while (!job.advance()) {
  }
  std::vector<Row> rows;
  for (std::size_t i = 0; i < job.info().rows; ++i)
    rows.push_back({lower[i], upper[i], static_cast<Status>(status[i]), flags[i]});
  return rows;
}

Row request_one(const engine::Engine& engine, double max_distance = kInf, bool depth = false,
                Reduce reduce = Reduce::kNone) {
  QueryView query;
  query.max_distance = max_distance;
  query.signed_distance = depth;
  query.reduce = reduce;
  const std::vector<Row> rows = evaluate(engine, query);
  return rows.empty() ? Row{kInf, kInf, Status::kBeyond, 0} : rows.at(0);
}

// \param exact_value the exact distance, or the least of samples, for which `exact` is false and `upper` is not tested
void hold(const Row& row, const Value& exact_value, bool exact, Findings& findings, double max_distance = kInf) {
  ++findings.requested;
  const bool clipped = exact_value.compare(0.0) < 0;  // bounds are those of an unsigned distance
  const double least = clipped ? 0 : exact_value.upper();
  findings.misses += row.lower > least || (exact && !clipped && row.upper < exact_value.lower());
  findings.untrue += (row.status == Status::kBeyond && exact_value.compare(max_distance) <= 0) ||
                     (row.status == Status::kOk && exact_value.compare(0.0) <= 0) ||
                     (exact && row.status == Status::kOverlap && exact_value.compare(0.0) > 0);
}

SolidPtr cloud(Random& random, int count, double size, double radius = 0) {
  auto solid = std::make_shared<Solid>();
  for (int i = 0; i < count; ++i) solid->vertices.push_back(random.direction() * random.uniform(0.3 * size, size));
  solid->radius = radius;
  return solid;
}

Body body_of(const std::string& name, const SolidPtr& solid, const Pose& X) {
  Body body;
  body.name = name;
  body.parts = {make_convex_part(solid->vertices, solid->radius)};
  body.pose = X;
  return body;
}

// q rotated by an angle about an axis of the world, in doubles.
Pose turned(const Pose& X, const Vec3d& axis, double angle) {
  const double c = std::cos(0.5 * angle), s = std::sin(0.5 * angle);
  const double x = s * axis.x, y = s * axis.y, z = s * axis.z;
  return {X.translation, c * X.qw - x * X.qx - y * X.qy - z * X.qz, c * X.qx + x * X.qw + y * X.qz - z * X.qy,
          c * X.qy - x * X.qz + y * X.qw + z * X.qx, c * X.qz + x * X.qy - y * X.qx + z * X.qw};
}

// One of the placements that an uncertainty allows: mostly at its edge, and slightly inside to cover the sample's own
// rounding.
Pose allowed(Random& random, const Pose& X, const Uncertainty& u, const Vec3d& towards) {
  constexpr double kWithin = 1 - 1e-12;
  Pose Y = turned(X, random.direction(), u.angle * kWithin * (random.chance(0.7) ? 1 : random.uniform()));
  const Vec3d way = random.chance(0.5) ? towards : random.direction();
  Y.translation +=
      way * (u.position * kWithin / std::max(norm(way), 1e-300) * (random.chance(0.7) ? 1 : random.uniform()));
  return Y;
}

engine::Scene scene_of(const Case& c, const Uncertainty& of_a, const Uncertainty& of_b, double padding) {
  engine::Scene scene;
  Body a = body_of("a", c.a, c.X_wa), b = body_of("b", c.b, c.X_wb);
  a.uncertainty = of_a, b.uncertainty = of_b;
  a.padding = padding;
  scene.add_body(std::move(a));
  scene.add_body(std::move(b));
  return scene;
}

}  // namespace

void try_uncertain(Random& random, Findings& findings) {
  const Uncertainty of_a{random.chance(0.5) ? 0.01 : 0.0, random.uniform(0.0, 0.2)},
      of_b{random.chance(0.5) ? 0.02 : 0.0, random.chance(0.5) ? random.uniform(0.0, 0.4) : 0.0};
  const double padding = random.chance(0.3) ? 0.015625 : 0;  // exact in all sums
  Case c{cloud(random, 12, 0.5), cloud(random, 20, 0.4), random.rotation({0, 0, 0}), {}};
  c.X_wb = random.rotation(random.direction() * random.uniform(0.5, 2.0));
  const engine::Engine engine(scene_of(c, of_a, of_b, padding), kFewLanes);
  const Row row = request_one(engine);
  // The nominal placement is allowed, and the free position and padding are the radius': the exact distance of the
  // grown nominal parts bounds the least from above.
  Case nominal = c;
  auto grown = [](const SolidPtr& s, double by) {
    auto out = std::make_shared<Solid>(*s);
    out->radius += by;
    return out;
  };
  nominal.a = grown(c.a, of_a.position + padding);
  nominal.b = grown(c.b, of_b.position);
  const Value at_most = exact_answer(nominal).distance;
  findings.misses += at_most.compare(0.0) > 0 && row.upper < at_most.lower();
  // The least of the samples of allowed placements is at least the least of all.
  const Result here = exact_answer(c);
  const Vec3d way{here.direction.x.get_d(), here.direction.y.get_d(), here.direction.z.get_d()};
  const double bounds[] = {kInf, 0.5 * std::max(row.lower + row.upper, 0.0)};
  std::vector<Row> rows;
  for (const double max_distance : bounds) rows.push_back(request_one(engine, max_distance));
  rows.push_back(request_one(engine, bounds[1], false, Reduce::kMin));
  rows.push_back(request_one(engine, bounds[1], false, Reduce::kWithin));
  for (int k = 0; k < 12; ++k) {
    Case sample = c;
    sample.X_wa = allowed(random, c.X_wa, of_a, way);
    sample.X_wb = allowed(random, c.X_wb, of_b, way * -1.0);
    auto padded = std::make_shared<Solid>(*c.a);
    padded->radius = padding;
    sample.a = padded;
    const Value exact_value = exact_answer(sample).distance;
    hold(rows[0], exact_value, false, findings);
    for (std::size_t i = 1; i < rows.size(); ++i) hold(rows[i], exact_value, false, findings, bounds[1]);
  }
  // The width is that of its slack and the tolerance, and no more. Rounding is far below.
  const double turn = 2 * std::sin(0.5 * of_a.angle) * (reach(*c.a) + of_a.position + padding) +
                      2 * std::sin(0.5 * of_b.angle) * (reach(*c.b) + of_b.position);
  if (row.lower > 0) {
    const double wanted = turn + 1e-6 * (row.upper + turn) + 1e-12;
    findings.wide += row.upper - row.lower > wanted * (1 + 1e-9);
    findings.unresolved += row.status == Status::kUnconverged;
    findings.untrue += turn > 1e-5 * row.upper && !(row.flags & kFlagUncertaintyLimited);
  }
}

void try_shapes(Random& random, bool depth, Findings& findings) {
  const double h = random.log_uniform(1e-9, 1e-2);
  Case exact_value{cloud(random, 10, 0.5), cloud(random, 16, 0.4), random.rotation({0, 0, 0}), {}};
  exact_value.X_wb = random.rotation({0, 0, 0});
  exact_value.X_wb.translation = random.direction();
  set_gap(exact_value, h * random.uniform(-4, 6));
  engine::Scene scene;
  const auto add = [&](const char* name, const Solid& solid, const Pose& X) {
    Body body;
    body.name = name;
    std::vector<Vec3d> v = solid.vertices;
    for (Vec3d& x : v) x += random.direction() * (h * (1 - 1e-9) * random.uniform());
    body.parts = {make_convex_part(std::move(v), solid.radius)};
    body.model_error = body.model_inner = h;
    body.pose = X;
    scene.add_body(std::move(body));
  };
  add("a", *exact_value.a, exact_value.X_wa);
  add("b", *exact_value.b, exact_value.X_wb);
  const engine::Engine engine(std::move(scene), kFewLanes);
  const Value exact = exact_answer(exact_value).distance;
  for (const double max_distance : {kInf, 2 * h}) {
    const Row row = request_one(engine, max_distance, depth);
    if (depth) {
      ++findings.requested;
      findings.misses += exact.compare(row.lower) < 0 || exact.compare(row.upper) > 0;
      findings.untrue += (row.status == Status::kOk && exact.compare(0.0) <= 0) ||
                         (row.status == Status::kOverlap && exact.compare(0.0) > 0);
    } else {
      hold(row, exact, true, findings, max_distance);
    }
    if (row.status != Status::kBeyond)
      findings.wide +=
          row.upper - row.lower > 4 * h + 1e-6 * std::max(std::abs(row.lower), std::abs(row.upper)) + 1e-12;
  }
}

namespace {

using Real = long double;
struct Vec3l {
  Real x, y, z;
};

// R^T (p - t) of a pose whose rotation is M(q) / |q|^2.
Vec3l into(const Pose& X, const Vec3d& p) {
  const Real w = X.qw, x = X.qx, y = X.qy, z = X.qz, n = w * w + x * x + y * y + z * z;
  const Vec3l d{Real(p.x) - X.translation.x, Real(p.y) - X.translation.y, Real(p.z) - X.translation.z};
  return {((w * w + x * x - y * y - z * z) * d.x + 2 * (x * y + w * z) * d.y + 2 * (x * z - w * y) * d.z) / n,
          (2 * (x * y - w * z) * d.x + (w * w - x * x + y * y - z * z) * d.y + 2 * (y * z + w * x) * d.z) / n,
          (2 * (x * z + w * y) * d.x + 2 * (y * z - w * x) * d.y + (w * w - x * x - y * y + z * z) * d.z) / n};
}

// A cylinder as a robot's link, or as a scene's body.
std::uint32_t add_cylinder(engine::Scene& scene, CylinderAs as, const std::string& name, double r, double length,
                           const Pose& pose) {
  engine::Scene::BodyOptions at;
  at.pose = pose;
  if (as == CylinderAs::kItself) return scene.add_cylinder(name, r, length, at);
  const Geometry prism = geometry_of_shape(make_cylinder(r, length), 0, "cylinder");
  Body body;
  body.name = name;
  body.parts = prism.parts;
  body.model_error = prism.model_error;
  body.source = prism.source;
  body.pose = pose;
  return scene.add_body(std::move(body));
}

}  // namespace

bool try_cylinder(Random& random, CylinderAs as, Findings& findings) {
  const double r = random.log_uniform(0.01, 10), half = 0.5 * r * random.log_uniform(0.1, 10), ball = 0.25 * r;
  const Pose X = random.rotation(random.direction() * 3.0);
  Pose Y;
  Y.translation = X.translation + random.direction() * random.uniform(0.1 * r, 3 * (r + half));
  engine::Scene scene;
  const std::uint32_t cylinder = add_cylinder(scene, as, "cylinder", r, 2 * half, X);
  engine::Scene::BodyOptions at;
  at.pose = Y;
  scene.add_sphere("ball", ball, at);
  const double outer = scene.bodies()[cylinder].model_error;
  const engine::Engine engine(std::move(scene), kFewLanes);
  const Vec3l p = into(X, Y.translation);
  const Real side = std::sqrt(p.x * p.x + p.y * p.y) - Real(r), end = std::abs(p.z) - Real(half);
  const Real apart = side > 0 && end > 0 ? std::sqrt(side * side + end * end) : std::max(side, end);
  const Real exact_value = apart - Real(ball), error = 1e-17L * (8 + 4 * Real(r + half));
  const Row plain = request_one(engine), deep = request_one(engine, kInf, true);
  ++findings.requested;
  if (exact_value > 0) findings.misses += plain.lower > exact_value + error || plain.upper < exact_value - error;
  findings.misses += deep.lower > exact_value + error || deep.upper < exact_value - error;
  findings.untrue += (plain.status == Status::kOk && exact_value < -error) ||
                     (plain.status == Status::kOverlap && exact_value > error);
  if (exact_value < -3 * Real(outer) - error) findings.unresolved += plain.status != Status::kOverlap;
  if (outer == 0 && exact_value > 0.01L * Real(r)) findings.wide += plain.upper - plain.lower > 1e-6 * plain.upper;
  return exact_value > 0 && plain.upper - Real(outer) < exact_value - error;
}

void try_crossed_cylinders(Random& random, CylinderAs as, Findings& findings) {
  engine::Scene scene;
  add_cylinder(scene, as, "a", 0.3, 1, random.rotation());
  add_cylinder(scene, as, "b", 0.3, 1, random.rotation(random.direction() * random.uniform(0.05, 0.2)));
  const engine::Engine engine(std::move(scene), kFewLanes);
  ++findings.requested;
  findings.unresolved += request_one(engine).status != Status::kOverlap;
}

void try_age(Random& random, Findings& findings) {
  const double speed = random.uniform(1, 10);
  engine::Scene scene;
  engine::Scene::BodyOptions options;
  options.pose = Pose{};
  options.is_static = true;
  options.max_speed = speed;  // a body that never moves has no age
  scene.add_box("wall", {1, 1, 1}, options);
  options.pose.reset();
  options.is_static = false;
  const std::uint32_t box = scene.add_box("box", {1, 1, 1}, options);
  options.parent = "box";
  options.max_speed = 0;
  options.pose = Pose{{0, 5, 0}};
  scene.add_box("cup", {1, 1, 1}, options);  // moves as its parent does
  engine::Engine engine(std::move(scene), kFewLanes);
  findings.untrue += request_one(engine).status != Status::kNoPose;
  const BodyPose poses[] = {{box, Pose{{3, 0, 0}}}};
  const std::int64_t before_set = monotonic_ns();
  engine.set_poses(poses);
  const std::int64_t after_set = monotonic_ns();
  while (monotonic_ns() < after_set + 2'000'000) {
  }
  const BodyPair pairs[] = {{0, box}, {0, 2}};
  QueryView query;
  query.pairs = pairs;
  query.all_pairs = false;
  const std::int64_t before_request = monotonic_ns();
  const std::vector<Row> rows = evaluate(engine, query);
  const std::int64_t after_request = monotonic_ns();
  const double least = speed * 1e-9 * static_cast<double>(before_request - after_set),
               most = speed * 1e-9 * static_cast<double>(after_request - before_set);
  const double exact[] = {2, std::hypot(2.0, 4.0)};
  for (int i = 0; i < 2; ++i) {
    ++findings.requested;
    findings.misses += rows[i].lower > std::max(exact[i] - least, 0.0) || rows[i].upper < exact[i];
    findings.wide += rows[i].lower < exact[i] - most - 1e-9 || rows[i].upper > exact[i] + 1e-9;
    findings.untrue += !(rows[i].flags & kFlagUncertaintyLimited);
  }
  // Boxes at the time of the pose would skip the wall, which may be that near.
  query.max_distance = 2 - 0.5 * least;
  for (const Reduce reduce : {Reduce::kNone, Reduce::kMin, Reduce::kWithin}) {
    query.reduce = reduce;
    const std::vector<Row> near = evaluate(engine, query);
    findings.untrue += near.empty() || near[0].status == Status::kBeyond;
  }
  query.max_distance = kInf;
  query.reduce = Reduce::kNone;
  const std::uint32_t bodies[] = {box};
  const Pose there[] = {Pose{{4, 0, 0}}};
  query.bodies = bodies, query.configurations = there, query.configuration_count = 1;
  for (const Row& row : evaluate(engine, query))
    findings.wide += row.upper - row.lower > 1e-5;  // the query gives its pose
}

}  // namespace clearance::exact
