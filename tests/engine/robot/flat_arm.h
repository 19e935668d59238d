// A stretched planar arm, which attains bounds that sum the reach of its joints.
#pragma once

#include "engine/robot/robot.h"

namespace clearance::test {

/// Joints one, two (mimics one in the opposite direction), out (which slides) and three, from `base` to `tip`.
inline RobotModel flat_arm() {
  return parse_urdf(R"(<robot name='flat'>
    <link name='base'/><link name='a'/><link name='b'/><link name='c'/><link name='tip'/>
    <joint name='one' type='continuous'><parent link='base'/><child link='a'/><origin xyz='0 0 0.3'/><axis xyz='0 0 1'/></joint>
    <joint name='two' type='continuous'><parent link='a'/><child link='b'/><origin xyz='0.4 0 0'/><axis xyz='0 0 -1'/>
      <mimic joint='one' multiplier='-0.5' offset='0'/></joint>
    <joint name='out' type='prismatic'><parent link='b'/><child link='c'/><origin xyz='0.3 0 0'/><axis xyz='1 0 0'/>
      <limit lower='0' upper='1'/></joint>
    <joint name='three' type='continuous'><parent link='c'/><child link='tip'/><origin xyz='0.2 0 0'/><axis xyz='0 0 1'/></joint>
    </robot>)",
                    "flat.urdf");
}

}  // namespace clearance::test
