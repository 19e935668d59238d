// Whether a robot stops in time, for clearance::Engine and clearance::Client.
//
//   const std::array deceleration{5.0, 5.0, 8.0};
//   const std::array others{clearance::Mover{engine.body("person"), 1.6}};
//   const clearance::StopCheck stop = clearance::check_stop(
//       engine, {.joints = joints.ids, .positions = q, .velocities = v}, {deceleration, 0.1, others});
//   command(stop.speed_scale);
#pragma once

#include <clearance/check.h>
#include <clearance/prepared_path.h>
#include <clearance/query.h>
#include <clearance/scene_info.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace clearance {

/// A body that may move anywhere.
struct Mover {
  std::uint32_t body;  ///< id, or the selector of a group
  double max_speed;    ///< metres per second: limit of all its points, and of those of bodies that follow it
};

/// How a robot brakes, and who moves meanwhile.
struct Braking {
  std::span<const double> deceleration;  ///< (J,) rad/s^2 and m/s^2, positive; what every brake reaches at least
  /// Seconds from the measurement of the positions until the brakes act, at unchanged velocities.
  double reaction_s = 0;
  /// Each must have received a pose. Its age counts, and so does the time to standstill.
  /// Only pairs of the query count: others that have none are passed over.
  std::span<const Mover> others = {};
  /// All joints stop at one time, on a straight line: the proof covers harder braking along it, too. Otherwise each
  /// stops as soon as it can, at exactly its deceleration.
  bool together = true;
};

/// Whether a robot stops in time.
struct StopCheck {
  PathCheck check;  ///< the braking path at full speed, as check_path() describes a path
  /// Greatest proved share of the velocities, 0 to 1. 0 if no speed is proved: rest may be proved or not.
  double speed_scale = 0;
  double seconds = 0;  ///< from now to standstill at full speed
  /// Control points of the braking path at full speed, rounded: that path was checked.
  std::vector<double> path;
  std::uint32_t control_points = 2;  ///< of each segment of `path`
  explicit operator bool() const { return check.ok(); }
};

namespace stop_check {

inline constexpr int kHalvings = 8;         // of the search for the greatest speed
inline constexpr double kUp = 1 + 0x1p-50;  // covers the rounding of a few sums and products above 0

struct BrakingPath {
  std::vector<double> points;
  std::uint32_t control_points = 2;
  double seconds = 0;
};

inline double last_stop(const Query& state, const Braking& law, double scale) {
  double last = 0;
  for (std::size_t j = 0; j < law.deceleration.size(); ++j)
    last = std::max(last, std::abs(scale * state.velocities[j]) / law.deceleration[j]);
  return last;
}

/// All joints stop at one time: the line from the positions to where they stop.
inline BrakingPath line_of(const Query& state, const Braking& law, double scale) {
  const double last = last_stop(state, law, scale), share = (law.reaction_s + 0.5 * last) * kUp;
  BrakingPath path{{state.positions.begin(), state.positions.end()}, 2, (law.reaction_s + last) * kUp};
  for (std::size_t j = 0; j < state.positions.size(); ++j)
    path.points.push_back(state.positions[j] + scale * state.velocities[j] * share);
  return path;
}

/// Each joint stops by itself: curves of degree 2 between the times at which one does.
inline BrakingPath curves_of(const Query& state, const Braking& law, double scale) {
  const std::size_t joints = state.positions.size();
  std::vector<double> times{0, law.reaction_s};
  for (std::size_t j = 0; j < joints; ++j)
    times.push_back(law.reaction_s + std::abs(scale * state.velocities[j]) / law.deceleration[j]);
  std::ranges::sort(times);
  times.erase(std::unique(times.begin(), times.end()), times.end());
  if (times.size() == 1) return line_of(state, law, scale);
  BrakingPath path{{}, 3, times.back() * kUp};
  const auto at = [&](std::size_t j, double t, double until, bool middle) {
    const double v = scale * state.velocities[j], a = std::copysign(law.deceleration[j], v);
    const double stop = std::abs(v) / law.deceleration[j];
    const double braked = std::clamp(t - law.reaction_s, 0.0, stop);
    const double q = state.positions[j] + v * (std::min(t, law.reaction_s) + braked) - 0.5 * a * braked * braked;
    return middle && braked < stop ? q + 0.5 * (v - a * braked) * (until - t) : q;
  };
  for (std::size_t k = 0; k + 1 < times.size(); ++k)
    for (const auto& [t, middle] : {std::pair{times[k], false}, {times[k], true}, {times[k + 1], false}})
      for (std::size_t j = 0; j < joints; ++j) path.points.push_back(at(j, t, times[k + 1], middle));
  return path;
}

/// The speeds of the others by body, below 0 of those that are none.
template <class Source>
std::vector<double> speeds_of(Source& source, std::span<const Mover> others, std::size_t bodies) {
  std::vector<double> speeds(bodies, -1);
  const auto add = [&](std::uint32_t body, double speed) {
    if (body >= bodies)
      throw std::invalid_argument("check_stop: others: no body or group has the id " + std::to_string(body));
    speeds[body] = std::max(speeds[body], speed);
  };
  for (const Mover& mover : others) {
    if (!(mover.max_speed >= 0) || std::isinf(mover.max_speed))
      throw std::invalid_argument("check_stop: others: expected speeds >= 0, got " + std::to_string(mover.max_speed));
    if (mover.body == kEveryBody || !(mover.body & kGroupBit)) {
      add(mover.body, mover.max_speed);
      continue;
    }
    const SceneInfo scene = source.scene();
    const std::uint32_t group = mover.body & ~kGroupBit;
    if (group >= scene.groups.size()) add(mover.body, 0);
    for (const std::uint32_t body : scene.groups[group].bodies) add(body, mover.max_speed);
  }
  return speeds;
}

/// The others and the bodies that follow them now: pairs, each with the movers that may bring it nearer.
class Movers {
 public:
  static constexpr std::size_t kMost = 90;  ///< bodies; a query has 4096 margins, one for each of their pairs

