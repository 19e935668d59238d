// Poses of the bodies of a query.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/selection/configuration_poses.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Poses of all bodies in one configuration: a snapshot with some bodies moved. Each worker has its own.
class BodyPoses {
 public:
  /// The arguments must outlive this.
  /// \param boxes of all bodies in the snapshot; computed on request if empty
  BodyPoses(const engine::Scene& scene, const Plan& plan, std::span<const Aabb> boxes);

  /// Moves to configuration k of the plan, if it has any.
  /// \param given (1, M) of it
  /// \param rotations (M,) of its poses
  void configure(std::uint64_t k, const ConfigurationPoses::PoseBlock& given, std::span<const Mat3d> rotations);
  /// Appends the moved bodies of some pairs, and those that carry them, each after its parent.
  /// \param pairs positions in the plan
  /// \param slots receives indices in Plan::moved
  void select(std::span<const std::uint64_t> pairs, std::vector<std::uint32_t>& slots) const;
  /// The pose of a moved body in a configuration, or the identity if its configurations do not give it.
  Pose given_pose(std::uint32_t slot, const ConfigurationPoses::PoseBlock& given) const {
    return moved_[slot].given == kNone ? Pose{} : given.poses[moved_[slot].given];
  }
  /// Moves the selected bodies alone: others must not be read.
  /// \param slots of select()
  /// \param rotations (slots.size(),) of their given_pose()
  void configure(std::uint64_t k, const ConfigurationPoses::PoseBlock& given, std::span<const std::uint32_t> slots,
                 std::span<const Mat3d> rotations);
  /// Limit on the configurations that a worker keeps, which bounds their memory.
  static std::uint64_t most(const engine::Scene& scene, const Plan& plan);

  bool moves_any() const { return !moved_slot_.empty(); }
  bool moves(std::uint32_t body) const { return !moved_slot_.empty() && moved_slot_[body] != kNone; }
  /// Plan::number() of the present configuration; constant if nothing moves.
  std::uint64_t number() const { return number_; }
  /// Whether all bodies are placed for a configuration.
  bool is_at(std::uint64_t k) const { return moved_slot_.empty() || (is_whole_ && plan_.number(k) == number_); }

  const BodyPlacement& operator[](std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.snapshot->placed[body]
                                                             : moved_[moved_slot_[body]].placement;
  }
  bool has_uncertainties() const { return !plan_.uncertainties.empty(); }
  /// Uncertainty of a body, if has_uncertainties().
  const PoseUncertainty& uncertainty(std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.uncertainties[body]
                                                             : moved_[moved_slot_[body]].uncertainty;
  }
  Slack slack(std::uint32_t body) const {
    const Slack known = plan_.uncertainties.empty() ? Slack() : uncertainty(body).slack;
    return errors_.empty() ? known : known + chain_slack(body);
  }
  /// The part of slack() from ConfigurationPoses::PoseBlock::errors.
  Slack chain_slack(std::uint32_t body) const {
    if (errors_.empty() || !moves(body)) return {};
    return {errors_[moved_slot_[body]], errors_[moved_slot_[body]]};
  }
  /// A box around the exact body; empty (low > high) without a usable pose.
  Aabb box(std::uint32_t body) const;
  /// The box if it exists already, otherwise null.
  const Aabb* known_box(std::uint32_t body) const {
    if (boxes_.empty()) return nullptr;
    return moved_slot_.empty() || moved_slot_[body] == kNone ? &boxes_[body] : &moved_[moved_slot_[body]].box;
  }
  /// Boxes of the parts of a moved body with a usable pose, if they exist already, otherwise empty.
  std::span<const Aabb> known_part_boxes(std::uint32_t body) const {
    if (part_boxes_.empty() || moved_slot_[body] == kNone) return {};
    return std::span(part_boxes_).subspan(moved_[moved_slot_[body]].first_part, scene_.bodies()[body].parts.size());
  }

 private:
  struct Moved {
    std::uint32_t given = kNone;   // index in Plan::bodies
    std::uint32_t first_part = 0;  // index into part_boxes_
    std::uint8_t facts = 0;        // LinkFact bits
    Pose local;
    double travel = 0;  // PlacedLink::travel
    BodyPlacement placement;
    PoseUncertainty uncertainty;  // if the plan has any
    Aabb box;                     // unless boxes_ is empty
  };
  void place_moved(std::size_t i, const ConfigurationPoses::PoseBlock& given, const Mat3d* rotation);

  const engine::Scene& scene_;
  const Plan& plan_;
  std::span<const Aabb> boxes_;
  std::uint64_t number_ = ~std::uint64_t{0};
  bool is_whole_ = false;                  // all bodies are at number_, not only the selected ones
  std::vector<std::uint32_t> moved_slot_;  // by body: index into moved_, or kNone; empty without configurations
  std::vector<Moved> moved_;               // (Plan::moved,)
  std::span<const double> errors_;         // of each moved body, in addition; may be empty
  std::vector<Aabb> part_boxes_;           // of all moved bodies
};

/// A box that contains the exact body at a placement.
Aabb body_box(const Body& body, const BodyPlacement& placement, const Slack& slack);
/// Error of the distance of two links of one robot on one root from the joints between them, in metres. Errors of
/// joints that carry both do not count. +inf for other bodies.
double joints_between(const PoseUncertainty& a, const PoseUncertainty& b);
/// Slack of a pair. Accounts for uncertainty that its bodies share: links of one robot stand on one base, and share the
/// errors of the joints that carry both.
Slack pair_slack(const BodyPoses& placement, BodyPair pair);
/// \param chain_a, chain_b BodyPoses::chain_slack(), zero in a configuration
Slack pair_slack(const PoseUncertainty& a, const PoseUncertainty& b, const Slack& chain_a = {},
                 const Slack& chain_b = {});

}  // namespace clearance
