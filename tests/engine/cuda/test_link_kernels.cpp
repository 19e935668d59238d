// The kernel that computes link frames from joint positions (engine/cuda/place/link_kernel.cuh) and the one that places
// bodies by them, emulated on the host: they must give the CPU's bits. No GPU needed.
#include <functional>

#include "engine/selection/body_poses.h"
#include "engine/selection/configuration_poses.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/cuda/same_answer.h"
// After all other headers.
#include "tests/engine/cuda/emulated_scene.h"
#include "tests/source_file.h"

#define cuda emulated
#include "engine/cuda/pair/pair_kernel.cuh"
#undef cuda

namespace clearance::test {
namespace {

const std::string kEveryJoint = source_file("tests/engine/robot/every_joint.urdf");

// Two robots with joints of every kind, the second with positions only from queries; an arm in the hand of the first,
// which holds a ball; and a box on that hand.
engine::Scene robots() {
  engine::Scene scene;
  scene.add_sphere("cart", 0.2, {.pose = Pose{{0.1, -0.3, 0.2}, 0.9, 0.1, -0.3, 0.2}});
  engine::RobotOptions options;
  options.urdf = kEveryJoint;
  options.geometry_files.emplace();  // frames
  options.parent = "cart";
  options.home = {{"lift", 0.7}, {"turn", 0.3}};  // lift is beyond its limits
  scene.add_robot("one", options);
  options.home.reset();
  options.parent.clear();
  scene.add_robot("two", options);
  options = at_home();
  options.parent = "one/hand";
  scene.add_robot("arm", options);
  scene.add_box("box", {0.1, 0.2, 0.3}, {.parent = "one/hand", .pose = Pose{{0, 0.1, 0}, 1, 0.5, 0, 0}});
  scene.add_sphere("ball", 0.1, {.parent = "arm/flange", .pose = Pose{{0, 0, 0.1}}});
  return scene;
}

struct Seen {
  std::uint64_t placed = 0, beyond_limits = 0, bad = 0, unplaced = 0, travels = 0;
};

// Moves these joints, and the cart.
class Moved {
 public:
  Moved(engine::Scene s, std::vector<std::uint32_t> moving, std::uint32_t configurations, std::uint64_t seed)
      : scene_(std::move(s)), joints_(std::move(moving)), K_(configurations) {
    Random random(seed);
    bodies_.push_back(scene_.find_body("cart"));
    for (std::uint32_t k = 0; k < K_; ++k) {
      poses_.push_back(random.pose(2));
      for (const std::uint32_t j : joints_) positions_.push_back(position(scene_.joints()[j], random));
    }
  }
  double& at(std::uint32_t k, std::size_t joint) { return positions_[k * joints_.size() + joint]; }
  const engine::Scene& scene() const { return scene_; }

  Seen compare() const {
    QueryView q;
    q.bodies = bodies_;
    q.joints = joints_;
    q.configurations = poses_;
    q.positions = positions_;
    q.configuration_count = K_;
    const HullArrays hulls(scene_, kMostShared);
    const HostBodies device(scene_, hulls.view(), q, true);
    ConfigurationPoses poses(device.plan);
    BodyPoses placement(scene_, device.plan, {});
    std::vector<Mat3d> rotations(device.plan.bodies.size());
    Seen seen;
    for (std::uint32_t k = 0; k < K_; ++k) {
      const ConfigurationPoses::PoseBlock given = poses.at(k, 1);
      compare_given(device, given, k, seen);
      rotations_of(given.poses, rotations);
      placement.configure(k, given, rotations);
      for (std::uint32_t slot = 0; slot < device.plan.moved.size(); ++slot)
        compare_placed(device, placement[device.plan.moved[slot]], slot, k, seen);
    }
    return seen;
  }

 private:
  // Sometimes beyond its limits.
  static double position(const SceneJoint& joint, Random& random) {
    const double middle = std::isfinite(joint.lower) ? 0.5 * (joint.lower + joint.upper) : 0,
                 half = std::isfinite(joint.lower) ? 0.5 * (joint.upper - joint.lower) : 3;
    return random.uniform(middle - 1.02 * half, middle + 1.02 * half);
  }

