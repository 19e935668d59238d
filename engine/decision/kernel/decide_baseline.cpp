#define CLEARANCE_ISA decide_baseline
#include "engine/decision/kernel/bound_distances.h"
#include "engine/decision/kernel/decide_kernel.h"

namespace clearance {

void run_decide_baseline(const DecisionBatch& batch, const DecisionRoom& room) {
  decide_baseline::decide(batch, room);
}

void run_decide_spans_baseline(const SpanBatch& batch) {
  decide_baseline::decide_spans(batch);
}

GuessedHit guess_hit_baseline(const HitGuess& guess) {
  return decide_baseline::guess_hit(guess);
}

void run_distances_baseline(const DistanceBatch& batch, const DistanceRoom& room) {
  decide_baseline::bound_distances(batch, room);
}

}  // namespace clearance
