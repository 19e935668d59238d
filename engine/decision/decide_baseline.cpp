#define CLEARANCE_ISA decide_baseline
#include "engine/decision/decide_kernel.h"

namespace clearance {

void run_decide_baseline(const DecisionBatch& batch, const DecisionRoom& room) {
  decide_baseline::decide(batch, room);
}

}  // namespace clearance