  void compare_given(const HostBodies& device, const ConfigurationPoses::PoseBlock& cpu, std::uint32_t k,
                     Seen& seen) const {
    const Plan& plan = device.plan;
    constexpr int kSaid = kLinkUnplaced | kLinkBeyondLimits;
    for (std::size_t m = 0; m < plan.bodies.size(); ++m) {
      const auto slot = static_cast<std::uint32_t>(std::find(plan.moved.begin(), plan.moved.end(), plan.bodies[m]) -
                                                   plan.moved.begin());
      const auto [pose, facts] = local_pose(device.moves, slot, k, K_);
      const std::string what = scene_.bodies()[plan.bodies[m]].name + " in configuration " + std::to_string(k);
      EXPECT_EQ(facts & kSaid, cpu.facts[m] & kSaid) << what;
      const Pose& wanted = cpu.poses[m];
      for (int i = 0; i < 3; ++i) EXPECT_TRUE(same_bits(pose.translation[i], wanted.translation[i])) << what;
      EXPECT_TRUE(same_bits(pose.qw, wanted.qw) && same_bits(pose.qx, wanted.qx) && same_bits(pose.qy, wanted.qy) &&
                  same_bits(pose.qz, wanted.qz))
          << what;
    }
    std::size_t m = plan.given_bodies;
    for (std::uint32_t which = 0; which < plan.motions.size(); ++which)
      for (std::size_t i = 0; i < plan.motions[which].links().size(); ++i, ++m) {
        const auto slot = static_cast<std::uint32_t>(std::find(plan.moved.begin(), plan.moved.end(), plan.bodies[m]) -
                                                     plan.moved.begin());
        const std::uint32_t frame = device.moves.source[slot] - device.moves.given_count;
        EXPECT_TRUE(same_bits(travel_to(device.moves.frames, which, frame, k), cpu.travels[m])) << m << ", " << k;
        seen.travels += cpu.travels[m] > 0;
      }
  }
  void compare_placed(const HostBodies& device, const BodyPlacement& cpu, std::uint32_t slot, std::uint32_t k,
                      Seen& seen) const {
    const BodyPoseRef at(device.view, K_, slot | kMovedBit, k);
    const std::string what = scene_.bodies()[device.plan.moved[slot]].name + " in configuration " + std::to_string(k);
    EXPECT_EQ(at.status(), cpu.status) << what;
    EXPECT_EQ((at.state & kStateBeyondLimits) != 0, cpu.beyond_limits) << what;
    seen.bad += cpu.status == Status::kBadPose;
    seen.unplaced += cpu.status == Status::kNoPose;
    if (cpu.status != Status::kOk) return;
    ++seen.placed;
    seen.beyond_limits += cpu.beyond_limits;
    for (int i = 0; i < 3; ++i) {
      EXPECT_TRUE(same_bits(at.translation()[i], cpu.pose.t_w[i])) << what;
      for (int j = 0; j < 3; ++j) EXPECT_TRUE(same_bits(at.rotation().row[i][j], cpu.pose.R_wb.row[i][j])) << what;
    }
  }

  engine::Scene scene_;
  std::vector<std::uint32_t> joints_, bodies_;
  std::uint32_t K_;
  std::vector<Pose> poses_;
  std::vector<double> positions_;
};

std::vector<std::uint32_t> joints_where(const engine::Scene& scene,
                                        const std::function<bool(const std::string&)>& wanted) {
  std::vector<std::uint32_t> joints;
  for (std::uint32_t j = 0; j < scene.joints().size(); ++j)
    if (wanted(scene.joints()[j].name)) joints.insert(joints.begin() + (j % 3 ? 0 : joints.size() / 2), j);
  return joints;
}

TEST(LinkKernels, PutLinksWhereTheCpuPutsThem) {
  const auto all = [](const std::string&) { return true; };
  Moved moved(robots(), joints_where(robots(), all), 60, 5);
  const Seen seen = moved.compare();
  EXPECT_GT(seen.placed, 60u * 20);
  EXPECT_GT(seen.beyond_limits, 100u);
  EXPECT_EQ(seen.bad, 0u);
  EXPECT_GT(seen.travels, 60u * 2) << "joints that slide";
}

// Some joints are fixed: within their limits, beyond them, and without a position.
TEST(LinkKernels, KnowOfTheJointsThatStay) {
  for (const std::string name : {"turn", "roll", "lift", "drive", "grip_left"}) {
    const auto wanted = [&](const std::string& joint) {
      return joint.find("/" + name) != std::string::npos || joint == "arm/joint3";
    };
    Moved moved(robots(), joints_where(robots(), wanted), 10, 6);
    const Seen seen = moved.compare();
    EXPECT_GT(seen.placed, 10u) << name;
    if (name != "drive") {
      EXPECT_GT(seen.unplaced, 0u) << name << ": of the second robot, whose other joints are nowhere";
    }
  }
}

TEST(LinkKernels, SayWhichPositionsAreNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> bad{nan, 1e7, -1.1e6, std::numeric_limits<double>::infinity()};
  const auto all = [](const std::string&) { return true; };
  const std::vector<std::uint32_t> joints = joints_where(robots(), all);
  Moved moved(robots(), joints, static_cast<std::uint32_t>(joints.size()) + 1, 7);
  for (std::size_t j = 0; j < joints.size(); ++j) moved.at(static_cast<std::uint32_t>(j), j) = bad[j % bad.size()];
  // A mimic joint that its leader takes out of range: -q + 1e-3.
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (moved.scene().joints()[joints[j]].name == "one/grip_left")
      moved.at(static_cast<std::uint32_t>(joints.size()), j) = -1e6;
  const Seen seen = moved.compare();
  EXPECT_GT(seen.bad, 50u);
  EXPECT_GT(seen.placed, 200u);
}

}  // namespace
}  // namespace clearance::test
