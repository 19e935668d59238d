#define CLEARANCE_ISA lanes_avx512
#include "engine/narrow/lanes/lanes_kernel.h"

namespace clearance {

void run_lanes_avx512(const LaneBatch& batch) {
  lanes_avx512::run_in_lanes<double>(batch);
}
void run_f32_lanes_avx512(const LaneBatch& batch) {
  lanes_avx512::run_in_lanes<float>(batch);
}
extern const int kLanes_avx512 = lanes_avx512::Pack<double>::kLanes;

}  // namespace clearance
