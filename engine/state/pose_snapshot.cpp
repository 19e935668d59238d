// Placement of a snapshot's bodies, and of those that follow them.
#include <algorithm>
#include <cassert>

#include "engine/state/pose_store.h"

namespace clearance {

void PoseSnapshot::place_again(std::span<const std::uint32_t> bodies) {
  constexpr std::size_t kAtATime = 64;
  Pose poses[kAtATime];
  Mat3d rotations[kAtATime];
  assert(placed.size() == local.size() && parent.size() == local.size());
  const auto is_given = [&](std::uint32_t b) { return given[b] && scene->bodies()[b].cloud != CloudState::kAwaited; };
  for (std::size_t begin = 0; begin < bodies.size(); begin += kAtATime) {
    const auto part = bodies.subspan(begin, std::min(kAtATime, bodies.size() - begin));
    for (std::size_t i = 0; i < part.size(); ++i) poses[i] = local[part[i]];
    rotations_of(std::span(poses, part.size()), std::span(rotations, part.size()));
    for (std::size_t i = 0; i < part.size(); ++i) {
      const std::uint32_t b = part[i];
      placed[b] =
          place(is_given(b) ? &local[b] : nullptr, parent[b] == kNone ? nullptr : &placed[parent[b]], &rotations[i]);
      placed[b].beyond_limits |= beyond_limits[b] != 0;
    }
  }
}

std::int64_t PoseSnapshot::receipt_of_chain(std::uint32_t body) const {
  std::int64_t oldest = 0;
  const auto take_oldest = [&](std::int64_t receipt) {
    if (receipt != 0 && (oldest == 0 || receipt < oldest)) oldest = receipt;
  };
  for (std::uint32_t b = body; b != kNone; b = parent[b]) take_oldest(receipt_ns[b]);
  if (const ReceivedPoints* own = points_of(body)) take_oldest(own->receipt_ns);
  return oldest;
}

std::vector<std::uint32_t> PoseSnapshot::with_followers(std::span<const std::uint32_t> bodies) const {
  std::vector<std::uint8_t> moved(local.size(), 0);
  for (const std::uint32_t b : bodies) moved[b] = 1;
  std::vector<std::uint32_t> all;
  for (const std::uint32_t b : *order) {
    if (parent[b] != kNone && moved[parent[b]]) moved[b] = 1;
    if (moved[b]) all.push_back(b);
  }
  return all;
}

}  // namespace clearance
