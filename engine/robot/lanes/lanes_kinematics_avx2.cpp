#define CLEARANCE_ISA lanes_kinematics_avx2
#include "engine/robot/lane_kinematics.h"
#include "engine/robot/lanes/lanes_kinematics.h"

namespace clearance {

extern const KinematicFunctions kKinematicsAvx2;  // kinematics.cpp
constexpr KinematicFunctions kKinematicsAvx2 =
    kinematic_functions<lanes_kinematics_avx2::Pack<double>, lanes_kinematics_avx2::PackIo>();
extern const LaneFunctions kLaneFunctionsAvx2;  // lane_kinematics.cpp
constexpr LaneFunctions kLaneFunctionsAvx2 =
    lane_functions<lanes_kinematics_avx2::Pack<double>, lanes_kinematics_avx2::PackIo>();

}  // namespace clearance
