// Geometry of a mesh: the classifier chooses a kind, and that kind's builder makes the convex parts.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "engine/base/dedupe.h"
#include "engine/bvh/enclosure.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/hull.h"
#include "engine/hull/hull_excess.h"

namespace clearance {

namespace {

// Rounding error of one product; 0 where it is exact, as for powers of two.
double rounding_of_product(double a, double b, double product) {
  constexpr double kNoRemainderBelow = 0x1p-960;  // there the remainder might underflow
  const double off = std::abs(std::fma(a, b, -product));
  return std::abs(product) < kNoRemainderBelow && a != 0 && b != 0 ? std::numeric_limits<double>::min() : off;
}

// Bound on the distance from the scaled vertices to the exact products of file and scale, in metres.
double rounding_of(const std::vector<Submesh>& submeshes, const Vec3d& scale) {
  const double largest = std::max({std::abs(scale.x), std::abs(scale.y), std::abs(scale.z)});
  double worst = 0;
  for (const Submesh& submesh : submeshes) {
    worst = std::max(worst, largest * submesh.rounding);
    if (scale.x == 1 && scale.y == 1 && scale.z == 1) continue;
    for (const Vec3d& v : submesh.vertices) {
      double off = largest * submesh.rounding;
      for (int k = 0; k < 3; ++k) off += rounding_of_product(scale[k], v[k], scale[k] * v[k]);
      worst = std::max(worst, off);
    }
  }
  return worst * (1 + 0x1p-40);  // covers the sums above
}

// A vertex of the file in the body's frame. The turn from y up to z up is exact: (x, y, z) becomes (x, -z, y).
Vec3d in_body(const Vec3d& v, const MeshRecipe& recipe) {
  const Vec3d scaled{recipe.scale.x * v.x, recipe.scale.y * v.y, recipe.scale.z * v.z};
  return recipe.up == UpAxis::kY ? Vec3d{scaled.x, 0 - scaled.z, scaled.y} : scaled;
}

// Joins all submeshes into one scaled mesh, in order.
DisplayMesh joined(const std::vector<Submesh>& submeshes, const MeshRecipe& recipe) {
  const Vec3d& scale = recipe.scale;
  std::size_t vertices = 0, triangles = 0;
  for (const Submesh& submesh : submeshes) {
    vertices += submesh.vertices.size();
    triangles += submesh.triangles.size();
  }
  DisplayMesh out;
  out.vertices.reserve(vertices);
  out.triangles.reserve(triangles);
  const bool mirrored = ((scale.x < 0) != (scale.y < 0)) != (scale.z < 0);
  for (const Submesh& submesh : submeshes) {
    const auto base = static_cast<std::uint32_t>(out.vertices.size());
    for (const Vec3d& v : submesh.vertices) out.vertices.push_back(in_body(v, recipe));
    for (const Triangle& t : submesh.triangles)
      if (mirrored)
        out.triangles.push_back({base + t[0], base + t[2], base + t[1]});
      else
        out.triangles.push_back({base + t[0], base + t[1], base + t[2]});
  }
  return out;
}

// A mesh in its body's frame, and the options of its geometry.
struct MeshInput {
  const std::vector<Submesh>& submeshes;
  const MeshRecipe& recipe;
  const DisplayMesh& whole;
  std::uint64_t loaded_vertices;
};

enum class MeshKind : std::uint8_t { kHulls, kConvex, kExact };

struct MeshClass {
  MeshKind kind;
  ConvexPartPtr part = {};  // that the classifier built to decide; may be null
  double excess = 0;        // of kConvex, in metres
};

// Only kAuto depends on the mesh: it is kConvex if its vertices alone keep it from being convex, by their rounding, and
// kExact if it is closed and not hollow.
MeshClass classify(const MeshInput& mesh) {
  constexpr double kOfRounding = 0x1p-20;  // share of the size: eight times what float32 moves a vertex by
  const MeshRecipe& recipe = mesh.recipe;
  const auto& [vertices, triangles] = mesh.whole;
  if (recipe.mesh_as == MeshAs::kHull || recipe.mesh_as == MeshAs::kParts) return {MeshKind::kHulls};
  if (recipe.mesh_as != MeshAs::kAuto) return {MeshKind::kExact};
  if (triangles.empty() || !open_edge(vertices, triangles).empty()) return {MeshKind::kHulls};
  ConvexPartPtr hull =
      make_hull_part(vertices, triangles, recipe.radius, mesh.loaded_vertices, mesh.submeshes.size() == 1);
  const std::optional<double> excess = convex_excess(vertices, triangles, *hull);
  if (excess && *excess <= kOfRounding * hull->spread) return {MeshKind::kConvex, std::move(hull), *excess};
  ConvexPartPtr solid = make_surface_part(vertices, triangles, true, recipe.radius, mesh.loaded_vertices);
  if (hollow_place(*solid->surface).empty()) return {MeshKind::kExact, std::move(solid)};
  return {MeshKind::kHulls};
}

// Builds hulls of the mesh or its submeshes, and measures how far they exceed it.
void build_hulls(const MeshInput& mesh, Geometry& out) {
  double hull_volume = 0, solid_volume = 0;
  const auto add = [&](const DisplayMesh& part, std::uint64_t loaded, bool distinct) {
    std::vector<Triangle> faces;
    out.parts.push_back(make_hull_part(part.vertices, part.triangles, mesh.recipe.radius, loaded, distinct, &faces));
    const HullExcess excess = hull_excess(part.vertices, part.triangles, *out.parts.back(), faces);
    out.hull_excess = std::max(out.hull_excess, excess.distance);
    hull_volume += excess.hull_volume;
    solid_volume += excess.solid_volume;
  };
  if (mesh.recipe.mesh_as != MeshAs::kParts)
    add(mesh.whole, mesh.loaded_vertices, mesh.submeshes.size() == 1);
  else
    for (const Submesh& submesh : mesh.submeshes) add(joined({submesh}, mesh.recipe), submesh.loaded_vertices, true);
  out.empty_share =
      hull_volume > 0 ? std::clamp(1 - solid_volume / hull_volume, 0.0, 1.0) : std::numeric_limits<double>::quiet_NaN();
}

// The hull of a mesh that is convex but for rounding is its proxy, and the excess is slack.
void build_convex(const MeshClass& found, Geometry& out) {
  out.parts = {found.part};
  out.model_error = (out.model_error + found.excess) * (1 + 0x1p-52);
}

// Builds the surface or solid that a recipe names.
ConvexPartPtr exact_part(const MeshInput& mesh) {
  const MeshRecipe& recipe = mesh.recipe;
  const auto& [vertices, triangles] = mesh.whole;
  if (triangles.empty()) throw std::invalid_argument("the mesh has no triangles");
  const bool is_solid = recipe.mesh_as != MeshAs::kSurface;
  ConvexPartPtr convex_part = make_surface_part(vertices, triangles, is_solid, recipe.radius, mesh.loaded_vertices);
  if (!is_solid) return convex_part;
  if (const std::string why = hollow_place(*convex_part->surface); !why.empty())
    throw std::invalid_argument("the mesh does not enclose all that its faces go around: " + why);
  return convex_part;
}

void build_exact(const MeshInput& mesh, const MeshClass& found, Geometry& out) {
  try {
    out.parts = {found.part ? found.part : exact_part(mesh)};
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument("mesh_as: " + std::string(word_of(mesh.recipe.mesh_as)) + ": " + e.what());
  }
}

}  // namespace

Geometry geometry_of_mesh(const Mesh& mesh, const MeshRecipe& recipe, const std::string& source) {
  const Vec3d& scale = recipe.scale;
  for (int k = 0; k < 3; ++k)
    if (!(std::abs(scale[k]) > 0 && std::abs(scale[k]) <= kMaxCoordinate))
      throw std::invalid_argument("scale: expected finite numbers other than 0, got " + std::to_string(scale[k]));
  std::uint64_t loaded = 0;
  for (const Submesh& submesh : mesh.submeshes) loaded += submesh.loaded_vertices;
  const auto whole = std::make_shared<const DisplayMesh>(joined(mesh.submeshes, recipe));
  const MeshInput input{mesh.submeshes, recipe, *whole, loaded};
  const MeshClass found = classify(input);
  Geometry out;
  out.model_error = out.model_inner = rounding_of(mesh.submeshes, scale);
  switch (found.kind) {
    case MeshKind::kHulls:
      build_hulls(input, out);
      break;
    case MeshKind::kConvex:
      build_convex(found, out);
      break;
    case MeshKind::kExact:
      build_exact(input, found, out);
      break;
  }
  out.display = whole;
  out.source = mesh_source(source, recipe.mesh_as, out);
  return out;
}

Geometry geometry_of_triangles(std::span<const Vec3d> vertices, std::span<const Triangle> triangles, MeshAs mesh_as,
                               double radius) {
  check_vertices(vertices);
  UniquePositions<double> unique = unique_positions<double>(vertices);
  Mesh mesh;
  Submesh& all = mesh.submeshes.emplace_back();
  all.triangles.resize(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t corner = triangles[t][k];
      if (corner >= vertices.size())
        throw std::invalid_argument("triangle " + std::to_string(t) + " names the vertex " + std::to_string(corner) +
                                    ", and there are " + std::to_string(vertices.size()));
      all.triangles[t][k] = unique.index[corner];
    }
  all.vertices = std::move(unique.positions);
  all.loaded_vertices = vertices.size();
  return geometry_of_mesh(mesh, {.mesh_as = mesh_as, .radius = radius}, "mesh");
}

std::string mesh_source(const std::string& file, MeshAs mesh_as, const Geometry& made) {
  if (mesh_as == MeshAs::kAuto) mesh_as = made.parts[0]->surface ? MeshAs::kSolid : MeshAs::kHull;
  return file + " (" + std::string(word_of(mesh_as)) + ")";
}

}  // namespace clearance
