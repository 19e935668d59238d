// A collision detector of MoveIt 2 whose answers are proved (docs/service/ros.md#moveit).
//
//   scene->allocateCollisionDetector(clearance_moveit::CollisionDetectorAllocator::create());
#pragma once

#include <memory>
#include <moveit/collision_detection/collision_detector_allocator.hpp>
#include <mutex>
#include <string>
#include <vector>

namespace clearance_moveit {

class Bodies;
class RobotFrames;
struct Item;
enum class Against { kSelf, kWorld };

/// Robot and world in an engine in this process. Thread-safe as long as the world and the paddings do not change.
///
/// A state that is not proved free is in collision; so is one whose request ends in an error, which is logged. Distances
/// are lower bounds, metres, and -infinity without a proof.
class CollisionEnv : public collision_detection::CollisionEnv {
 public:
  using Request = collision_detection::CollisionRequest;
  using Result = collision_detection::CollisionResult;
  using Matrix = collision_detection::AllowedCollisionMatrix;
  using DistanceRequest = collision_detection::DistanceRequest;
  using DistanceResult = collision_detection::DistanceResult;
  using State = moveit::core::RobotState;

  /// Throws std::invalid_argument for a planar or floating joint that is not the root.
  CollisionEnv(const moveit::core::RobotModelConstPtr& model, double padding = 0, double scale = 1);
  CollisionEnv(const moveit::core::RobotModelConstPtr& model, const collision_detection::WorldPtr& world,
               double padding = 0, double scale = 1);
  /// Shares the bodies of the other until one of them has others.
  CollisionEnv(const CollisionEnv& other, const collision_detection::WorldPtr& world);
  CollisionEnv(const CollisionEnv&) = delete;
  CollisionEnv& operator=(const CollisionEnv&) = delete;
  ~CollisionEnv() override;

  void checkSelfCollision(const Request& request, Result& result, const State& state) const override {
    check(Against::kSelf, request, result, state, nullptr, nullptr);
  }
  void checkSelfCollision(const Request& request, Result& result, const State& state, const Matrix& m) const override {
    check(Against::kSelf, request, result, state, nullptr, &m);
  }
  void checkRobotCollision(const Request& request, Result& result, const State& state) const override {
    check(Against::kWorld, request, result, state, nullptr, nullptr);
  }
  void checkRobotCollision(const Request& request, Result& result, const State& state, const Matrix& m) const override {
    check(Against::kWorld, request, result, state, nullptr, &m);
  }
  /// The whole motion from one state to another, as RobotState::interpolate() moves the robot.
  void checkRobotCollision(const Request& request, Result& result, const State& from, const State& to,
                           const Matrix& m) const override {
    check(Against::kWorld, request, result, from, &to, &m);
  }
  void checkRobotCollision(const Request& request, Result& result, const State& from, const State& to) const override {
    check(Against::kWorld, request, result, from, &to, nullptr);
  }
  void distanceSelf(const DistanceRequest& request, DistanceResult& result, const State& state) const override {
    distance(Against::kSelf, request, result, state);
  }
  void distanceRobot(const DistanceRequest& request, DistanceResult& result, const State& state) const override {
    distance(Against::kWorld, request, result, state);
  }

 private:
  std::vector<Item> items(const State& state) const;
  std::shared_ptr<Bodies> bodies(const State& state) const;
  /// \param to end of a motion, or null for a state
  void check(Against, const Request&, Result&, const State&, const State* to, const Matrix*) const;
  void collide(Against, const Request&, Result&, const State&, const State* to, const Matrix*) const;
  void distance(Against, const DistanceRequest&, DistanceResult&, const State&) const;

  std::shared_ptr<const RobotFrames> frames_;
  mutable std::mutex mutex_;  // of the next
  mutable std::shared_ptr<Bodies> bodies_;
};

class CollisionDetectorAllocator
    : public collision_detection::CollisionDetectorAllocatorTemplate<CollisionEnv, CollisionDetectorAllocator> {
 public:
  static const std::string NAME;  ///< "Clearance"
};

}  // namespace clearance_moveit
