// Motion queries for tests, and checks by sampling them as single configurations.
#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "tests/engine/engine_test_util.h"

namespace clearance::test {

inline constexpr double kInf = std::numeric_limits<double>::infinity();
/// The columns most tests read, including first contact, which has a search of its own.
inline constexpr std::uint32_t kMotionAnswer =
    kDefaultFields | kFieldFlags | kFieldPair | kFieldPairLower | kFieldConfiguration | kMotionFields | kFieldPoints;

/// Straight lines or curves of some joints and bodies, which may grow.
struct Motions {
  std::vector<std::uint32_t> joints, bodies;
  std::vector<BodyPair> pairs;    ///< all if empty
  std::vector<double> positions;  ///< (points K, J): start, end, start, end ... of straight lines
  std::vector<Pose> poses;        ///< (points K, M)
  std::vector<double> growths;    ///< likewise, or empty
  std::uint32_t points = 2;       ///< of each motion: control points

  std::uint32_t count() const {
    return static_cast<std::uint32_t>(joints.empty() ? poses.size() / (points * bodies.size())
                                                     : positions.size() / (points * joints.size()));
  }
  QueryView view(Reduce reduce, std::uint32_t max_evaluations = 256) const {
    QueryView query;
    query.pairs = pairs;
    query.all_pairs = pairs.empty();
    query.joints = joints;
    query.positions = positions;
    query.bodies = bodies;
    query.configurations = poses;
    query.growths = growths;
    query.configuration_count = points * count();
    query.control_points = points;
    query.reduce = reduce;
    query.max_evaluations = max_evaluations;
    query.abs_tol = reduce == Reduce::kAny ? 0 : 1e-3;
    query.rel_tol = reduce == Reduce::kAny ? 1e-6 : 0;
    query.fields = kMotionAnswer;
    return query;
  }
};

inline engine::Engine engine_of(engine::Scene scene, int threads = 2) {
  return engine::Engine(std::move(scene), {.backend = "cpu", .threads = threads, .covers = engine::Covers::kOff});
}

/// A ball that flies past another at a known distance.
struct Flight {
  engine::Scene scene;
  Motions motions;

  Flight() {
    scene.add_sphere("still", 0.1, {.is_static = true, .pose = Pose{}});
    motions.bodies = {scene.add_sphere("ball", 0.05, {.pose = Pose{{3, 0, 0}}})};
  }
  void add(const Vec3d& from, const Vec3d& to) {
    motions.poses.push_back(Pose{from});
    motions.poses.push_back(Pose{to});
  }
};

/// The same motion at n + 1 times, as configurations. For joints alone the poses are those of the motion, apart from
/// rounding.
struct Samples {
  std::vector<double> positions;
  std::uint32_t count;

  Samples(const Motions& motions, std::uint32_t motion, std::uint32_t n) : count(n + 1) {
    const std::size_t joints = motions.joints.size();
    const double* const start = motions.positions.data() + 2 * motion * joints;
    for (std::uint32_t i = 0; i <= n; ++i) add(start, joints, static_cast<double>(i) / n);
  }
  Samples(const Motions& motions, std::uint32_t motion, double time) : count(1) {
    const std::size_t joints = motions.joints.size();
    add(motions.positions.data() + 2 * motion * joints, joints, time);
  }
  QueryView view(const Motions& motions, Reduce reduce) const {
    QueryView query;
    query.pairs = motions.pairs;
    query.all_pairs = motions.pairs.empty();
    query.joints = motions.joints;
    query.positions = positions;
    query.configuration_count = count;
    query.reduce = reduce;
    return query;
  }

 private:
  void add(const double* start, std::size_t joints, double t) {
    for (std::size_t j = 0; j < joints; ++j) positions.push_back(start[j] + t * (start[joints + j] - start[j]));
  }
};

}  // namespace clearance::test
