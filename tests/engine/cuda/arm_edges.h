// Edges of an arm, some of them free.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "tests/engine/arm_scene.h"
#include "tests/engine/motion/motion_test.h"

namespace clearance::test {

/// Edges of an arm that holds a tool of two convex parts, over a table with some boxes.
struct ArmEdges {
  engine::Scene scene;
  Motions motions;

  explicit ArmEdges(std::uint64_t seed, int count, double size) {
    Random random(seed);
    engine::RobotOptions options = at_home();
    options.base = Pose{{0, 0, 0}, 1, 0, 0, 0.2};
    scene.add_box("table", {2, 2, 0.1}, {.is_static = true, .pose = Pose{{0.5, 0, -0.1}}});
    for (int i = 0; i < 6; ++i)
      scene.add_box("box" + std::to_string(i), {0.1, 0.15, 0.2},
                    {.pose = Pose{{random.uniform(0.2, 0.8), random.uniform(-0.6, 0.6), random.uniform(0, 0.9)}}});
    scene.add_robot("arm", options);
    scene.add_box("tool", {0.02, 0.02, 0.15}, {.parent = "arm/flange", .pose = Pose{{0, 0, 0.1}}});
    motions.joints = joints_of(scene, "arm");
    if (motions.joints.empty())
      for (std::uint32_t j = 0; j < scene.joints().size(); ++j) motions.joints.push_back(j);
    for (int i = 0; i < count; ++i) {
      std::vector<double> start, end;
      for (const std::uint32_t j : motions.joints) {
        const SceneJoint& joint = scene.joints()[j];
        start.push_back(random.uniform(std::max(joint.lower, -1.5), std::min(joint.upper, 1.5)));
        end.push_back(std::clamp(start.back() + size * random.uniform(-1, 1), joint.lower, joint.upper));
      }
      motions.positions.insert(motions.positions.end(), start.begin(), start.end());
      motions.positions.insert(motions.positions.end(), end.begin(), end.end());
    }
    leave_out_neighbours();
  }
  // Excludes pairs that are near at half or more of the ends, since they would decide nearly every edge.
  void leave_out_neighbours() {
    const engine::Engine cpu(engine::Scene(scene), {.backend = "cpu", .threads = 2, .covers = engine::Covers::kOff});
    QueryView ends;
    ends.joints = motions.joints;
    ends.positions = motions.positions;
    ends.configuration_count = 2 * motions.count();
    const std::vector<BodyPair> all = cpu.pairs(ends);
    const Answer at = evaluate(cpu, ends);
    for (std::size_t p = 0; p < all.size(); ++p) {
      int near = 0;
      for (std::uint32_t k = 0; k < ends.configuration_count; ++k) near += at.view.upper[k * all.size() + p] < 0.03;
      if (near < static_cast<int>(motions.count())) motions.pairs.push_back(all[p]);
    }
  }
  /// Makes every third edge end beyond a joint's limits, with its middle within them.
  void end_beyond_limits() {
    const std::size_t J = motions.joints.size();
    for (std::size_t i = 0; i < motions.count(); i += 3) {
      const std::size_t j = i % J;
      const SceneJoint& joint = scene.joints()[motions.joints[j]];
      double* const ends = motions.positions.data() + 2 * i * J + j;
      ends[J] = joint.upper + 0.01;
      ends[0] = std::max(joint.lower, joint.upper - 0.3);
    }
  }
  /// \param when whether first contact is requested, as by Python's motions()
  QueryView query(double margin, bool when, Reduce reduce = Reduce::kAny) const {
    QueryView q = motions.view(reduce);
    q.margin = margin;
    q.fields = when ? kMotionAnswer : kMotionAnswer & ~kFieldFirstContact;
    if (reduce == Reduce::kMin) q.fields &= ~kFieldPairLower;  // not supported on the device
    return q;
  }
  /// Least distance, as requested by Python's motions() without `reduce`.
  QueryView least(double margin, bool when) const { return query(margin, when, Reduce::kMin); }
};

}  // namespace clearance::test
