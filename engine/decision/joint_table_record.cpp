#include "engine/decision/joint_table_record.h"

#include <algorithm>
#include <cstring>

#include "algorithm_version.h"
#include "engine/cache/cache.h"
#include "engine/cover/cover_record.h"

namespace clearance {

namespace {

void add(CacheKey& key, const Vec3d& v) {
  key.add(v.x).add(v.y).add(v.z);
}
void add(CacheKey& key, const Quaternion<double>& q) {
  key.add(q.w).add(q.x).add(q.y).add(q.z);
}

void add(CacheKey& key, const KinematicStep& step) {
  key.add(std::uint64_t{static_cast<std::uint8_t>(step.kind)}).add(std::uint64_t{step.from});
  key.add(std::uint64_t{step.link}).add(std::uint64_t{step.column}).add(std::uint64_t{step.mimics});
  key.add(step.multiplier).add(step.offset);
  add(key, step.still);
  add(key, step.turning);
  for (const Vec3d& v : {step.at, step.along[0], step.along[1]}) add(key, v);
}

}  // namespace

std::string joint_table_name(const TablePair& pair) {
  CacheKey key("joint-table", kAlgorithmVersion);
  for (const TableLink* link : {&pair.a, &pair.b}) {
    key.add(std::uint64_t{link->link}).add(cover_name(link->parts));
    add(key, link->ball.centre);
    key.add(link->ball.radius).add(link->extent);
  }
  for (const std::uint32_t root : pair.robot->kinematics.roots()) key.add(std::uint64_t{root});
  for (const KinematicStep& step : pair.robot->kinematics.steps()) add(key, step);
  for (const RobotColumn& column : pair.robot->model.columns) key.add(column.lower).add(column.upper);
  return key.name();
}

std::vector<std::byte> joint_table_record(const JointTable& table) {
  const std::span<const TableCell> cells = std::span(table.cells).first(table.level_begin(1));
  std::vector<std::byte> record(cells.size_bytes());
  std::memcpy(record.data(), cells.data(), record.size());
  return record;
}

std::optional<JointTable> joint_table_of_record(const TablePair& pair, std::span<const std::byte> record) {
  JointTable table = empty_joint_table(pair);
  if (record.size() != table.cells.size() * sizeof(TableCell)) return {};
  std::memcpy(table.cells.data(), record.data(), record.size());
  if (std::any_of(table.cells.begin(), table.cells.end(), [](TableCell cell) { return cell.low > cell.high; }))
    return {};
  table.join_cells();
  return table;
}

}  // namespace clearance
