#define CLEARANCE_ISA decide_avx512
#include "engine/decision/decide_kernel.h"

namespace clearance {

void run_decide_avx512(const DecisionBatch& batch, const DecisionRoom& room) {
  decide_avx512::decide(batch, room);
}

}  // namespace clearance
