// Selects joints by name.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "wire/api/scene_info.h"
#include "wire/api/unknown_name.h"

namespace clearance {

/// Returns the joints of a group, a single joint, or all joints ("*"). Throws std::invalid_argument for an unknown name.
inline Joints joints_named(const JointsInfo& info, std::string_view name) {
  Joints joints;
  const auto add = [&](std::uint32_t id) {
    const JointInfo& joint = info.joints.at(id);
    joints.names.push_back(joint.name);
    joints.ids.push_back(id);
    joints.limits.push_back({joint.lower, joint.upper});
  };
  const auto group = std::ranges::find(info.groups, name, &JointGroupInfo::name);
  const auto joint = std::ranges::find(info.joints, name, &JointInfo::name);
  if (group != info.groups.end())
    std::ranges::for_each(group->joints, add);
  else if (joint != info.joints.end())
    add(static_cast<std::uint32_t>(joint - info.joints.begin()));
  else if (name == "*")
    for (std::uint32_t id = 0; id < info.joints.size(); ++id) add(id);
  else
    unknown_name("robot or group of joints", name, info.groups);
  return joints;
}

}  // namespace clearance
