#include "inspect/choices.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "engine/bvh/enclosure.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/make_geometry.h"

namespace clearance {

namespace {

// Returns whether a body was made from one mesh. Its submeshes are no longer known.
bool is_of_one_mesh(const Body& body) {
  constexpr std::array kOfOneMesh = {MeshAs::kHull, MeshAs::kSurface, MeshAs::kSolid};
  return body.parts.size() == 1 && body.display && std::ranges::any_of(kOfOneMesh, [&](MeshAs what) {
           return body.source.ends_with("(" + std::string(word_of(what)) + ")");
         });
}

MeshAs what_is(const Body& body) {
  const Surface* surface = surface_of(body);
  if (!surface) return MeshAs::kHull;
  return surface->is_solid() ? MeshAs::kSolid : MeshAs::kSurface;
}

// Rebuilds a body from its mesh in the same place.
Body made(const Body& body, Geometry geometry, const Pose& X_wb) {
  Body other = body;
  other.parts = std::move(geometry.parts);
  other.parent = other.robot = other.link = kNone;
  other.is_static = false;
  other.requires_pose = false;
  other.is_grown = true;
  other.pose = X_wb;
  return other;
}

Choice choice_of(std::uint32_t id, MeshAs what, bool is_now, const Geometry& geometry) {
  const ConvexPart& part = *geometry.parts[0];
  Choice choice{.body = id,
                .what = what,
                .is_now = is_now,
                .vertices = part.vertices.size(),
                .bytes = resident_bytes(part),
                .hull_excess = geometry.hull_excess,
                .ns_per_pair = {}};
  if (!part.surface) return choice;
  choice.triangles = part.surface->triangles().size();
  choice.bytes += part.surface->resident_bytes();
  return choice;
}

// Measures each alternative in a separate scene with the body's partners in place.
void measure(const engine::Scene& scene, std::uint32_t id, const PairTimes& times, std::span<const Geometry> geometries,
             std::span<Choice> choices) {
  const std::vector<BodyPair> pairs = times.sampled(id);
  if (pairs.empty()) return;
  engine::Scene among;
  for (const BodyPair& pair : pairs) {
    Geometry as_it_is;
    as_it_is.parts = scene.bodies()[pair.b].parts;
    Body partner = made(scene.bodies()[pair.b], std::move(as_it_is), times.pose(pair.b));
    among.add_body(std::move(partner));
  }
  for (std::size_t i = 0; i < geometries.size(); ++i) {
    Body one = made(scene.bodies()[id], geometries[i], times.pose(id));
    one.name = "choice " + std::to_string(i);
    if (among.find_body(one.name) != kNone) return;  // the name is taken
    among.add_body(std::move(one));
  }
  const PairTimes here(among);
  for (std::size_t i = 0; i < geometries.size(); ++i) {
    std::vector<BodyPair> with;
    for (std::uint32_t p = 0; p < pairs.size(); ++p) with.push_back({static_cast<std::uint32_t>(pairs.size() + i), p});
    choices[i].ns_per_pair = here.ns_per_pair(with);
  }
}

}  // namespace

std::vector<Choice> choices_of(const engine::Scene& scene, const PairTimes* times) {
  std::vector<Choice> all;
  std::set<std::pair<const DisplayMesh*, double>> seen;
  for (std::uint32_t id = 0; id < scene.bodies().size(); ++id) {
    const Body& body = scene.bodies()[id];
    if (!is_of_one_mesh(body) || (!surface_of(body) && body.hull_excess == 0)) continue;
    const double radius = body.parts[0]->radius;
    if (!seen.insert({body.display.get(), radius}).second) continue;
    const DisplayMesh& mesh = *body.display;
    std::vector<MeshAs> kinds{MeshAs::kHull, MeshAs::kSurface};
    if (why_not_solid(mesh.vertices, mesh.triangles).empty()) kinds.push_back(MeshAs::kSolid);
    std::vector<Geometry> geometries;
    std::vector<Choice> choices;
    for (const MeshAs what : kinds) {
      geometries.push_back(geometry_of_triangles(mesh.vertices, mesh.triangles, what, radius));
      choices.push_back(choice_of(id, what, what == what_is(body), geometries.back()));
    }
    if (times) measure(scene, id, *times, geometries, choices);
    all.insert(all.end(), choices.begin(), choices.end());
  }
  return all;
}

}  // namespace clearance
