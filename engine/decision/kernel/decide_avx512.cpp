#define CLEARANCE_ISA decide_avx512
#include "engine/decision/kernel/bound_distances.h"
#include "engine/decision/kernel/decide_kernel.h"

namespace clearance {

void run_decide_avx512(const DecisionBatch& batch, const DecisionRoom& room) {
  decide_avx512::decide(batch, room);
}

SpanDecision run_decide_span_avx512(const SpanBatch& batch) {
  return decide_avx512::decide_span(batch);
}

GuessedHit guess_hit_avx512(const HitGuess& guess) {
  return decide_avx512::guess_hit(guess);
}

void run_distances_avx512(const DistanceBatch& batch, const DistanceRoom& room) {
  decide_avx512::bound_distances(batch, room);
}

}  // namespace clearance
