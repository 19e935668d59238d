// The detector for MoveIt's parameter `collision_detector`.
#include <clearance_moveit/collision_env.h>

#include <moveit/collision_detection/collision_plugin.hpp>
#include <pluginlib/class_list_macros.hpp>

namespace clearance_moveit {

class Plugin : public collision_detection::CollisionPlugin {
 public:
  bool initialize(const planning_scene::PlanningScenePtr& scene) const override {
    scene->allocateCollisionDetector(CollisionDetectorAllocator::create());
    return true;
  }
};

}  // namespace clearance_moveit

PLUGINLIB_EXPORT_CLASS(clearance_moveit::Plugin, collision_detection::CollisionPlugin)
