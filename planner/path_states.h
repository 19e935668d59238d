// States of a path of joints, and of bodies that move or grow meanwhile.
#pragma once

#include <clearance/prepared_path.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace clearance::path_report {

/// Quaternion at a share of the shorter way from a to b, rounded.
inline std::array<double, 4> quaternion_between(std::array<double, 4> a, std::array<double, 4> b, double t) {
  if (a == b) return a;
  const auto product = [](const auto& p, const auto& q) {
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3];
  };
  for (std::array<double, 4>* q : {&a, &b}) {
    const double length = std::sqrt(product(*q, *q));
    for (double& x : *q) x /= length;
  }
  const double cosine = product(a, b), angle = std::acos(std::min(std::abs(cosine), 1.0));
  const bool is_small = angle < 1e-8;
  const double of_a = is_small ? 1 - t : std::sin((1 - t) * angle) / std::sin(angle),
               of_b = (is_small ? t : std::sin(t * angle) / std::sin(angle)) * (cosine < 0 ? -1 : 1);
  for (std::size_t k = 0; k < 4; ++k) a[k] = of_a * a[k] + of_b * b[k];
  return a;
}

/// Everything that a path moves, at one time, rounded.
struct State {
  std::vector<double> positions;  ///< (J,) of its joints
  std::vector<Pose7> poses;       ///< (M,) of its bodies
  std::vector<double> growths;    ///< (M,) likewise, metres; empty if none grows

  /// The state of motion `index` at time t.
  State(const Query& path, std::uint64_t index, double t) {
    const path_check::Part part(path, index, index + 1);
    const Query motion = part.query(0);
    const auto number = [](double& x) -> double& { return x; };
    positions = at(motion.positions, path.joints.size(), t, number);
    growths = at(motion.growths, motion.growths.empty() ? 0 : path.bodies.size(), t, number);
    poses.assign(motion.configurations.begin(), motion.configurations.begin() + path.bodies.size());
    const std::span<const Pose7> last = motion.configurations.last(path.bodies.size());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::vector<Pose7> moved =
          at(motion.configurations, path.bodies.size(), t, [axis](Pose7& pose) -> double& { return pose[axis]; });
      for (std::size_t i = 0; i < poses.size(); ++i) poses[i][axis] = moved[i][axis];
    }
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const auto q_of = [](const Pose7& X) { return std::array{X[3], X[4], X[5], X[6]}; };
      const std::array<double, 4> q = quaternion_between(q_of(poses[i]), q_of(last[i]), t);
      std::copy(q.begin(), q.end(), poses[i].begin() + 3);
    }
  }

  /// How much the bodies of a pair are grown together, metres.
  /// \param bodies those of the path
  double growth(std::span<const std::uint32_t> bodies, const IdPair& pair) const {
    double sum = 0;
    for (std::size_t i = 0; i < growths.size(); ++i)
      if (bodies[i] == pair[0] || bodies[i] == pair[1]) sum += growths[i];
    return sum;
  }

 private:
  // Casteljau's rule for a number of each of `each` items a row.
  template <class T, class Number>
  static std::vector<T> at(std::span<const T> rows, std::size_t each, double t, const Number& number) {
    std::vector<T> state(rows.begin(), rows.end());
    for (std::size_t left = each == 0 ? 0 : state.size() - each; left > 0; left -= each)
      for (std::size_t i = 0; i < left; ++i) {
        double& x = number(state[i]);
        x += t * (number(state[i + each]) - x);
      }
    state.resize(each);
    return state;
  }
};

}  // namespace clearance::path_report
