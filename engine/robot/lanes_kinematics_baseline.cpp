#define CLEARANCE_ISA lanes_kinematics_baseline
#include "engine/robot/lanes_kinematics.h"

namespace clearance {

void run_lanes_kinematics_baseline(const KinematicBatch& batch) {
  place_batch<lanes_kinematics_baseline::Pack<double>, lanes_kinematics_baseline::PackIo>(batch);
}

}  // namespace clearance
