// Where the bodies of a query are.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/query/plan.h"

namespace clearance {

/// Where all bodies are in one configuration: a snapshot with some bodies moved. Each worker has its own.
class Placement {
 public:
  /// \param boxes of all bodies in the snapshot; empty: made when asked for. Both must outlive this.
  Placement(const Scene& scene, const Plan& plan, std::span<const Aabb> boxes);

  /// Moves to configuration k of the plan; nothing to do where it has none. \param rotations (M,) of its poses
  void configure(std::uint64_t k, std::span<const Mat3d> rotations);
  bool moves_any() const { return !moved_slot_.empty(); }
  bool moves(std::uint32_t body) const { return !moved_slot_.empty() && moved_slot_[body] != kNone; }
  /// The one that it was moved to last; the same value always where nothing moves.
  std::uint64_t configuration() const { return configuration_; }
  bool stands_at(std::uint64_t k) const { return moved_slot_.empty() || k == configuration_; }

  const BodyPlacement& operator[](std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.snapshot->placed[body] : moved_[moved_slot_[body]];
  }
  /// A box around the body; empty (low > high) without a usable pose.
  Aabb box(std::uint32_t body) const;
  /// The same where it has been made already; else null.
  const Aabb* known_box(std::uint32_t body) const {
    if (boxes_.empty()) return nullptr;
    return moved_slot_.empty() || moved_slot_[body] == kNone ? &boxes_[body] : &moved_boxes_[moved_slot_[body]];
  }

 private:
  const Scene& scene_;
  const Plan& plan_;
  std::span<const Aabb> boxes_;
  std::uint64_t configuration_ = ~std::uint64_t{0};
  std::vector<std::uint32_t> moved_slot_;  // of each body: index into moved_, or kNone; empty without configurations
  std::vector<Pose> local_;                // of each moved body
  std::vector<const Mat3d*> rotation_of_;  // of local_, while a configuration is being placed
  std::vector<BodyPlacement> moved_;
  std::vector<Aabb> moved_boxes_;
};

/// The box of a placed body.
Aabb body_box(const Body& body, const BodyPlacement& placement);

}  // namespace clearance
