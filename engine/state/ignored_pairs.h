// Pairs of bodies that may touch: those that the scene lists, with changes made at run time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/scene/scene.h"

namespace clearance {

class IgnoredPairs {
 public:
  /// Maximum number of pairs added to those of a scene.
  static constexpr std::size_t kMostAdded = std::size_t{1} << 16;

  explicit IgnoredPairs(const engine::Scene& scene);

  /// Ascending pairs (a < b), each once.
  const std::vector<BodyPair>& all() const { return all_; }

  /// Both change the pairs of a body or group (selectors) with another; pairs of two static bodies are left out. Both
  /// throw QueryError for an unknown selector, allow() also beyond kMostAdded pairs; then nothing changes.
  void allow(std::uint32_t a, std::uint32_t b, const engine::Scene& scene);
  void forbid(std::uint32_t a, std::uint32_t b, const engine::Scene& scene);
  /// Like allow(), but only until release() of the attached `child`.
  void allow_attached(std::uint32_t child, std::span<const std::uint32_t> others, const engine::Scene& scene);
  void release(std::uint32_t child);

  /// Applies the changes made to another scene's pairs to these.
  /// \param now id in this scene of each body of the other scene, or kNone
  /// \param keeps for each body of this scene: whether it is still attached in the same way
  void take_over(const IgnoredPairs& old, const engine::Scene& old_scene, std::span<const std::uint32_t> now,
                 std::span<const std::uint8_t> keeps, const engine::Scene& scene);

 private:
  struct Held {
    BodyPair pair;
    std::uint32_t child;  // body whose attachment allows the pair
  };
  void merge();

  std::size_t of_scene_;
  std::vector<BodyPair> always_;  // ascending
  std::vector<Held> held_;
  std::vector<BodyPair> all_;
};

/// Pairs that are in exactly one of two ascending lists.
std::vector<BodyPair> changed_pairs(std::span<const BodyPair> was, std::span<const BodyPair> is);

}  // namespace clearance
