// check_path() in terms of distances(), also prepared for many paths, for the engine and for clients.
#pragma once

#include <clearance/check.h>
#include <clearance/curve_limits.h>
#include <clearance/prepared.h>
#include <clearance/scene_info.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace clearance {

namespace path_check {

/// Columns of the first motion without a proof. They cost more than verdicts, above all kFieldFirstContact.
inline constexpr std::uint32_t kDetails = kFieldStatus | kFieldPair | kFieldTime | kFieldFirstContact;
inline constexpr std::size_t kFirstMotions = 8, kMostMotions = 1024;  // in one query

/// Converts a query to that of motions with such columns.
inline Query as_motions_of_path(Query query, std::uint32_t fields) {
  query.reduce = Reduce::kAny;
  query.fields = fields;
  if (query.max_evaluations == 0) query.max_evaluations = kDefaultEvaluations;
  return query;
}

/// Number of motions of a path. Throws std::invalid_argument.
inline std::size_t motion_count(const Query& path) {
  const std::size_t rows = configuration_count(path), points = path.control_points;
  if (points < 2 || points > kMostControlPointsOfCurve)
    throw std::invalid_argument("check_path: control_points: expected 2 to 8, got " + std::to_string(points));
  if (points > 2 && (rows == 0 || rows % points != 0))
    throw std::invalid_argument("check_path: expected " + std::to_string(points) +
                                " control points for each segment, got " + std::to_string(rows) + " rows");
  if (!path.growths.empty() && path.growths.size() != rows * path.bodies.size())
    throw std::invalid_argument("check_path: growths: expected " + std::to_string(rows * path.bodies.size()) +
                                ", for each body in each row, got " + std::to_string(path.growths.size()));
  if (points == 2 && rows < 2)
    throw std::invalid_argument("check_path: expected two waypoints or more, got " + std::to_string(rows));
  return points > 2 ? rows / points : rows - 1;
}

/// Rows of consecutive motions of a path: of straight ones, every waypoint twice, except for the first and the last.
template <class T>
class MotionRows {
 public:
  /// \param path rows of the waypoints, or of the control points of all segments
  /// \param each numbers or poses of a row
  MotionRows(std::span<const T> path, std::size_t each, std::size_t points, std::size_t first, std::size_t last) {
    const std::size_t step = points > 2 ? points * each : each;
    if (each == 0) return;
    if (points > 2 || last - first == 1) {
      rows_ = path.subspan(first * step, (last - first) * points * each);
      return;
    }
    for (std::size_t k = first; k < last; ++k) {
      const std::span<const T> ends = path.subspan(k * each, 2 * each);
      copy_.insert(copy_.end(), ends.begin(), ends.end());
    }
    rows_ = copy_;
  }
  MotionRows(const MotionRows&) = delete;
  MotionRows& operator=(const MotionRows&) = delete;
  std::span<const T> rows() const { return rows_; }

 private:
  std::vector<T> copy_;
  std::span<const T> rows_;
};

/// Motions [first, last) of a path.
class Part {
 public:
  /// \param path must outlive this
  Part(const Query& path, std::size_t first, std::size_t last)
      : positions_(path.positions, path.joints.size(), path.control_points, first, last),
        poses_(path.configurations, path.bodies.size(), path.control_points, first, last),
        growths_(path.growths, path.growths.empty() ? 0 : path.bodies.size(), path.control_points, first, last),
        path_(path) {}

  std::span<const double> positions() const { return positions_.rows(); }
  /// Refers to this.
  Query query(std::uint32_t fields) const {
    Query query = as_motions_of_path(path_, fields);
    query.positions = positions_.rows();
    query.configurations = poses_.rows();
    query.growths = growths_.rows();
    return query;
  }

