// Guesses where a motion hits an obstacle, from the balls that hit in others. Included by decide_kernel.h.
#pragma once

#include "engine/decision/kernel/cloud_gaps.h"
#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// One body in up to eight states, which are the lanes.
class BodyInStates {
 public:
  BodyInStates(const HitGuess& guess, std::uint32_t body) {
    const std::uint32_t at = guess.view->bodies[body].pose;
    alignas(32) float q[4][kBalls] = {}, t[3][kBalls] = {};
    for (std::size_t k = 0; k < guess.states; ++k) {
      const Pose& X = guess.poses[k * guess.stride + at];
      const double parts[7] = {X.qw, X.qx, X.qy, X.qz, X.translation.x, X.translation.y, X.translation.z};
      for (int i = 0; i < 4; ++i) q[i][k] = static_cast<float>(parts[i]);
      for (int i = 0; i < 3; ++i) t[i][k] = static_cast<float>(parts[4 + i]);
    }
    rotations(Eight::load(q[0]), Eight::load(q[1]), Eight::load(q[2]), Eight::load(q[3]),
              [&](int i, const Eight& value) { R_[i] = value; });
    for (int i = 0; i < 3; ++i) t_[i] = Eight::load(t[i]);
  }

  HWY_INLINE void place(float x, float y, float z, Centres& c) const {
    const auto coordinate = [&](int k) {
      return t_[k] + (R_[3 * k] * Eight(x) + R_[3 * k + 1] * Eight(y) + R_[3 * k + 2] * Eight(z));
    };
    coordinate(0).store(c.x);
    coordinate(1).store(c.y);
    coordinate(2).store(c.z);
  }

 private:
  Eight R_[9], t_[3];
};

inline GuessedHit guess_hit(const HitGuess& guess) {
  const DecisionView& view = *guess.view;
  for (const BallHit& hit : guess.hits) {
    const BallPacket& packet = view.bodies[hit.body].packets[hit.packet];
    Centres c;
    BodyInStates(guess, hit.body).place(packet.x[hit.ball], packet.y[hit.ball], packet.z[hit.ball], c);
    const Eight inner(packet.inner[hit.ball] + view.shrink[std::size_t{hit.obstacle} * view.columns + hit.body]);
    PointGaps gaps;
    obstacle_gaps(view.obstacles[hit.obstacle], c.x, c.y, c.z, {inner, inner, inner}, gaps);
    const Bits in = greater(inner, Eight::load(gaps.high)) & first(static_cast<std::uint32_t>(guess.states));
    if (in) return {&hit, static_cast<std::size_t>(lowest(in))};
  }
  return {};
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
