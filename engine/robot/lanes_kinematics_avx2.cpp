#define CLEARANCE_ISA lanes_kinematics_avx2
#include "engine/robot/lanes_kinematics.h"

namespace clearance {

extern const KinematicFunctions kKinematicsAvx2;  // kinematics.cpp
constexpr KinematicFunctions kKinematicsAvx2 =
    kinematic_functions<lanes_kinematics_avx2::Pack<double>, lanes_kinematics_avx2::PackIo>();

}  // namespace clearance
