#define CLEARANCE_ISA decide_avx2
#include "engine/decision/kernel/bound_distances.h"
#include "engine/decision/kernel/decide_kernel.h"

namespace clearance {

void run_decide_avx2(const DecisionBatch& batch, const DecisionRoom& room) {
  decide_avx2::decide(batch, room);
}

void run_decide_spans_avx2(const SpanBatch& batch) {
  decide_avx2::decide_spans(batch);
}

GuessedHit guess_hit_avx2(const HitGuess& guess) {
  return decide_avx2::guess_hit(guess);
}

void run_distances_avx2(const DistanceBatch& batch, const DistanceRoom& room) {
  decide_avx2::bound_distances(batch, room);
}

}  // namespace clearance
