// Memory and threads of the expanding polytope.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/narrow/overlap.h"
#include "engine/narrow/team.h"

namespace clearance {

/// An edge on the outline of the faces that a new vertex sees.
struct OutlineEdge {
  std::uint32_t from, to;
  std::uint32_t outside;  ///< the same edge of a face that stays, a half-edge
};
template <class T>
struct FanFace {
  CsoFace<T> face;
  T offset;
};

/// Polytope in growing lists, for one thread. That of a device (engine/cuda/dense/depth_kernel.cuh) has lists of fixed
/// length, and a team.
template <class T>
struct GrowingPolytope {
  using Team = OneThread;
  static constexpr bool kGrows = true;
  std::vector<CsoVertex<T>> vertices;           ///< each is or was on the surface
  std::vector<CsoFace<T>> faces;                ///< normals of unit length
  std::vector<T> offsets;                       ///< of the faces' planes
  std::vector<std::uint8_t> is_seen, was_seen;  ///< by face, from the last vertex
  std::vector<std::uint32_t> seen;              ///< indices of those faces, ascending
  std::vector<OutlineEdge> outline;
  std::vector<std::uint32_t> begins;  ///< by vertex on the outline: the edge that begins there
  std::vector<FanFace<T>> fan;

  /// Reserves enough for all that the last vertex can see.
  void reserve() {
    const std::size_t count = faces.size();
    if (is_seen.size() < count) {
      is_seen.resize(2 * count);
      seen.resize(6 * count);  // also holds the places of a fan
      outline.resize(6 * count);
    }
    if (begins.size() < vertices.size()) begins.resize(2 * vertices.size());
  }
  /// Reserves the faces of a fan. Returns false if there is no space.
  /// \param count number of faces, which replace `gone`
  bool reserve_fan(std::size_t count, [[maybe_unused]] std::size_t gone) {
    if (fan.size() < count) fan.resize(2 * count);
    return true;
  }
};

}  // namespace clearance
