// Where the bodies of a query are.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/selection/configuration_poses.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Where all bodies are in one configuration: a snapshot with some bodies moved. Each worker has its own.
class BodyPoses {
 public:
  /// \param boxes of all bodies in the snapshot; empty: made when asked for. All must outlive this.
  BodyPoses(const Scene& scene, const Plan& plan, std::span<const Aabb> boxes);

  /// Moves to configuration k of the plan; nothing to do where it has none. \param given (1, M) of it. \param rotations
  /// (M,) of its poses
  void configure(std::uint64_t k, const ConfigurationPoses::Block& given, std::span<const Mat3d> rotations);
  /// How many a worker may have of a plan's configurations, so that their memory is bounded.
  static std::uint64_t most(const Scene& scene, const Plan& plan);

  bool moves_any() const { return !moved_slot_.empty(); }
  bool moves(std::uint32_t body) const { return !moved_slot_.empty() && moved_slot_[body] != kNone; }
  /// Plan::number() of the one that it was moved to last; the same value always where nothing moves.
  std::uint64_t number() const { return number_; }
  bool stands_at(std::uint64_t k) const { return moved_slot_.empty() || plan_.number(k) == number_; }

  const BodyPlacement& operator[](std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.snapshot->placed[body] : moved_[moved_slot_[body]];
  }
  bool has_uncertainties() const { return !plan_.uncertainties.empty(); }
  /// What is not known of a body, where anything is.
  const PoseUncertainty& uncertainty(std::uint32_t body) const {
    return moved_slot_.empty() || moved_slot_[body] == kNone ? plan_.uncertainties[body]
                                                             : moved_uncertainties_[moved_slot_[body]];
  }
  Slack slack(std::uint32_t body) const {
    const Slack known = plan_.uncertainties.empty() ? Slack() : uncertainty(body).slack;
    return errors_.empty() ? known : known + beside_chains(body);
  }
  /// The part of it that ConfigurationPoses::Block::errors is.
  Slack beside_chains(std::uint32_t body) const {
    if (errors_.empty() || !moves(body)) return {};
    return {errors_[moved_slot_[body]], errors_[moved_slot_[body]]};
  }
  /// A box around the true body; empty (low > high) without a usable pose.
  Aabb box(std::uint32_t body) const;
  /// The same where it has been made already; else null.
  const Aabb* known_box(std::uint32_t body) const {
    if (boxes_.empty()) return nullptr;
    return moved_slot_.empty() || moved_slot_[body] == kNone ? &boxes_[body] : &moved_boxes_[moved_slot_[body]];
  }
  /// Boxes of the pieces of a body that is moved and has a usable pose, where they have been made; else empty.
  std::span<const Aabb> known_piece_boxes(std::uint32_t body) const {
    if (piece_boxes_.empty() || moved_slot_[body] == kNone) return {};
    return std::span(piece_boxes_).subspan(first_piece_[moved_slot_[body]], scene_.bodies()[body].pieces.size());
  }

 private:
  const Scene& scene_;
  const Plan& plan_;
  std::span<const Aabb> boxes_;
  std::uint64_t number_ = ~std::uint64_t{0};
  std::vector<std::uint32_t> moved_slot_;  // of each body: index into moved_, or kNone; empty without configurations
  std::vector<Pose> local_;                // of each moved body
  std::vector<std::uint8_t> facts_;        // likewise, LinkFact bits
  std::vector<const Mat3d*> rotation_of_;  // of local_, while a configuration is being placed
  std::vector<double> travels_;            // of local_: PlacedLink::travel
  std::vector<BodyPlacement> moved_;
  std::vector<PoseUncertainty> moved_uncertainties_;  // empty where the plan has none
  std::span<const double> errors_;                    // of each moved body, beside those; empty: none
  std::vector<Aabb> moved_boxes_;
  std::vector<Aabb> piece_boxes_;           // of all moved bodies
  std::vector<std::uint32_t> first_piece_;  // of each moved body: in piece_boxes_
};

/// A box that holds the true body that a placed one stands for.
Aabb body_box(const Body& body, const BodyPlacement& placement, const Slack& slack);
/// What the joints between two links of one robot, on one root, may put their distance off by, metres: all that counts
/// of how they are placed, since what carries both moves neither before the other. +inf: others, which have no such.
double joints_between(const PoseUncertainty& a, const PoseUncertainty& b);
/// The slack of a pair. Whoever knows that two bodies' doubts are in part the same ones says so here: links of one
/// robot stand on one base, wherever that is, and share what the joints make that carry both.
Slack pair_slack(const BodyPoses& placement, BodyPair pair);

}  // namespace clearance
