// A robot among shapes of every kind. Included by the tests of decisions.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/pose/pose.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/decision/ball_scene.h"

namespace clearance::exact {

/// A robot in a state, with shapes near it: each at nearly the same distance from the ball that reaches farthest in a
/// random direction.
class AmongShapes {
 public:
  /// \param links number of its links
  /// \param kinds indices of near_shapes()
  /// \param carries whether links carry some of the shapes
  AmongShapes(const BallScene& robot, std::size_t links, std::vector<double> q, const std::vector<std::size_t>& kinds,
              bool carries, Random& random)
      : made(robot), positions(std::move(q)), links_(links), frames_(made.frames(positions)) {
    const double gap = random.uniform(0.005, 0.15);
    for (const std::size_t kind : kinds) {
      const bool carried = carries && kind != kExactGaps - 1 && random.chance(0.5);
      add(kind, gap + random.log_uniform(1e-6, 0.01), carried, random);
    }
  }

  BallScene made;
  std::vector<double> positions;
  std::vector<BodyPair> pairs;       ///< of links and shapes
  std::vector<std::size_t> kind_of;  ///< likewise
  std::vector<bool> is_carried;      ///< likewise

 private:
  struct Farthest {
    std::size_t link;
    Vec3d centre;
    double radius;
  };
  static Vec3d rounded(const test::RealVec& p) { return {double(p.x[0]), double(p.x[1]), double(p.x[2])}; }

  Farthest farthest(const Vec3d& direction) const {
    Farthest found{};
    double most = -HUGE_VAL;
    for (std::size_t l = 1; l <= links_; ++l)
      for (const OneBall& ball : made.balls(made.link(l))) {
        const Vec3d centre = rounded(point_of(frames_[made.link(l)], ball.centre));
        const double along = dot(centre, direction) + ball.radius;
        if (along > most) most = along, found = {l, centre, ball.radius};
      }
    return found;
  }
  void add(std::size_t kind, double gap, bool carried, Random& random) {
    const NearShape& shape = near_shapes()[kind];
    const Vec3d direction = random.direction();
    const Farthest from = farthest(direction);
    std::size_t carrier = 0;
    while (carried && (carrier == 0 || carrier == from.link))
      carrier = static_cast<std::size_t>(random.integer(1, static_cast<int>(links_)));
    const test::RealFrame& frame = frames_[made.link(carrier)];
    Pose X = kind == kExactGaps - 1 ? facing(-direction) : random.rotation();
    Mat3d R_lw = Mat3d::identity();  // of the carrier
    for (int i = 0; carried && i < 3; ++i)
      R_lw.row[i] = {double(frame.R[0][i]), double(frame.R[1][i]), double(frame.R[2][i])};
    const Mat3d R_ws = R_lw.transpose_times(rotation_of(X));
    double low = 0, high = 4;  // from the centre of the ball
    for (int n = 0; n < 60; ++n) {
      const double way = (low + high) / 2;
      (shape.distance(R_ws.transpose_times(direction * -way)) < from.radius + gap ? low : high) = way;
    }
    const Vec3d at = from.centre + direction * high;
    X.translation = carried ? R_lw * (at - rounded(frame.t)) : at;
    const std::uint32_t body = made.add_shape(shape, X, carried ? "r/l" + std::to_string(carrier) : "");
    for (std::size_t l = 1; l <= links_; ++l) {
      if (carried && l == carrier) continue;
      pairs.push_back({made.link(l), body});
      kind_of.push_back(kind);
      is_carried.push_back(carried);
    }
  }
  // Turns z to a direction.
  static Pose facing(const Vec3d& z) {
    const Vec3d axis = cross(Vec3d{0, 0, 1}, z);
    const double w = 1 + z.z, length = std::sqrt(w * w + dot(axis, axis));
    return Pose{{0, 0, 0}, w / length, axis.x / length, axis.y / length, axis.z / length};
  }

  std::size_t links_;
  std::vector<test::RealFrame> frames_;
};

}  // namespace clearance::exact
