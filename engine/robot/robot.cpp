#include "engine/robot/robot.h"

#include <algorithm>

namespace clearance {

namespace {

template <class T>
std::uint32_t index_of(const std::vector<T>& all, std::string_view name) {
  const auto at = std::find_if(all.begin(), all.end(), [&](const T& one) { return one.name == name; });
  return at == all.end() ? kNone : static_cast<std::uint32_t>(at - all.begin());
}

}  // namespace

std::uint32_t RobotModel::find_link(std::string_view link) const {
  return index_of(links, link);
}

std::uint32_t RobotModel::find_joint(std::string_view joint) const {
  return index_of(joints, joint);
}

std::uint32_t RobotModel::find_column(std::string_view column) const {
  return index_of(columns, column);
}

const RobotGroup* RobotModel::find_group(std::string_view group) const {
  const std::uint32_t at = index_of(groups, group);
  return at == kNone ? nullptr : &groups[at];
}

std::vector<std::uint32_t> RobotModel::chain_to(std::uint32_t link) const {
  std::vector<std::uint32_t> chain;
  for (std::uint32_t j = links[link].joint; j != kNone; j = links[joints[j].parent].joint) chain.push_back(j);
  std::reverse(chain.begin(), chain.end());
  return chain;
}

}  // namespace clearance
