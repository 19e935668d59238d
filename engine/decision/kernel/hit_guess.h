// Tries balls that hit obstacles in other motions. Included by decide_kernel.h.
#pragma once

#include <cstddef>

#include "engine/decision/kernel/cloud_gaps.h"
#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Computes a ball's centre and gap as the decision of a state does, which proves the hit.
inline GuessedHit guess_hit(const HitGuess& guess) {
  const DecisionView& view = *guess.view;
  for (const BallHit& hit : guess.hits) {
    const BallPacket& packet = view.bodies[hit.body].packets[hit.packet];
    const double* const frame = guess.frames[hit.body];
    Centres c;
    BodyInStates(frame).place({packet.x[hit.ball], packet.y[hit.ball], packet.z[hit.ball]}, c);
    const Eight inner(packet.inner[hit.ball] + view.shrink[std::size_t{hit.obstacle} * view.columns + hit.body]);
    PointGaps gaps;
    obstacle_gaps(view.obstacles[hit.obstacle], c.x, c.y, c.z, {inner, inner, inner}, gaps);
    Bits in = greater(inner, Eight::load(gaps.high));
    if (in) in &= usable_states(view.bodies[hit.body], frame, guess.states);
    if (in) return {&hit, static_cast<std::size_t>(lowest(in))};
  }
  return {};
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
