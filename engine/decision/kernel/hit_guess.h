// Tries balls that hit obstacles in other motions. Included by decide_kernel.h.
#pragma once

#include <cmath>

#include "engine/decision/kernel/cloud_gaps.h"
#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// One body in up to eight states, which are the lanes.
class BodyInStates {
 public:
  /// \param frame (7, 8) of the body
  explicit BodyInStates(const double* frame) {
    alignas(32) float parts[7][kBalls];
    for (int i = 0; i < 7; ++i)
      for (int k = 0; k < kBalls; ++k) parts[i][k] = static_cast<float>(frame[i * kBalls + k]);
    rotations(Eight::load(parts[0]), Eight::load(parts[1]), Eight::load(parts[2]), Eight::load(parts[3]),
              [&](int i, const Eight& value) { R_[i] = value; });
    for (int i = 0; i < 3; ++i) t_[i] = Eight::load(parts[4 + i]);
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

/// States in which a body is no farther than its bounds allow.
inline Bits usable_states(const HitGuess& guess, const DecidedBody& body, const double* frame) {
  Bits usable = 0;
  for (std::size_t k = 0; k < guess.states; ++k) {
    const auto is_near = [&](int i) { return std::abs(frame[i * kBalls + static_cast<int>(k)]) <= body.farthest; };
    if (is_near(4) && is_near(5) && is_near(6)) usable |= Bits{1} << k;
  }
  return usable;
}

/// Computes a ball's centre and gap as the decision of a state does, which proves the hit.
inline GuessedHit guess_hit(const HitGuess& guess) {
  const DecisionView& view = *guess.view;
  for (const BallHit& hit : guess.hits) {
    const BallPacket& packet = view.bodies[hit.body].packets[hit.packet];
    const double* const frame = guess.frames[hit.body];
    Centres c;
    BodyInStates(frame).place(packet.x[hit.ball], packet.y[hit.ball], packet.z[hit.ball], c);
    const Eight inner(packet.inner[hit.ball] + view.shrink[std::size_t{hit.obstacle} * view.columns + hit.body]);
    PointGaps gaps;
    obstacle_gaps(view.obstacles[hit.obstacle], c.x, c.y, c.z, {inner, inner, inner}, gaps);
    Bits in = greater(inner, Eight::load(gaps.high));
    if (in) in &= usable_states(guess, view.bodies[hit.body], frame);
    if (in) return {&hit, static_cast<std::size_t>(lowest(in))};
  }
  return {};
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