  /// \param speeds metres per second by body, limits of all points of these bodies and of those that follow them;
  ///     below 0 of those that are none of the others
  Movers(std::vector<double> speeds, std::span<const BodyStateInfo> states) : speeds_(std::move(speeds)) {
    for (const BodyStateInfo& state : states) ages_s_.push_back(1e-9 * static_cast<double>(state.age_ns));
    for (std::uint32_t body = 0; body < states.size(); ++body)
      if (Moving alone{kEveryBody, body, above(states, body)}; !alone.movers.empty())
        pairs_.push_back(std::move(alone));
    if (pairs_.size() > kMost)
      throw std::invalid_argument("check_stop: others: " + std::to_string(pairs_.size()) +
                                  " bodies move, followers included; at most " + std::to_string(kMost));
    add_both();
  }

  /// Margins that contain how far they come in some seconds, and have come in the ages of their poses.
  std::vector<MarginEntry> margins(double margin, double seconds) const {
    std::vector<MarginEntry> entries{{kEveryBody, kEveryBody, margin}};
    for (const Moving& pair : pairs_) {
      double reach = margin;
      for (const std::uint32_t body : pair.movers) reach = (reach + speeds_[body] * (ages_s_[body] + seconds)) * kUp;
      entries.push_back({pair.a, pair.b, reach});
    }
    return entries;
  }

 private:
  struct Moving {
    std::uint32_t a, b;
    std::vector<std::uint32_t> movers;  // ascending
  };

  /// Those of the others that a body follows, and itself if it is one.
  std::vector<std::uint32_t> above(std::span<const BodyStateInfo> states, std::uint32_t body) const {
    std::vector<std::uint32_t> found;
    for (; body != kNone; body = states[body].parent)
      if (speeds_[body] >= 0) found.push_back(body);
    std::ranges::sort(found);
    return found;
  }

  /// Adds pairs of two that move, since both may come nearer; what moves both alike does not count. The last entry that
  /// names a pair is its margin.
  void add_both() {
    const std::size_t alone = pairs_.size();
    for (std::size_t i = 0; i < alone; ++i)
      for (std::size_t k = i + 1; k < alone; ++k) {
        Moving both{pairs_[i].b, pairs_[k].b, {}};
        std::ranges::set_symmetric_difference(pairs_[i].movers, pairs_[k].movers, std::back_inserter(both.movers));
        pairs_.push_back(std::move(both));
      }
  }

