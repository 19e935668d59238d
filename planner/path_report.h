// Where a path of joints is closest to an obstacle, and why it is not free, for clearance::Engine and clearance::Client.
#pragma once

#include <clearance/check.h>
#include <clearance/prepared_path.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

namespace clearance {

/// A state of a path with one of its pairs. The bounds hold at `positions`, which are rounded.
struct PathPoint {
  std::uint64_t index = 0;         ///< the motion: from waypoint `index` to the next, or a segment
  double t = 0;                    ///< 0 to 1 in that motion
  std::vector<double> positions;   ///< (J,) radians and metres
  IdPair pair{kNone, kNone};       ///< ids of the bodies
  double lower = 0, upper = 0;     ///< metres: certified bounds of the pair's distance, below zero for a depth
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

/// The state of motion `index` at time t, by Casteljau's rule.
inline std::vector<double> between(const Query& path, std::uint64_t index, double t) {
  const path_check::Part motion(path, index, index + 1);
  const std::span<const double> rows = motion.positions();
  const std::size_t joints = path.joints.size();
  std::vector<double> state(rows.begin(), rows.end());
  for (std::size_t left = state.size() - joints; left > 0; left -= joints)
    for (std::size_t i = 0; i < left; ++i) state[i] += t * (state[i + joints] - state[i]);
  state.resize(joints);
  return state;
}

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
  Query query = path;
  query.positions = part.positions();
  query.reduce = Reduce::kMin;
  query.fields = kPathFields;
  return engine.motions(query);
}

/// Converts a query of motions to that of their states.
inline Query of_states(Query query, std::span<const double> states) {
  query.positions = states;
  query.max_evaluations = 0;
  query.control_points = 2;
  return query;
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
      report.nearest = point(r, k, first + k, t, between(path, first + k, t));
    }
  }
  report.least = least;
}

template <class Source>
Check check_state(Source& engine, const Query& path, std::span<const double> state) {
  return engine.check(of_states(path, state));
}

template <class Source>
void describe_hit(Source& engine, const Query& path, double within, PathReport& report) {
  const std::uint64_t index = *report.check.index;
  std::vector<double> times(kStates), states;
  for (std::size_t k = 0; k < kStates; ++k) {
    times[k] = within + (1 - within) * static_cast<double>(k) / (kStates - 1);
    const std::vector<double> state = between(path, index, times[k]);
    states.insert(states.end(), state.begin(), state.end());
  }
  const std::size_t joints = path.joints.size();
  const auto state = [&](std::size_t k) { return std::span(states).subspan(k * joints, joints); };
  const auto row = [&](std::size_t k) { return std::vector<double>(state(k).begin(), state(k).end()); };
  Query query = of_states(path, states);
  query.margin = 0;
  query.margins = {};
  query.pair_margins = {};
  query.signed_distance = true;
  query.fields = kPointFields;
  query.reduce = Reduce::kMin;
  const Result deep = engine.distances(query);
  const auto deepest = static_cast<std::size_t>(std::ranges::min_element(deep.upper()) - deep.upper().begin());
  report.nearest = point(deep, deepest, index, times[deepest], row(deepest));
  const Check first = check_state(engine, path, state(0));
  const IdPair pair = first.free[0] ? report.check.pair : first.pair[0];
  query.pairs = {&pair, 1};
  query.positions = state(0);
  report.contact = point(engine.distances(query), 0, index, within, row(0));
}

}  // namespace path_report

/// Returns where a path of joints is closest to a contact; or, if it is not free, where its first contact is, of which
/// pair, and how deep the motion drives in.
///
/// Throws std::invalid_argument unless the path has two waypoints of joints or more and moves no bodies, and otherwise as
/// check_path() and motions() do.
/// \param engine an Engine or a Client
/// \param path as of check_path(): (N, J) positions of `joints`, waypoints or control points
template <class Queried>
PathReport explain_path(Queried& engine, const Query& path) {
  if (path.joints.empty() || !path.bodies.empty())
    throw std::invalid_argument("explain_path: expected joints, and no bodies");
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
  const std::vector<double> start = path_report::between(path, index, 0);
  const bool hits_at_start = !(proved > 0) && path_report::check_state(engine, path, start).hit(0);
  path_report::describe_hit(engine, path, hits_at_start ? 0 : std::isinf(within) ? report.check.t : within, report);
  return report;
}

}  // namespace clearance
