#define CLEARANCE_ISA lanes_kinematics_baseline
#include "engine/robot/lane_kinematics.h"
#include "engine/robot/lanes/lanes_kinematics.h"

namespace clearance {

extern const KinematicFunctions kKinematicsBaseline;  // kinematics.cpp
constexpr KinematicFunctions kKinematicsBaseline =
    kinematic_functions<lanes_kinematics_baseline::Pack<double>, lanes_kinematics_baseline::PackIo>();
extern const LaneFunctions kLaneFunctionsBaseline;  // lane_kinematics.cpp
constexpr LaneFunctions kLaneFunctionsBaseline =
    lane_functions<lanes_kinematics_baseline::Pack<double>, lanes_kinematics_baseline::PackIo>();

}  // namespace clearance