  std::vector<double> speeds_, ages_s_;  // by body
  std::vector<Moving> pairs_;
};

/// Movers of the bodies' current states. Throws std::invalid_argument for others without a received pose.
template <class Source>
Movers movers_of(Source& source, std::span<const Mover> others) {
  const std::vector<BodyStateInfo> states = source.body_states();
  std::vector<double> speeds = speeds_of(source, others, states.size());
  for (std::size_t body = 0; body < states.size(); ++body)
    if (speeds[body] >= 0 && states[body].age_ns < 0)
      throw std::invalid_argument("check_stop: others: no pose of '" + source.scene().bodies[body].name +
                                  "' has been received");
  return Movers(std::move(speeds), states);
}

inline void check_input(const Query& state, const Braking& law) {
  const std::size_t joints = state.joints.size();
  const auto check = [](bool right, const std::string& text) {
    if (!right) throw std::invalid_argument("check_stop: " + text);
  };
  const auto all = [](std::span<const double> numbers, auto&& right) { return std::ranges::all_of(numbers, right); };
  check(joints > 0 && state.bodies.empty(), "expected joints, and no bodies");
  check(state.positions.size() == joints, "positions: expected one for each joint");
  check(state.velocities.size() == joints, "velocities: expected one for each joint");
  check(law.deceleration.size() == joints, "deceleration: expected one for each joint");
  check(all(state.velocities, [](double v) { return std::isfinite(v); }), "velocities: expected finite numbers");
  check(all(law.deceleration, [](double a) { return a > 0 && std::isfinite(a); }),
        "deceleration: expected finite numbers above 0");
  check(law.reaction_s >= 0 && std::isfinite(law.reaction_s), "reaction_s: expected a finite number >= 0");
  check(state.margins.empty() && state.pair_margins.empty(), "margins: expected `margin` alone, since others move");
}

/// The greatest share of the velocities that is proved, by bisection with a proof at each step.
template <class IsFree>
double greatest_scale(IsFree&& is_free) {
  if (!is_free(0.0)) return 0;
  double proved = 0, beyond = 1;
  for (int k = 0; k < kHalvings; ++k) {
    const double scale = 0.5 * (proved + beyond);
    (is_free(scale) ? proved : beyond) = scale;
  }
  return proved;
}

/// The queries of one state: whether its braking paths are free. Keeps references to its arguments.
template <class Source>
class StopQueries {
 public:
  StopQueries(Source& engine, const Query& state, const Braking& law)
      : engine_(engine), state_(state), law_(law), query_(state) {
    check_input(state, law);
    if (!law.others.empty()) movers_ = movers_of(engine, law.others);
    query_.velocities = {};
  }

  /// The path at full speed. `speed_scale` is 1, or 0 if that path is not free: slower ones are not tried.
  StopCheck at_full_speed() {
    take(1);
    PathCheck check = engine_.check_path(query_);
    const double scale = check.free ? 1 : 0;
    return {std::move(check), scale, path_.seconds, path_.points, path_.control_points};
  }

  /// The greatest speed that is proved, for a path that is not free at full speed.
  double greatest_scale() {
    return stop_check::greatest_scale([&](double scale) {
      take(scale);
      return engine_.distances(path_check::as_motions_of_path(query_, kFieldVerdict)).all_free();
    });
  }

 private:
  void take(double scale) {
    path_ = law_.together ? line_of(state_, law_, scale) : curves_of(state_, law_, scale);
    query_.positions = path_.points;
    query_.control_points = path_.control_points;
    if (movers_) margins_ = movers_->margins(state_.margin, path_.seconds);
    query_.margins = margins_;
  }

  Source& engine_;
  const Query& state_;
  const Braking& law_;
  std::optional<Movers> movers_;
  BrakingPath path_;
  std::vector<MarginEntry> margins_;
  Query query_;  // its spans are of path_ and margins_
};

}  // namespace stop_check

/// Returns whether a robot that brakes stops before any contact, and the greatest speed for which it does.
///
/// Others have their whole reach until standstill at every state of the path, as in S_h of ISO 10218-2; their motion
/// after standstill is not considered. Throws std::invalid_argument for arguments that do not fit, or others without
/// a received pose, and otherwise as check_path().
/// \param engine an Engine or a Client
/// \param state (J,) positions and velocities of `joints` now; its pairs, and a margin that is kept from everything
template <class Queried>
StopCheck check_stop(Queried& engine, const Query& state, const Braking& law) {
  stop_check::StopQueries queries(engine, state, law);
  StopCheck stop = queries.at_full_speed();
  if (!stop.check.free) stop.speed_scale = queries.greatest_scale();
  return stop;
}

}  // namespace clearance
