#include "engine/decision/table_plan.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace clearance {

namespace {

constexpr double kUpwards = 1 + 0x1p-40;  // more than the rounding of the sums below

// Where the columns of a pair are. Returns false for a column that neither moves nor has a position.
bool find_columns(const LinkMotion& motion, TabledPair& pair) {
  const auto& moving = motion.moving();
  for (int c = 0; c < 2; ++c) {
    pair.at[c] = kNone;
    pair.fixed[c] = 0;
    if (pair.table.columns[c].shift == 0) continue;  // the second column of a table for one joint
    const std::uint32_t column = pair.table.columns[c].column;
    const auto it = std::find_if(moving.begin(), moving.end(), [&](const auto& m) { return m.column == column; });
    if (it != moving.end())
      pair.at[c] = it->at;
    else if (motion.column_facts()[column] & (kLinkUnplaced | kLinkBad))
      return false;
    else
      pair.fixed[c] = motion.positions()[column];
  }
  return true;
}

// The greatest cell bound that is at most a length.
std::int32_t cells_below(double length) {
  const double units = std::floor(length / JointTable::kUnit - 0x1p-20);
  return static_cast<std::int32_t>(std::clamp<double>(units, TableCell::kNoLow, TableCell::kNoHigh));
}

}  // namespace

TablePlan::TablePlan(const engine::Scene& scene, const Plan& plan, const SlackBounds& slack,
                     const JointTableStore* tables) {
  if (!tables) return;
  for (std::uint64_t p = 0; p < plan.pairs.size() && pairs_.size() < kMostTabledPairs; ++p)
    take(scene, plan, slack, *tables, p);
}

// Exact joints give the distance that the table bounds, and the slack is that of the bodies from their parts there: it
// includes the rounding of joints, which the table's bounds do not need.
void TablePlan::take(const engine::Scene& scene, const Plan& plan, const SlackBounds& slack,
                     const JointTableStore& tables, std::uint64_t position) {
  const BodyPair bodies = plan.pairs.at(position);
  if (bodies.a >= scene.bodies().size() || bodies.b >= scene.bodies().size()) return;
  const Body &a = scene.bodies()[bodies.a], &b = scene.bodies()[bodies.b];
  if (a.robot == kNone || a.robot != b.robot) return;
  const SceneRobot& robot = *scene.robots()[a.robot];
  const auto motion =
      std::find_if(plan.motions.begin(), plan.motions.end(), [&](const LinkMotion& m) { return &m.robot() == &robot; });
  if (motion == plan.motions.end()) return;
  std::shared_ptr<const JointTable> table = tables.find(robot, a, b);
  if (!table) return;
  TabledPair pair{};
  pair.table = table->view();
  if (!find_columns(*motion, pair)) return;
  const double margin = plan.margins.of(position);
  const Slack of_pair = slack.of(bodies);
  // -floor(-x): the least cell bound that is at least the length.
  pair.free_above = -cells_below(-(margin + of_pair.inner) * kUpwards);
  pair.hit_below = cells_below(margin - of_pair.outer * kUpwards);
  pair.position = position;
  if (of_position_.empty()) of_position_.assign(plan.pairs.size(), kNoTable);
  of_position_[position] = static_cast<std::uint8_t>(pairs_.size());
  pairs_.push_back(pair);
  tables_.push_back(std::move(table));
}

}  // namespace clearance
