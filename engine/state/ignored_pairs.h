// Pairs of bodies that may touch: those that the scene names, as they were changed at run time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/scene/scene.h"

namespace clearance {

class IgnoredPairs {
 public:
  /// Pairs that may be added to those of a scene.
  static constexpr std::size_t kMostAdded = std::size_t{1} << 16;

  explicit IgnoredPairs(const Scene& scene);

  /// (a < b) ascending, each once.
  const std::vector<BodyPair>& all() const { return all_; }

  /// Both change the pairs of a body or group (selectors) with another; static bodies have none with each other. Both
  /// throw QueryError for an unknown selector, allow() also for more pairs than kMostAdded, and then change nothing.
  void allow(std::uint32_t a, std::uint32_t b, const Scene& scene);
  void forbid(std::uint32_t a, std::uint32_t b, const Scene& scene);
  /// The same for as long as `child` is attached as it is: until release().
  void allow_attached(std::uint32_t child, std::span<const std::uint32_t> others, const Scene& scene);
  void release(std::uint32_t child);

  /// What another scene's pairs were changed by, done to these. \param now the id in this scene of each body of the
  /// other, kNone: it is not there. \param keeps whether a body of this scene is still attached as it was, of each.
  void take_over(const IgnoredPairs& old, const Scene& old_scene, std::span<const std::uint32_t> now,
                 std::span<const std::uint8_t> keeps, const Scene& scene);

 private:
  struct Held {
    BodyPair pair;
    std::uint32_t child;  // whose attachment allows it
  };
  void merge();

  std::size_t of_scene_;
  std::vector<BodyPair> always_;  // ascending
  std::vector<Held> held_;
  std::vector<BodyPair> all_;
};

/// The pairs that are in one of two ascending lists.
std::vector<BodyPair> changed_pairs(std::span<const BodyPair> was, std::span<const BodyPair> is);

}  // namespace clearance
