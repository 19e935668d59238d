#define CLEARANCE_ISA lanes_kinematics_avx2
#include "engine/robot/lanes_kinematics.h"

namespace clearance {

void run_lanes_kinematics_avx2(const KinematicBatch& batch) {
  place_batch<lanes_kinematics_avx2::Pack<double>, lanes_kinematics_avx2::PackIo>(batch);
}

}  // namespace clearance
