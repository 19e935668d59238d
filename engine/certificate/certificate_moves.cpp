#include "engine/certificate/certificate_moves.h"

namespace clearance {

namespace {

using Json = nlohmann::ordered_json;

Json vector_json(const Vec3d& v) {
  return Json::array({v.x, v.y, v.z});
}

// A rotation about, or translation along, an axis of any length by multiplier * position of `column` + offset.
Json move(const Vec3d& axis, bool turns, double offset) {
  return {{"axis", vector_json(axis)}, {"turns", turns},  {"column", nullptr}, {"stands", 0},
          {"multiplier", 0},           {"offset", offset}};
}

}  // namespace

Json moves_of(const RobotJoint& joint, const SceneRobot& robot, std::span<const double> stands) {
  const Origin& X = joint.X_pj;
  Json moves = Json::array();
  constexpr Vec3d kAxes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int k = 2; k >= 0; --k)  // yaw, pitch, roll
    if (X.rpy[k] != 0) moves.push_back(move(kAxes[k], true, X.rpy[k]));
  const std::uint32_t first = joint.mimic ? robot.model.joints[joint.mimic->joint].column : joint.column;
  const auto add = [&](const Vec3d& axis, bool turns, std::uint32_t column) {
    Json one = move(axis, turns, joint.mimic ? joint.mimic->offset : 0);
    one["multiplier"] = joint.mimic ? joint.mimic->multiplier : 1;
    one["column"] = robot.first_joint + column;
    one["stands"] = stands[robot.first_joint + column];
    moves.push_back(std::move(one));
  };
  if (joint.kind == JointKind::kRevolute || joint.kind == JointKind::kContinuous) add(joint.axis, true, first);
  if (joint.kind == JointKind::kPrismatic) add(joint.axis, false, first);
  if (joint.kind == JointKind::kPlanar) {
    add(kAxes[0], false, first);
    add(kAxes[1], false, first + 1);
    add(joint.axis, true, first + 2);
  }
  return moves;
}

}  // namespace clearance
