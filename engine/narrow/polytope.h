// Where the expanding polytope lies, and who works on it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/narrow/overlap.h"
#include "engine/narrow/team.h"

namespace clearance {

/// An edge of what a new vertex sees.
struct OutlineEdge {
  std::uint32_t from, to;
  std::uint32_t outside;  ///< the same edge of a face that stays, a half-edge
};
template <class T>
struct FanFace {
  CsoFace<T> face;
  T offset;
};

/// A polytope in lists that grow, and one thread that works on it. A device's (engine/cuda/dense/depth_kernel.cuh) has lists
/// of a length that stays, and a team.
template <class T>
struct GrowingPolytope {
  using Team = OneThread;
  static constexpr bool kGrows = true;
  std::vector<CsoVertex<T>> vertices;           ///< each is on the surface, or was
  std::vector<CsoFace<T>> faces;                ///< normals of unit length
  std::vector<T> offsets;                       ///< of the faces' planes
  std::vector<std::uint8_t> is_seen, was_seen;  ///< of the faces, by the last vertex
  std::vector<std::uint32_t> seen;              ///< which these are, ascending
  std::vector<OutlineEdge> outline;
  std::vector<std::uint32_t> begins;  ///< of the vertices on the outline: the edge there
  std::vector<FanFace<T>> fan;

  /// For all that the last vertex can see.
  void make_room() {
    const std::size_t count = faces.size();
    if (is_seen.size() < count) {
      is_seen.resize(2 * count);
      seen.resize(6 * count);  // the places of a fan, too
      outline.resize(6 * count);
    }
    if (begins.size() < vertices.size()) begins.resize(2 * vertices.size());
  }
  /// \param count of its faces, in place of `gone`. False: there is no room.
  bool make_room_for_fan(std::size_t count, [[maybe_unused]] std::size_t gone) {
    if (fan.size() < count) fan.resize(2 * count);
    return true;
  }
};

}  // namespace clearance
