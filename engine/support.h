// Support functions: the vertex of a piece farthest along a direction.
//
// support() is a proved maximum over all vertices, by scan or by a bounding tree: what bounds are made from.
// climb() walks the adjacency from a hint: fast on large pieces, but only a proposal, since the adjacency is a guess.
#pragma once

#include <cstdint>
#include <vector>

#include "double_double.h"
#include "piece.h"

namespace clearance {

template <class T>
struct SupportPoint {
  std::uint32_t index = 0;
  T value{};  ///< n . v of that vertex
};

/// The vertex with the largest computed n . v, ties to the lowest index (scan). Every other vertex has an exact n . v of at
/// most `value` + 3 u |n| rho, u the unit roundoff of T: see docs/bounds.md. n in the body's frame, of any length.
/// \param hint a vertex to begin from, any valid index; only speed depends on it.
SupportPoint<double> support(const Piece& piece, const Vec3d& n, std::uint32_t hint = 0);
SupportPoint<DoubleDouble> support(const Piece& piece, const Vec3<DoubleDouble>& n, std::uint32_t hint = 0);

/// A vertex with no neighbour farther along n, beginning at `hint`. Needs Piece::adjacency.
SupportPoint<double> climb(const Piece& piece, const Vec3d& n, std::uint32_t hint);

/// Pieces of more vertices than this carry a tree.
inline constexpr std::size_t kTreeFromVertices = 256;

/// A binary tree of bounding boxes over the vertices, children of node i at `child` and `child + 1`.
struct SupportTree {
  struct Node {
    Vec3d centre, half;        ///< half is rounded up
    std::uint32_t child = 0;   ///< 0: a leaf
    std::uint32_t begin = 0;   ///< leaf: vertices order[begin .. begin + count)
    std::uint32_t count = 0;
  };
  std::vector<Node> nodes;
  std::vector<std::uint32_t> order;  ///< vertex indices, leaf after leaf
  std::vector<Vec3d> points;         ///< the vertices in that order
};

/// Builds the tree over `vertices`.
SupportTree make_support_tree(const std::vector<Vec3d>& vertices);

}  // namespace clearance
