// Where a path of joints is closest to an obstacle, and why it is not free, for clearance::Engine and clearance::Client.
#pragma once

#include <clearance/check.h>
#include <clearance/path_states.h>
#include <clearance/prepared_path.h>
#include <clearance/scene_info.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

namespace clearance {

/// A state of a path with one of its pairs. The bounds hold at `positions`, which are rounded.
struct PathPoint {
  std::uint64_t index = 0;        ///< the motion: from waypoint `index` to the next, or a segment
  double t = 0;                   ///< 0 to 1 in that motion
  std::vector<double> positions;  ///< (J,) radians and metres
  IdPair pair{kNone, kNone};      ///< ids of the bodies
  /// Metres: certified bounds of the pair's distance, below zero for a depth. 0 for overlaps with a cloud, which has no
  /// depth.
  double lower = 0, upper = 0;
  std::array<double, 3> a{}, b{};  ///< witness points on the bodies, metres, world; NaN where there are none
};

/// Certified bounds, metres.
struct Bounds {
  double lower, upper;
};

/// Result of explain_path().
struct PathReport {
  PathCheck check;  ///< the verdict, as check_path() returns it
  /// Motion, and time in it, until which the path is proved free; empty if it is free as a whole.
  std::optional<std::pair<std::uint64_t, double>> proved_until;
  std::optional<PathPoint> contact;  ///< the first state found within the margin
  /// Of a free path: the state where the distance is least. Otherwise the deepest of 33 states of the motion from the
  /// contact on, or without a proved contact the state of the least distance.
  PathPoint nearest;
  std::optional<Bounds> least;  ///< of the path's distance; empty after a contact
};

namespace path_report {

inline constexpr std::uint32_t kPointFields = kDefaultFields | kFieldPair | kFieldPointA | kFieldPointB;
inline constexpr std::uint32_t kPathFields = kPointFields | kFieldTime | kFieldFirstContact;
inline constexpr std::size_t kMostMotions = 1024;  // of a path in one query
inline constexpr std::size_t kStates = 33;         // of a motion, among which the deepest is searched

inline PathPoint point(const Result& r, std::size_t k, std::uint64_t index, double t, std::vector<double> positions) {
  const auto of = [k](std::span<const double> points) {
    return std::array{points[3 * k], points[3 * k + 1], points[3 * k + 2]};
  };
  return {index, t, std::move(positions), r.pair()[k], r.lower()[k], r.upper()[k], of(r.point_a()), of(r.point_b())};
}

/// Motions [first, last) of a path.
template <class Source>
Result motions(Source& engine, const Query& path, std::uint64_t first, std::uint64_t last) {
  const path_check::Part part(path, first, last);
  Query query = part.query(kPathFields);
  query.reduce = Reduce::kMin;
  return engine.motions(query);
}

/// The state of the least distance of all motions, and its bounds.
template <class Source>
void find_nearest(Source& engine, const Query& path, std::uint64_t count, PathReport& report) {
  Bounds least{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  for (std::uint64_t first = 0; first < count; first += kMostMotions) {
    const Result r = motions(engine, path, first, std::min<std::uint64_t>(first + kMostMotions, count));
    for (std::size_t k = 0; k < r.rows(); ++k) {
      least.lower = std::min(least.lower, r.lower()[k]);
      if (!(r.upper()[k] < least.upper)) continue;
      least.upper = r.upper()[k];
      const double t = r.time()[k];
      report.nearest = point(r, k, first + k, t, State(path, first + k, t).positions);
    }
  }
  report.least = least;
}

/// Decides a state, as a motion that stays there: bodies grow in motions alone.
template <class Source>
PathCheck check_state(Source& engine, const Query& path, const State& state) {
  const auto twice = [](auto row) {
    row.reserve(2 * row.size());
    std::copy_n(row.begin(), row.size(), std::back_inserter(row));
    return row;
  };
  const auto positions = twice(state.positions), growths = twice(state.growths);
  const auto poses = twice(state.poses);
  Query query = path;
  query.positions = positions;
  query.configurations = poses;
  query.growths = growths;
  query.control_points = 2;
  return engine.check_path(query);
}

/// Pairs of a path: those that have depths, then those of a cloud, which have none.
/// \param state any of the path
template <class Source>
std::array<std::vector<IdPair>, 2> pairs_by_depth(Source& engine, const SceneInfo& scene, const Query& path,
                                                  const State& state) {
  const auto is_cloud = [&](std::uint32_t body) { return body < scene.bodies.size() && scene.bodies[body].is_cloud; };
  std::array<std::vector<IdPair>, 2> found;
  const Query at_state{.pairs = path.pairs,
                       .all_pairs = path.all_pairs,
                       .bodies = path.bodies,
                       .configurations = state.poses,
                       .joints = path.joints,
                       .positions = state.positions};
  for (const IdPair& pair : engine.pairs(at_state)) found[is_cloud(pair[0]) || is_cloud(pair[1])].push_back(pair);
  return found;
}

/// Distances of states, as the bodies are without growth: a row for each, or for each pair if bodies grow.
/// \param has_depths whether overlaps have negative distances
template <class Source>
Result distances(Source& engine, Query query, std::span<const State> states, bool has_depths) {
  std::vector<double> positions;
  std::vector<Pose7> poses;
  for (const State& state : states) {
    positions.insert(positions.end(), state.positions.begin(), state.positions.end());
    poses.insert(poses.end(), state.poses.begin(), state.poses.end());
  }
  query.positions = positions;
  query.configurations = poses;
  query.growths = {};
  query.max_evaluations = 0;
  query.control_points = 2;
  query.margin = 0;
  query.margins = {};
  query.pair_margins = {};
  query.signed_distance = has_depths;
  query.fields = kPointFields;
  query.reduce = states[0].growths.empty() ? Reduce::kMin : Reduce::kNone;
  return engine.distances(query);
}

/// Subtracts the growth of a pair's bodies from the bounds. Growth alone proves no upper bound on a depth, since grown
/// bodies may fill holes.
inline PathPoint grown(PathPoint point, double growth) {
  if (growth == 0) return point;
  const bool was_apart = point.lower >= 0;
  point.lower = std::nextafter(point.lower - growth, -std::numeric_limits<double>::infinity());
  point.upper = std::nextafter(point.upper - growth, std::numeric_limits<double>::infinity());
  if (was_apart && point.lower < 0) point.lower = -std::numeric_limits<double>::infinity();
  return point;
}

/// The deepest of some states, or the nearest if none is an overlap. Throws std::runtime_error without pairs.
/// \param times of the states, in motion `index`
template <class Source>
PathPoint deepest(Source& engine, const Query& path, std::uint64_t index, std::span<const State> states,
                  std::span<const double> times) {
  std::optional<PathPoint> found;
  const auto search = [&](const Query& query, bool has_depths) {
    const Result r = distances(engine, query, states, has_depths);
    const std::size_t each = r.rows() / states.size();
    for (std::size_t k = 0; k < r.rows(); ++k) {
      if (r.pair()[k][0] == kNone) continue;
      const State& state = states[k / each];
      PathPoint other =
          grown(point(r, k, index, times[k / each], state.positions), state.growth(path.bodies, r.pair()[k]));
      if (!found || other.upper < found->upper || (std::isnan(found->upper) && !std::isnan(other.upper)))
        found = std::move(other);
    }
  };
  const SceneInfo& scene = engine.scene();
  if (std::none_of(scene.bodies.begin(), scene.bodies.end(), [](const BodyInfo& body) { return body.is_cloud; })) {
    search(path, true);
  } else {
    const auto groups = pairs_by_depth(engine, scene, path, states[0]);
    Query query = path;
    for (const bool has_depths : {true, false}) {
      query.pairs = groups[has_depths ? 0 : 1];
      if (!query.pairs.empty()) search(query, has_depths);
    }
  }
  if (!found) throw std::runtime_error("explain_path: the path has no pairs in this scene");
  return *std::move(found);
}

/// Describes the first contact, at time `within` of the motion that is not free, and the deepest state from there on.
template <class Source>
void describe_hit(Source& engine, const Query& path, double within, PathReport& report) {
  const std::uint64_t index = *report.check.index;
  std::vector<double> times;
  std::vector<State> states;
  for (std::size_t k = 0; k < kStates; ++k) {
    times.push_back(within + (1 - within) * static_cast<double>(k) / (kStates - 1));
    states.emplace_back(path, index, times.back());
  }
  report.nearest = deepest<Source>(engine, path, index, states, times);
  const PathCheck first = check_state(engine, path, states[0]);
  const IdPair pair = first.free ? report.check.pair : first.pair;
  Query of_pair = path;
  of_pair.pairs = {&pair, 1};
  report.contact = deepest<Source>(engine, of_pair, index, std::span(states).first(1), times);
}

}  // namespace path_report

/// Returns where a path of joints is closest to a contact; or, if it is not free, where its first contact is, of which
/// pair, and how deep the motion drives in.
///
/// Bodies may move and grow meanwhile: the bounds are those of grown bodies, the witness points of bodies without growth,
/// and a depth that growth alone makes has a lower bound of -inf.
///
/// Throws std::invalid_argument unless the path has two waypoints of joints or more, std::runtime_error if a change of
/// the scene meanwhile leaves the path no pairs, and otherwise as check_path() and motions() do.
/// \param engine an Engine or a Client
/// \param path as of check_path(): (N, J) positions of `joints`, waypoints or control points, with as many poses and
/// growths of `bodies`
template <class Queried>
PathReport explain_path(Queried& engine, const Query& path) {
  if (path.joints.empty()) throw std::invalid_argument("explain_path: expected joints");
  PathReport report;
  report.check = engine.check_path(path);
  if (report.check.free) {
    path_report::find_nearest(engine, path, path_check::motion_count(path), report);
    return report;
  }
  const std::uint64_t index = *report.check.index;
  const Result stop = path_report::motions(engine, path, index, index + 1);
  const double proved = stop.first_contact()[0], within = stop.first_contact()[1];
  report.proved_until = {index, std::isinf(proved) ? 0.0 : proved};
  if (!report.check.hit()) {
    path_report::find_nearest(engine, path, path_check::motion_count(path), report);
    return report;
  }
  const bool hits_at_start =
      !(proved > 0) && path_report::check_state(engine, path, path_report::State(path, index, 0)).hit();
  path_report::describe_hit(engine, path, hits_at_start ? 0 : std::isinf(within) ? report.check.t : within, report);
  return report;
}

}  // namespace clearance
