// Covers in the cache.
#pragma once

#include <atomic>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/cache/cache.h"
#include "engine/cover/cover.h"

namespace clearance {

/// A cover and the time that it took to make, in seconds.
struct TimedCover {
  Cover cover;
  double seconds = 0;
};

/// Whether bodies of these parts can have a cover: up to kMostCoveredParts bounded convex parts, meshes and clouds.
inline constexpr std::size_t kMostCoveredParts = 64;
bool may_have_cover(std::span<const ConvexPartPtr> parts);

/// Whether two bodies have the same parts.
bool same_parts(std::span<const ConvexPartPtr> a, std::span<const ConvexPartPtr> b);

/// Name of a body's cover in the cache: a digest of all that the cover depends on.
std::string cover_name(std::span<const ConvexPartPtr> parts);

/// A cover as bytes for the cache.
std::vector<std::byte> cover_record(const TimedCover& made);
/// The cover of a record, or nothing for bytes that are not those of a sound cover.
std::optional<TimedCover> cover_of_record(std::span<const std::byte> record);

/// Reads a cover from the cache.
std::optional<TimedCover> read_cover(const Cache& cache, const std::string& name);
/// Makes a cover, as make_cover() does, and stores it in the cache.
std::optional<TimedCover> make_timed_cover(const Cache& cache, const std::string& name,
                                           std::span<const ConvexPartPtr> parts,
                                           const std::atomic<bool>* stopped = nullptr);

}  // namespace clearance
