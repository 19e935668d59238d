#include "engine/scene/hull_warning.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <utility>

#include "engine/scene/geometry.h"
#include "engine/surface/enclosure.h"
#include "engine/surface/surface.h"

namespace clearance {

namespace {

// Said to be decomposed, without a file of pieces: mesh_source().
bool lacks_pieces(const Body& body) {
  return body.source.ends_with(kNoPiecesYet);
}

bool stands_out(const Body& body) {
  double size = 0;
  for (const PiecePtr& piece : body.pieces) size = std::max(size, piece->spread + piece->radius);
  return body.hull_excess > kHullExcessShare * size;
}

}  // namespace

std::string hull_warning(const Body& body) {
  if (lacks_pieces(body))
    return "convexify: decompose finds no pieces beside its mesh: triangles alone answer; `clearance decompose FILE` "
           "makes some";
  if (!stands_out(body)) return "";
  char text[200];
  const char* what = body.pieces.size() == 1 ? "its hull stands" : "its pieces stand";
  int n = std::snprintf(text, sizeof text, "%s up to %.3g m out of its mesh", what, body.hull_excess);
  if (body.empty_share > 0)
    n += std::snprintf(text + n, sizeof text - static_cast<std::size_t>(n), ", %.3g %% of it is empty",
                       100 * body.empty_share);
  std::string warning = std::string(text, static_cast<std::size_t>(n)) + ": distances are to the hull";
  if (!body.display) return warning;
  const auto& [vertices, triangles] = *body.display;
  std::string why;
  if (const std::string edge = open_edge(vertices, triangles); !edge.empty())
    why = " encloses nothing: " + edge;
  else if (windings_may_cancel(vertices, triangles))
    if (const std::string place = hollow_place(Surface(vertices, triangles, true)); !place.empty())
      why = " is hollow: " + place;
  if (!why.empty()) warning += "; " + body.source + why + "; convexify: surface asks for its triangles as they are";
  return warning;
}

std::vector<HullWarning> hull_warnings(const Scene& scene, std::uint32_t first) {
  std::vector<HullWarning> warnings;
  std::map<std::pair<const DisplayMesh*, const Piece*>, std::string> known;
  for (std::uint32_t id = first; id < scene.bodies().size(); ++id) {
    const Body& body = scene.bodies()[id];
    if (!stands_out(body) && !lacks_pieces(body)) continue;
    const auto [at, fresh] = known.try_emplace({body.display.get(), body.pieces[0].get()});
    if (fresh) at->second = hull_warning(body);
    warnings.push_back({id, at->second});
  }
  return warnings;
}

}  // namespace clearance