 private:
  MotionRows<double> positions_;
  MotionRows<Pose7> poses_;
  MotionRows<double> growths_;
  const Query& path_;
};

/// First waypoint, or segment of a curve, at which each joint is beyond its limits.
inline std::vector<LimitViolation> first_violations(const Query& path, const JointsInfo& info) {
  std::vector<LimitViolation> violations;
  const std::size_t each = path.joints.size(), points = path.control_points > 2 ? path.control_points : 1;
  for (std::size_t j = 0; j < each; ++j) {
    const JointLimits limits{info.joints.at(path.joints[j]).lower, info.joints.at(path.joints[j]).upper};
    for (std::size_t k = 0; k * points * each < path.positions.size(); ++k) {
      const std::optional<double> position =
          position_beyond(path.positions.subspan(k * points * each + j), each, points, limits);
      if (!position) continue;
      violations.push_back({k, path.joints[j], *position, limits});
      break;
    }
  }
  return violations;
}

/// Describes a motion that is not proved free.
inline void describe_stop(const Result& details, std::size_t motion, PathCheck& check) {
  const double time = details.time()[0];
  check.free = false;
  check.index = motion;
  check.t = std::isnan(time) ? details.first_contact()[0] : time;
  check.pair = details.pair()[0];
  check.status = details.status()[0];
}

}  // namespace path_check

/// Answers check_path(): requests verdicts, and details of the first motion without a proof alone.
/// \param distances answers a query
/// \param joints returns a pointer to JointsInfo with the limits, for a result
template <class Distances, class JointsAt>
PathCheck check_path_with(const Query& path, Distances&& distances, JointsAt&& joints) {
  const std::size_t count = path_check::motion_count(path);
  PathCheck check;
  std::size_t room = path_check::kFirstMotions;
  for (std::size_t first = 0; first < count;) {
    const std::size_t last = std::min(first + room, count);
    const path_check::Part part(path, first, last);
    const Result verdicts = distances(part.query(kFieldVerdict));
    if (first == 0 && !path.joints.empty())
      check.limit_violations = path_check::first_violations(path, *joints(verdicts));
    if (verdicts.all_free()) {
      first = last;
      room = std::min(2 * room, path_check::kMostMotions);
      continue;
    }
    const auto verdict = verdicts.verdict();
    first += static_cast<std::size_t>(std::ranges::find_if(verdict, [](Status s) { return s != Status::kBeyond; }) -
                                      verdict.begin());
    const path_check::Part motion(path, first, first + 1);
    const Result details = distances(motion.query(path_check::kDetails));
    if (details.status()[0] != Status::kBeyond) {
      path_check::describe_stop(details, first, check);
      return check;
    }
    ++first;
  }
  return check;
}

/// A query of check_path() with copies of its ids, pairs and margins, for another path in each run; as Prepared.
class PreparedPath {
 public:
  /// Created by Engine::prepare_path() and Client::prepare_path().
  /// \param front an Engine or a Client
  /// \param joints of the scene, if the query has joints
  template <class Queried>
  PreparedPath(Queried& front, const Query& query, JointsInfo joints)
      : verdicts_(front.prepare(path_check::as_motions_of_path(query, kFieldVerdict))),
        details_(front.prepare(path_check::as_motions_of_path(query, path_check::kDetails))),
        info_(std::move(joints)),
        bodies_(query.bodies.begin(), query.bodies.end()),
        joints_(query.joints.begin(), query.joints.end()),
        control_points_(query.control_points) {}

  /// Returns the result of check_path() for these waypoints, or control points. Throws as it does, and StaleQuery.
  PathCheck run(const Prepared::Inputs& path) {
    if (!path.velocities.empty() || !path.twists.empty())
      throw std::invalid_argument("check_path: velocities and twists are for distances");
    Query query;
    query.bodies = bodies_;
    query.joints = joints_;
    query.control_points = control_points_;
    query.positions = path.positions;
    query.configurations = path.configurations;
    query.growths = path.growths;
    return check_path_with(
        query,
        [this](const Query& motions) {
          Prepared& prepared = motions.fields == kFieldVerdict ? verdicts_ : details_;
          return prepared.run({motions.positions, motions.configurations, motions.growths});
        },
        [this](const Result&) { return &info_; });
  }
  /// \param positions (N, J) waypoints, or (K (D + 1), J) control points, of the query's joints
  PathCheck run(std::span<const double> positions) { return run(Prepared::Inputs{positions, {}}); }
  /// \param configurations (N, M) waypoints of the query's bodies
  PathCheck run(std::span<const Pose7> configurations) { return run(Prepared::Inputs{{}, configurations}); }

  /// Whether run() would throw StaleQuery, as far as a client knows the scene.
  bool is_stale() const { return verdicts_.is_stale(); }

 private:
  Prepared verdicts_, details_;
  JointsInfo info_;
  std::vector<std::uint32_t> bodies_, joints_;
  std::uint32_t control_points_;
};

}  // namespace clearance
