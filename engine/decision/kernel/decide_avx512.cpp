#define CLEARANCE_ISA decide_avx512
#include "engine/decision/kernel/bound_distances.h"
#include "engine/decision/kernel/decide_kernel.h"

namespace clearance {

void run_decide_avx512(const DecisionBatch& batch, const DecisionRoom& room) {
  decide_avx512::decide(batch, room);
}

void run_decide_spans_avx512(const SpanBatch& batch) {
  decide_avx512::decide_spans(batch);
}

GuessedHit guess_hit_avx512(const HitGuess& guess) {
  return decide_avx512::guess_hit(guess);
}

void run_distances_avx512(const DistanceBatch& batch, const DistanceRoom& room) {
  decide_avx512::bound_distances(batch, room);
}

}  // namespace clearance
