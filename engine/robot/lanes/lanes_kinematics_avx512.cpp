#define CLEARANCE_ISA lanes_kinematics_avx512
#include "engine/robot/lane_kinematics.h"
#include "engine/robot/lanes/lanes_kinematics.h"

namespace clearance {

extern const KinematicFunctions kKinematicsAvx512;  // kinematics.cpp
constexpr KinematicFunctions kKinematicsAvx512 =
    kinematic_functions<lanes_kinematics_avx512::Pack<double>, lanes_kinematics_avx512::PackIo>();
extern const LaneFunctions kLaneFunctionsAvx512;  // lane_kinematics.cpp
constexpr LaneFunctions kLaneFunctionsAvx512 =
    lane_functions<lanes_kinematics_avx512::Pack<double>, lanes_kinematics_avx512::PackIo>();

}  // namespace clearance
