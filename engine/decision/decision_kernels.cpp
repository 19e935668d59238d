#include <vector>

#include "engine/base/instruction_sets.h"
#include "engine/decision/decision_view.h"

namespace clearance {

#ifdef CLEARANCE_LANES_X86
void run_decide_avx512(const DecisionBatch&, const DecisionRoom&);
SpanDecision run_decide_span_avx512(const SpanBatch&);
void run_decide_avx2(const DecisionBatch&, const DecisionRoom&);
SpanDecision run_decide_span_avx2(const SpanBatch&);
#endif
void run_decide_baseline(const DecisionBatch&, const DecisionRoom&);
SpanDecision run_decide_span_baseline(const SpanBatch&);

std::span<const DecisionKernel> decision_kernels() {
  static const auto& kernels = *new std::vector<DecisionKernel>([] {  // queries may outlast main()
    std::vector<DecisionKernel> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back({"avx512", run_decide_avx512, run_decide_span_avx512});
    if (has_avx2_lanes()) k.push_back({"avx2", run_decide_avx2, run_decide_span_avx2});
#endif
    k.push_back({"baseline", run_decide_baseline, run_decide_span_baseline});
    return k;
  }());
  return kernels;
}

}  // namespace clearance
