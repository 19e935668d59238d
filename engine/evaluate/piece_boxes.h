// Boxes around the pieces of bodies where they stand.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/hull/box.h"
#include "engine/selection/body_poses.h"

namespace clearance {

/// Remembers the boxes it made last: a body of several pieces meets many others in one configuration. Each worker has
/// its own.
class PieceBoxes {
 public:
  explicit PieceBoxes(const Scene& scene) : scene_(scene) {}

  /// Boxes of so many bodies are about to be asked for: room is made for them, up to a bound, and what was remembered
  /// may be forgotten. A few bodies would not pay for the room that thousands want.
  void expect(std::size_t bodies) {
    const std::size_t slots = std::clamp(std::bit_ceil(2 * bodies), kFewestSlots, kMostSlots);
    if (slots > slots_.size()) slots_ = std::vector<Slot>(slots);
  }

  /// A box for each piece of a body that has a usable pose; valid until the next call but one.
  std::span<const Aabb> at(const BodyPoses& placement, std::uint32_t body) {
    if (const std::span<const Aabb> known = placement.known_piece_boxes(body); !known.empty()) return known;
    if (slots_.empty()) expect(1);
    const Slot wanted = of(placement, body);
    const std::size_t home =
        (reinterpret_cast<std::uintptr_t>(wanted.placement) / sizeof(BodyPoses) * 64 + body) % (slots_.size() / 2) * 2;
    for (std::size_t i = home; i < home + 2; ++i)
      if (slots_[i].holds(wanted)) {
        slots_[i].used = ++count_;
        return slots_[i].boxes;
      }
    Slot& slot = slots_[home + (slots_[home].used > slots_[home + 1].used)];
    slot.placement = wanted.placement;
    slot.number = wanted.number;
    slot.body = body;
    slot.used = ++count_;
    slot.boxes.clear();
    const PoseMatrix& pose = placement[body].pose;
    for (const PiecePtr& piece : scene_.bodies()[body].pieces)
      slot.boxes.push_back(certify_box(*piece, pose.R_wb, pose.t_w));
    return slot.boxes;
  }

 private:
  static constexpr std::size_t kFewestSlots = 16, kMostSlots = 2048;
  struct Slot {
    const BodyPoses* placement = nullptr;  // null: of a body that stands where it does in all of them
    std::uint64_t number = 0, used = 0;    // BodyPoses::number()
    std::uint32_t body = kNone;
    std::vector<Aabb> boxes;

    bool holds(const Slot& other) const {
      return placement == other.placement && number == other.number && body == other.body;
    }
  };
  static Slot of(const BodyPoses& placement, std::uint32_t body) {
    if (!placement.moves(body)) return {.body = body, .boxes = {}};
    return {.placement = &placement, .number = placement.number(), .body = body, .boxes = {}};
  }

  const Scene& scene_;
  std::vector<Slot> slots_;
  std::uint64_t count_ = 0;  // of questions
};

}  // namespace clearance
