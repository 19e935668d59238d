// check() and check_path() in terms of distances(), for the engine and for clients.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "wire/api/check.h"
#include "wire/api/scene_info.h"

namespace clearance {

/// Converts the result of as_check(query), with the limits of the query's joints or, without configurations, of all
/// joints at their current positions.
/// \param joints returns a pointer to JointsInfo; its argument is whether it needs the current positions
template <class JointsAt>
Check check_with_limits(const Query& query, const Result& result, JointsAt&& joints) {
  const bool is_now = query.joints.empty() && query.configurations.empty();
  if (query.joints.empty() && !is_now) return check_of(result);
  const auto info = joints(is_now);
  std::vector<std::uint32_t> ids(query.joints.begin(), query.joints.end());
  std::vector<double> positions(query.positions.begin(), query.positions.end());
  for (std::uint32_t id = 0; is_now && id < info->joints.size(); ++id) {
    ids.push_back(id);
    positions.push_back(info->joints[id].status == Status::kOk ? info->joints[id].position : std::nan(""));
  }
  std::vector<JointLimits> limits;
  for (const std::uint32_t id : ids) limits.push_back({info->joints.at(id).lower, info->joints.at(id).upper});
  return check_of(result, ids, limits, positions);
}

/// First waypoint at which each joint is beyond its limits.
inline std::vector<LimitViolation> first_violations(const Query& path, const JointsInfo& info) {
  std::vector<LimitViolation> violations;
  const std::size_t each = path.joints.size();
  for (std::size_t j = 0; j < each; ++j) {
    const JointLimits limits{info.joints.at(path.joints[j]).lower, info.joints.at(path.joints[j]).upper};
    for (std::size_t k = 0; k * each < path.positions.size(); ++k) {
      const double position = path.positions[k * each + j];
      if (!(position < limits.lower || position > limits.upper)) continue;
      violations.push_back({k, path.joints[j], position, limits});
      break;
    }
  }
  return violations;
}

/// The ends of motions along waypoints [first, last]: every waypoint twice, except for those two.
template <class T>
std::vector<T> ends_of_motions(std::span<const T> waypoints, std::size_t each, std::size_t first, std::size_t last) {
  std::vector<T> ends;
  if (each == 0) return ends;
  for (std::size_t k = first; k < last; ++k) {
    const auto from = waypoints.begin() + static_cast<std::ptrdiff_t>(k * each);
    ends.insert(ends.end(), from, from + static_cast<std::ptrdiff_t>(2 * each));
  }
  return ends;
}

/// A part of a path, as motions.
class PathPart {
 public:
  /// \param first first of the waypoints
  PathPart(const Query& path, std::size_t first, std::size_t last)
      : positions_(ends_of_motions(path.positions, path.joints.size(), first, last)),
        poses_(ends_of_motions(path.configurations, path.bodies.size(), first, last)),
        path_(path) {}

  /// Refers to this.
  Query query(std::uint32_t fields) const {
    Query query = path_;
    query.positions = positions_;
    query.configurations = poses_;
    query.reduce = Reduce::kAny;
    query.fields = fields;
    if (query.max_evaluations == 0) query.max_evaluations = kDefaultEvaluations;
    return query;
  }

 private:
  std::vector<double> positions_;
  std::vector<Pose7> poses_;
  const Query& path_;
};

/// Describes a motion that is not proved free.
inline void describe_stop(const Result& details, std::size_t motion, PathCheck& check) {
  const double time = details.time()[0];
  check.free = false;
  check.index = motion;
  check.t = std::isnan(time) ? details.first_contact()[0] : time;
  check.pair = details.pair()[0];
  check.status = details.status()[0];
}

/// Answers check_path(): requests verdicts, and details of the first motion without a proof alone.
/// \param distances answers a query
/// \param joints returns a pointer to JointsInfo with the limits, for a result
template <class Distances, class JointsAt>
PathCheck check_path_with(const Query& path, Distances&& distances, JointsAt&& joints) {
  constexpr std::size_t kFirstMotions = 8, kMostMotions = 1024;  // in one query
  constexpr std::uint32_t kDetails = kFieldStatus | kFieldPair | kFieldTime | kFieldFirstContact;
  const std::size_t count = configuration_count(path);
  if (path.control_points != 2)
    throw std::invalid_argument("check_path: control_points: expected 2, got " + std::to_string(path.control_points) +
                                "; use motions() for curves");
  if (count < 2)
    throw std::invalid_argument("check_path: expected two waypoints or more, got " + std::to_string(count));
  PathCheck check;
  std::size_t room = kFirstMotions;
  for (std::size_t first = 0; first < count - 1;) {
    const std::size_t last = std::min(first + room, count - 1);
    const PathPart part(path, first, last);
    const Result verdicts = distances(part.query(kFieldVerdict));
    if (first == 0 && !path.joints.empty()) check.limit_violations = first_violations(path, *joints(verdicts));
    const auto verdict = verdicts.verdict();
    const auto open = std::ranges::find_if(verdict, [](Status s) { return s != Status::kBeyond; });
    first += static_cast<std::size_t>(open - verdict.begin());
    if (open == verdict.end()) {
      room = std::min(2 * room, kMostMotions);
      continue;
    }
    const PathPart motion(path, first, first + 1);
    const Result details = distances(motion.query(kDetails));
    if (details.status()[0] != Status::kBeyond) {
      describe_stop(details, first, check);
      return check;
    }
    ++first;
  }
  return check;
}

}  // namespace clearance
