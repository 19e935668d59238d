#define CLEARANCE_ISA lanes_baseline
#include "engine/narrow/lanes/lanes_kernel.h"

namespace clearance {

void run_lanes_baseline(const LaneBatch& batch) {
  lanes_baseline::run_in_lanes<double>(batch);
}
void run_f32_lanes_baseline(const LaneBatch& batch) {
  lanes_baseline::run_in_lanes<float>(batch);
}
extern const int kLanes_baseline = lanes_baseline::Pack<double>::kLanes;

}  // namespace clearance
