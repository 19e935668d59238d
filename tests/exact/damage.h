// Pieces with something cut out of them, to see what notices.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "campaign.h"
#include "engine/support.h"

namespace clearance::exact {

/// The vertices of a body that an exact answer rests on.
inline std::vector<Vec3d> decisive(const Case& c, const Result& truth, bool of_b) {
  std::vector<Vec3d> v;
  for (const auto& s : truth.simplex) v.push_back(of_b ? c.b->vertices[s.b] : c.a->vertices[s.a]);
  return v;
}

inline bool holds(const std::vector<Vec3d>& list, const Vec3d& v) {
  return std::any_of(list.begin(), list.end(), [&](const Vec3d& w) { return w.x == v.x && w.y == v.y && w.z == v.z; });
}

/// The piece without a single edge to one of `vertices`, though those keep theirs: climbing cannot come to them.
inline PiecePtr without_edges_to(const Piece& piece, const std::vector<Vec3d>& vertices) {
  Piece cut = piece;
  if (piece.adjacency.empty()) return std::make_shared<const Piece>(cut);
  cut.adjacency.clear();
  cut.adjacency_begin = {0};
  for (std::size_t i = 0; i < piece.vertices.size(); ++i) {
    for (std::uint32_t k = piece.adjacency_begin[i]; k < piece.adjacency_begin[i + 1]; ++k)
      if (!holds(vertices, piece.vertices[piece.adjacency[k]])) cut.adjacency.push_back(piece.adjacency[k]);
    cut.adjacency_begin.push_back(static_cast<std::uint32_t>(cut.adjacency.size()));
  }
  return std::make_shared<const Piece>(cut);
}

/// The piece without any edges: supports by scan or tree alone.
inline PiecePtr without_edges(const Piece& piece) {
  Piece cut = piece;
  cut.adjacency.clear();
  cut.adjacency_begin.clear();
  return std::make_shared<const Piece>(cut);
}

/// The piece without edges, and without `vertices` in its bounding tree, though they are still vertices.
inline PiecePtr without_tree_entries_of(const Piece& piece, const std::vector<Vec3d>& vertices) {
  Piece cut = *without_edges(piece);
  if (!cut.tree) return std::make_shared<const Piece>(cut);
  SupportTree tree = *cut.tree;
  const auto kept = static_cast<std::size_t>(
      std::find_if(tree.points.begin(), tree.points.end(), [&](const Vec3d& v) { return !holds(vertices, v); }) -
      tree.points.begin());
  for (std::size_t i = 0; i < tree.points.size(); ++i)
    if (holds(vertices, tree.points[i])) tree.points[i] = tree.points[kept], tree.order[i] = tree.order[kept];
  cut.tree = std::make_shared<const SupportTree>(std::move(tree));
  return std::make_shared<const Piece>(cut);
}

}  // namespace clearance::exact
