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
  /// The same for the bodies of some pairs alone: others must not be read.
  /// \param pairs positions in the plan
  void configure(std::uint64_t k, const ConfigurationPoses::PoseBlock& given, std::span<const std::uint64_t> pairs);
  /// Limit on the configurations that a worker keeps, which bounds their memory.
  static std::uint64_t most(const engine::Scene& scene, const Plan& plan);

  bool moves_any() const { return !moved_slot_.empty(); }
  bool moves(std::uint32_t body) const { return !moved_slot_.empty() && moved_slot_[body] != kNone; }
  /// Plan::number() of the present configuration; constant if nothing moves.
  std::uint64_t number() const { return number_; }
  /// Whether all bodies are placed for a configuration.
  bool is_at(std::uint64_t k) const { return moved_slot_.empty() || (is_whole_ && plan_.number(k) == number_); }

  const BodyPlacement& operator[](std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.snapshot->placed[body] : moved_[moved_slot_[body]];
  }
  bool has_uncertainties() const { return !plan_.uncertainties.empty(); }
  /// Uncertainty of a body, if has_uncertainties().
  const PoseUncertainty& uncertainty(std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.uncertainties[body]
                                                             : moved_uncertainties_[moved_slot_[body]];
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
    return moved_slot_.empty() || moved_slot_[body] == kNone ? &boxes_[body] : &moved_boxes_[moved_slot_[body]];
  }
  /// Boxes of the parts of a moved body with a usable pose, if they exist already, otherwise empty.
  std::span<const Aabb> known_part_boxes(std::uint32_t body) const {
    if (part_boxes_.empty() || moved_slot_[body] == kNone) return {};
    return std::span(part_boxes_).subspan(first_part_[moved_slot_[body]], scene_.bodies()[body].parts.size());
  }

 private:
  void want(std::uint32_t body);
  void place_moved(std::size_t i, const ConfigurationPoses::PoseBlock& given, const Mat3d* rotation);

  const engine::Scene& scene_;
  const Plan& plan_;
  std::span<const Aabb> boxes_;
  std::uint64_t number_ = ~std::uint64_t{0};
  bool is_whole_ = false;
  std::vector<std::uint32_t> moved_slot_;  // by body: index into moved_, or kNone; empty without configurations
  std::vector<Pose> local_;                // of each moved body
  std::vector<std::uint8_t> facts_;        // of each moved body, LinkFact bits
  std::vector<std::uint32_t> given_;       // of each moved body: index in Plan::bodies, or kNone
  std::vector<std::uint8_t> is_wanted_;    // of each moved body, during configure()
  std::vector<double> travels_;            // of local_: PlacedLink::travel
  std::vector<BodyPlacement> moved_;
  std::vector<PoseUncertainty> moved_uncertainties_;  // empty if the plan has none
  std::span<const double> errors_;                    // of each moved body, in addition; may be empty
  std::vector<Aabb> moved_boxes_;
  std::vector<Aabb> part_boxes_;           // of all moved bodies
  std::vector<std::uint32_t> first_part_;  // by moved body: index into part_boxes_
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
