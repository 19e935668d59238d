#define CLEARANCE_ISA lanes_avx2
#include "engine/narrow/lanes/lanes_kernel.h"

namespace clearance {

void run_lanes_avx2(const LaneBatch& batch) {
  lanes_avx2::run_in_lanes<double>(batch);
}
void run_f32_lanes_avx2(const LaneBatch& batch) {
  lanes_avx2::run_in_lanes<float>(batch);
}
extern const int kLanes_avx2 = lanes_avx2::Pack<double>::kLanes;

}  // namespace clearance
