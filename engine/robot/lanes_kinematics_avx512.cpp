#define CLEARANCE_ISA lanes_kinematics_avx512
#include "engine/robot/lanes_kinematics.h"

namespace clearance {

extern const KinematicFunctions kKinematicsAvx512;  // kinematics.cpp
constexpr KinematicFunctions kKinematicsAvx512 =
    kinematic_functions<lanes_kinematics_avx512::Pack<double>, lanes_kinematics_avx512::PackIo>();

}  // namespace clearance
