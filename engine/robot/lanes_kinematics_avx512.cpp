#define CLEARANCE_ISA lanes_kinematics_avx512
#include "engine/robot/lanes_kinematics.h"

namespace clearance {

void run_lanes_kinematics_avx512(const KinematicBatch& batch) {
  place_batch<lanes_kinematics_avx512::Pack<double>, lanes_kinematics_avx512::PackIo>(batch);
}

}  // namespace clearance
