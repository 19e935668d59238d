#include "engine/selection/plan.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <iterator>
#include <string>

#include "engine/base/digest.h"
#include "engine/narrow/work_meter.h"
#include "wire/query_contradictions.h"

namespace clearance {

namespace {

[[noreturn]] void reject(const std::string& what) {
  throw engine::QueryError(QueryErrorCode::kBadQuery, what);
}

void reject_contradictions(const QueryView& q) {
  if (const Contradiction wrong = contradiction_in(q); wrong.text)
    throw engine::QueryError(wrong.is_unsupported ? QueryErrorCode::kNotSupported : QueryErrorCode::kBadQuery,
                             wrong.text);
}

void check_numbers(const QueryView& q) {
  if (!(q.max_distance >= 0)) reject("max_distance: expected metres >= 0, got " + std::to_string(q.max_distance));
  if (!(q.abs_tol >= 0) || std::isinf(q.abs_tol))
    reject("abs_tol: expected metres >= 0, got " + std::to_string(q.abs_tol));
  if (std::isnan(q.rel_tol) || q.rel_tol >= 1)
    reject("rel_tol: expected a ratio below 1, got " + std::to_string(q.rel_tol));
  if (q.precision > Precision::kF32) reject("precision: unknown value " + std::to_string(int(q.precision)));
  if (q.reduce > Reduce::kAny) reject("reduce: unknown value " + std::to_string(int(q.reduce)));
  if (q.fields & ~kKnownFields) reject("fields: unknown bits in " + std::to_string(q.fields));
  if (q.max_pose_age_ns < 0)
    reject("max_pose_age_ns: expected nanoseconds >= 0, got " + std::to_string(q.max_pose_age_ns));
  if (q.control_points < 2 || q.control_points > kMostControlPoints)
    reject("control_points: expected 2 to " + std::to_string(kMostControlPoints) + ", got " +
           std::to_string(q.control_points));
  reject_contradictions(q);
  if (q.max_evaluations > 0 && (q.configuration_count == 0 || q.configuration_count % q.control_points != 0))
    reject("configurations: motions have " + (q.control_points == 2 ? "two" : std::to_string(q.control_points)) +
           " each, got " + std::to_string(q.configuration_count));
}

// A depth is the length of a shift that separates bodies, and points have no inside.
void reject_depths_of_clouds(const PairList& pairs, const engine::Scene& scene) {
  constexpr std::uint64_t kAtATime = 1024;
  std::vector<BodyPair> storage;
  for (std::uint64_t begin = 0; begin < pairs.size(); begin += kAtATime)
    for (const BodyPair pair : pairs.slice(begin, std::min(kAtATime, pairs.size() - begin), storage))
      for (const std::uint32_t body : {pair.a, pair.b})
        if (body < scene.bodies().size() && is_cloud(scene.bodies()[body]))
          throw engine::QueryError(QueryErrorCode::kNotSupported, "signed_distance: '" + scene.bodies()[body].name +
                                                                      "' is a cloud of points, which has no depth");
  units_of_this_thread += pairs.size() / kAtATime;
}

std::uint32_t written_fields(const QueryView& q) {
  std::uint32_t fields = q.fields;
  if (q.reduce != Reduce::kNone && !(fields & kFieldVerdict)) fields |= kFieldPair;
  if (q.reduce == Reduce::kWithin) fields |= kFieldConfiguration;
  return fields;
}

// Whether the ids of a query for an older scene mean the same now. Any change affects a query of all pairs, and a new
// or removed body also the rows of `nearest`.
// \param bodies that the query moves
bool ids_valid_since(const QueryView& query, std::span<const std::uint32_t> bodies, const PoseSnapshot& snapshot,
                     const engine::Scene& scene) {
  return !query.all_pairs && snapshot.history->ids_valid_since({query.scene_revision, bodies, query.pairs,
                                                                query.margins, query.reduce == Reduce::kNearest},
                                                               snapshot.scene_changes, scene);
}

[[noreturn]] void reject_scene(const QueryView& query, const PoseSnapshot& snapshot) {
  throw engine::QueryError(QueryErrorCode::kWrongScene,
                           "the scene is revision " + std::to_string(snapshot.scene_revision) + ", the query is for " +
                               std::to_string(query.scene_revision));
}

void take_bodies(const QueryView& query, const engine::Scene& scene, Plan& plan) {
  std::vector<std::uint8_t> seen(scene.bodies().size(), 0);
  for (std::size_t i = 0; i < query.bodies.size(); ++i) {
    const std::uint32_t b = query.bodies[i];
    const std::string place = "bodies[" + std::to_string(i) + "]: ";
    if (b >= scene.bodies().size()) reject(place + "unknown body " + std::to_string(b));
    const Body& body = scene.bodies()[b];
    if (body.is_static) reject(place + "'" + body.name + "' is static and cannot be moved");
    if (body.robot != kNone) reject(place + placed_by_joints(body));
    if (seen[b]++) reject(place + "'" + body.name + "' is named twice");
  }
  plan.bodies.assign(query.bodies.begin(), query.bodies.end());
  plan.given_bodies = plan.bodies.size();
  units_of_this_thread += seen.size() / 1024;
}

constexpr std::uint64_t kLinksPerUnit = 64;  // links searched per unit of work

void take_joints(const QueryView& query, const engine::Scene& scene, Plan& plan) {
  if (query.joints.empty()) return;
  const PoseSnapshot& snapshot = *plan.snapshot;
  std::vector<std::uint8_t> seen(scene.joints().size(), 0);
  std::vector<std::vector<LinkMotion::Moving>> of_robots(scene.robots().size());
  for (std::uint32_t i = 0; i < query.joints.size(); ++i) {
    const std::uint32_t j = query.joints[i];
    const std::string place = "joints[" + std::to_string(i) + "]: ";
    if (j >= scene.joints().size())
      reject(place + "unknown joint " + std::to_string(j) + "; the scene has " + std::to_string(seen.size()));
    const SceneJoint& joint = scene.joints()[j];
    if (seen[j]++) reject(place + "'" + joint.name + "' is named twice");
    of_robots[joint.robot].push_back({joint.column, i});
  }
  for (std::size_t r = 0; r < of_robots.size(); ++r) {
    if (of_robots[r].empty()) continue;
    const SceneRobot& robot = *scene.robots()[r];
    const std::size_t count = robot.model.columns.size();
    plan.motions.emplace_back(robot, std::span(snapshot.joints.position).subspan(robot.first_joint, count),
                              std::span(snapshot.joints.given).subspan(robot.first_joint, count),
                              std::move(of_robots[r]));
    for (const std::uint32_t link : plan.motions.back().links()) plan.bodies.push_back(robot.bodies[link]);
    units_of_this_thread += robot.bodies.size() / kLinksPerUnit;
  }
  plan.joints.assign(query.joints.begin(), query.joints.end());
}

void take_speed_errors(const QueryView& query, Plan& plan) {
  const std::size_t wanted = query.joints.size() + 2 * query.bodies.size();
  const std::span<const double> errors = query.speed_errors;
  if (!errors.empty() && query.configuration_count == 0)
    reject("speed_errors: only with configurations, whose velocities they are of");
  if (!errors.empty() && errors.size() != wanted)
    reject("speed_errors: expected " + std::to_string(wanted) +
           " numbers, one for each joint and two for each body, got " + std::to_string(errors.size()));
  for (std::size_t i = 0; i < errors.size(); ++i)
    if (!(errors[i] >= 0 && std::isfinite(errors[i])))
      reject("speed_errors[" + std::to_string(i) + "]: expected a number >= 0, got " + std::to_string(errors[i]));
  plan.speed_errors.assign(errors.begin(), errors.end());
  plan.query.speed_errors = plan.speed_errors;
}

void check_growths(std::span<const double> growths) {
  const auto wrong =
      std::find_if_not(growths.begin(), growths.end(), [](double g) { return g >= 0 && g <= kMostGrowth; });
  if (wrong != growths.end())
    reject("growths[" + std::to_string(wrong - growths.begin()) + "]: expected metres from 0 to " +
           std::to_string(static_cast<int>(kMostGrowth)) + ", got " + std::to_string(*wrong));
}

// Along curves bodies do not turn.
void reject_turns(const QueryView& query) {
  const std::size_t each = query.bodies.size(), points = query.control_points;
  for (std::size_t i = 0; i < query.configurations.size(); ++i) {
    const Pose &first = query.configurations[i / (points * each) * points * each + i % each],
               &X = query.configurations[i];
    if (std::memcmp(&X.qw, &first.qw, 4 * sizeof(double)) == 0) continue;
    throw engine::QueryError(QueryErrorCode::kNotSupported,
                             "configurations: bodies[" + std::to_string(i % each) + "] turns in motion " +
                                 std::to_string(i / (points * each)) +
                                 "; with more than 2 control_points bodies keep their rotation");
  }
}

void check_count(const char* what, const char* of, std::size_t got, std::uint64_t configurations, std::size_t each) {
  const std::uint64_t wanted = configurations * each;
  if (got != wanted)
    reject(std::string(what) + ": expected " + std::to_string(wanted) + " " + of + " (" +
           std::to_string(configurations) + " x " + std::to_string(each) + "), got " + std::to_string(got));
}

}  // namespace

Planner::Planner(const QueryView& query, const engine::Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
                 std::uint64_t max_rows, bool with_configurations)
    : scene_(scene), max_rows_(max_rows) {
  check_numbers(query);
  const bool is_older = query.scene_revision != 0 && query.scene_revision != snapshot->scene_revision;
  if (is_older && !ids_valid_since(query, query.bodies, *snapshot, scene)) reject_scene(query, *snapshot);
  Plan& plan = plan_;
  plan.query = query;
  if (plan.query.rel_tol < 0) plan.query.rel_tol = default_rel_tol(query.precision);
  plan.snapshot = std::move(snapshot);
  take_bodies(query, scene, plan);
  if (is_older && std::any_of(query.joints.begin(), query.joints.end(),
                              [&](std::uint32_t j) { return j >= scene.joints().size(); }))
    reject_scene(query, *plan.snapshot);
  take_joints(query, scene, plan);
  if (is_older && !ids_valid_since(query, plan.bodies, *plan.snapshot, scene)) reject_scene(query, *plan.snapshot);
  if (query.configuration_count > 0 && query.bodies.empty() && query.joints.empty())
    reject("configurations without bodies or joints that they move");
  plan.query.bodies = plan.bodies;
  plan.query.joints = plan.joints;
  plan.weights.assign(query.weights.begin(), query.weights.end());
  plan.query.weights = plan.weights;
  take_speed_errors(query, plan);
  plan.query.configurations = {};
  plan.query.positions = {};
  plan.query.growths = {};
  plan.query.velocities = plan.query.twists = {};
  if (with_configurations) plan.take_configurations(query);

  plan.moved = plan.snapshot->with_followers(plan.bodies);
  lister_.emplace(query, scene, plan.snapshot->pairs, plan.moved);
  plan.query.pairs = {};
  units_of_this_thread += query.bodies.size() / 16;
}

bool Planner::advance(WorkMeter& meter) {
  if (!lister_) return true;
  if (!lister_->advance(meter)) return false;
  plan_.pairs = lister_->take();
  lister_.reset();
  if (plan_.query.signed_distance && scene_.has_surfaces()) reject_depths_of_clouds(plan_.pairs, scene_);
  if (plan_.query.reduce == Reduce::kAny || plan_.query.max_evaluations > 0)
    plan_.margins = Margins(plan_.query, scene_, plan_.pairs);
  plan_.query.margins = {};
  plan_.query.pair_margins = {};
  compute_size();
  return true;
}

void Planner::compute_size() {
  const QueryView& query = plan_.query;
  QuerySize& size = plan_.size;
  size.configurations = std::max<std::uint64_t>(query.configuration_count, 1);
  if (query.max_evaluations > 0) size.configurations = query.configuration_count / query.control_points;
  size.pairs = plan_.pairs.size();
  size.fields = written_fields(query);
  size.joints = static_cast<std::uint32_t>(query.joints.size());
  // K and P are below 2^32 and 2^64 / 2^32 rows would never pass max_rows_: compare by division.
  const bool one_row = query.reduce == Reduce::kMin || query.reduce == Reduce::kAny;
  const std::uint64_t per_configuration = one_row ? 1
                                          : query.reduce == Reduce::kNearest && query.k > 0
                                              ? std::min<std::uint64_t>(query.k, size.pairs)
                                          : query.reduce == Reduce::kNearest ? scene_.bodies().size()
                                                                             : size.pairs;
  const bool too_many = per_configuration > 0 && size.configurations > max_rows_ / per_configuration;
  size.rows = too_many ? max_rows_ + 1 : size.configurations * per_configuration;
  if (query.reduce == Reduce::kWithin) size.rows = std::min(size.rows, query.max_results);
  if (size.rows > max_rows_)
    throw engine::QueryError(QueryErrorCode::kTooLarge, std::to_string(size.configurations) + " configurations x " +
                                                            std::to_string(per_configuration) +
                                                            " rows are more than the limit of " +
                                                            std::to_string(max_rows_));
}

Plan make_plan(const QueryView& query, const engine::Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
               std::uint64_t max_rows, bool with_configurations) {
  Planner planner(query, scene, std::move(snapshot), max_rows, with_configurations);
  WorkMeter unlimited;
  planner.advance(unlimited);
  units_of_this_thread += unlimited.spent();
  return std::move(planner.plan());
}

void Plan::take_configurations(const QueryView& requested) {
  const std::uint32_t count = requested.configuration_count;
  check_count("configurations", "poses", requested.configurations.size(), count, requested.bodies.size());
  check_count("positions", "numbers", requested.positions.size(), count, requested.joints.size());
  if (!requested.growths.empty()) {
    check_count("growths", "numbers", requested.growths.size(), count, requested.bodies.size());
    check_growths(requested.growths);
  }
  if (query.control_points > 2) reject_turns(requested);
  if (!(requested.growths.empty() && requested.velocities.empty() && requested.twists.empty()))
    reject_contradictions(requested);  // a kept job has other inputs each time
  configurations = requested.configurations;
  positions = requested.positions;
  growths = requested.growths;
  const auto take = [count](const char* what, const char* of, std::span<const double> given, std::size_t each) {
    if (!given.empty()) check_count(what, of, given.size(), count, each);
    return given;
  };
  velocities = take("velocities", "numbers", requested.velocities, requested.joints.size());
  twists = take("twists", "numbers", requested.twists, 6 * requested.bodies.size());
}

void Plan::keep_configurations() {
  const auto keep = [](auto& view, auto& kept) {
    if (view.data() == kept.data()) return;
    count_copied(view.size_bytes());
    kept.assign(view.begin(), view.end());
    view = kept;
  };
  keep(configurations, kept_configurations);
  keep(positions, kept_positions);
  keep(growths, kept_growths);
  keep(velocities, kept_velocities);
  keep(twists, kept_twists);
}

}  // namespace clearance
