#include <vector>

#include "engine/base/instruction_sets.h"
#include "engine/decision/kernel/distance_view.h"

namespace clearance {

#ifdef CLEARANCE_LANES_X86
void run_decide_avx512(const DecisionBatch&, const DecisionRoom&);
void run_decide_spans_avx512(const SpanBatch&);
GuessedHit guess_hit_avx512(const HitGuess&);
void run_distances_avx512(const DistanceBatch&, const DistanceRoom&);
void run_decide_avx2(const DecisionBatch&, const DecisionRoom&);
void run_decide_spans_avx2(const SpanBatch&);
GuessedHit guess_hit_avx2(const HitGuess&);
void run_distances_avx2(const DistanceBatch&, const DistanceRoom&);
#endif
void run_decide_baseline(const DecisionBatch&, const DecisionRoom&);
void run_decide_spans_baseline(const SpanBatch&);
GuessedHit guess_hit_baseline(const HitGuess&);
void run_distances_baseline(const DistanceBatch&, const DistanceRoom&);

std::span<const DecisionKernel> decision_kernels() {
  static const auto& kernels = *new std::vector<DecisionKernel>([] {  // queries may outlast main()
    std::vector<DecisionKernel> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back({"avx512", run_decide_avx512, run_decide_spans_avx512, guess_hit_avx512});
    if (has_avx2_lanes()) k.push_back({"avx2", run_decide_avx2, run_decide_spans_avx2, guess_hit_avx2});
#endif
    k.push_back({"baseline", run_decide_baseline, run_decide_spans_baseline, guess_hit_baseline});
    return k;
  }());
  return kernels;
}

std::span<const DistanceKernel> distance_kernels() {
  static const auto& kernels = *new std::vector<DistanceKernel>([] {
    std::vector<DistanceKernel> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back({"avx512", run_distances_avx512});
    if (has_avx2_lanes()) k.push_back({"avx2", run_distances_avx2});
#endif
    k.push_back({"baseline", run_distances_baseline});
    return k;
  }());
  return kernels;
}

}  // namespace clearance
