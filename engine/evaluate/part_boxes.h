// Boxes around the convex parts of placed bodies.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/selection/body_poses.h"

namespace clearance {

/// Caches boxes, since a body of several parts meets many others in one configuration. Each worker has its own.
class PartBoxes {
 public:
  explicit PartBoxes(const engine::Scene& scene) : scene_(scene) {}

  /// Sizes the cache for the boxes of so many bodies, up to a bound, and may clear it. A few bodies would not pay for
  /// the memory that thousands need.
  void expect(std::size_t bodies) {
    const std::size_t slots = std::clamp(std::bit_ceil(2 * bodies), kFewestSlots, kMostSlots);
    if (slots > slots_.size()) slots_ = std::vector<CachedBoxes>(slots);
  }

  /// A box for each part of a body with a usable pose, valid until the next call but one.
  std::span<const Aabb> at(const BodyPoses& placement, std::uint32_t body) {
    if (const std::span<const Aabb> known = placement.known_part_boxes(body); !known.empty()) return known;
    if (slots_.empty()) expect(1);
    const CachedBoxes wanted = of(placement, body);
    const std::size_t home =
        (reinterpret_cast<std::uintptr_t>(wanted.placement) / sizeof(BodyPoses) * 64 + body) % (slots_.size() / 2) * 2;
    for (std::size_t i = home; i < home + 2; ++i)
      if (slots_[i].holds(wanted)) {
        slots_[i].used = ++count_;
        return slots_[i].boxes;
      }
    CachedBoxes& slot = slots_[home + (slots_[home].used > slots_[home + 1].used)];
    slot.placement = wanted.placement;
    slot.number = wanted.number;
    slot.body = body;
    slot.used = ++count_;
    slot.boxes.clear();
    const PoseMatrix& pose = placement[body].pose;
    for (const ConvexPartPtr& part : scene_.bodies()[body].parts)
      slot.boxes.push_back(certify_box(*part, pose.R_wb, pose.t_w));
    return slot.boxes;
  }

 private:
  static constexpr std::size_t kFewestSlots = 16, kMostSlots = 2048;
  struct CachedBoxes {
    const BodyPoses* placement = nullptr;  // null for a body that does not move
    std::uint64_t number = 0, used = 0;    // BodyPoses::number()
    std::uint32_t body = kNone;
    std::vector<Aabb> boxes;

    bool holds(const CachedBoxes& other) const {
      return placement == other.placement && number == other.number && body == other.body;
    }
  };
  static CachedBoxes of(const BodyPoses& placement, std::uint32_t body) {
    if (!placement.moves(body)) return {.body = body, .boxes = {}};
    return {.placement = &placement, .number = placement.number(), .body = body, .boxes = {}};
  }

  const engine::Scene& scene_;
  std::vector<CachedBoxes> slots_;
  std::uint64_t count_ = 0;  // of calls
};

}  // namespace clearance
