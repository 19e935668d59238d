// check() in terms of distances(), for the engine and for clients.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "wire/api/check.h"
#include "wire/api/scene_info.h"

namespace clearance {

/// Converts the result of as_check(query), with the limits of the query's joints or, without configurations, of all
/// joints at their current positions.
/// \param joints returns a pointer to JointsInfo; its argument is whether it needs the current positions
template <class JointsAt>
Check check_with_limits(const Query& query, const Result& result, JointsAt&& joints) {
  const bool is_now = query.joints.empty() && query.configurations.empty();
  if (query.joints.empty() && !is_now) return check_of(result);
  const auto info = joints(is_now);
  std::vector<std::uint32_t> ids(query.joints.begin(), query.joints.end());
  std::vector<double> positions(query.positions.begin(), query.positions.end());
  for (std::uint32_t id = 0; is_now && id < info->joints.size(); ++id) {
    ids.push_back(id);
    positions.push_back(info->joints[id].status == Status::kOk ? info->joints[id].position : std::nan(""));
  }
  std::vector<JointLimits> limits;
  for (const std::uint32_t id : ids) limits.push_back({info->joints.at(id).lower, info->joints.at(id).upper});
  return check_of(result, ids, limits, positions);
}

}  // namespace clearance
