#include "engine/scene/geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "engine/base/dedupe.h"
#include "engine/base/digest.h"
#include "engine/bvh/enclosure.h"
#include "engine/bvh/surface.h"
#include "engine/decomposition/prove.h"
#include "engine/hull/decomposition.h"
#include "engine/hull/hull.h"
#include "engine/hull/hull_excess.h"

namespace clearance {

namespace {

std::shared_ptr<const DisplayMesh> display_of(const Shape& shape) {
  Shape picture = picture_of(shape);
  auto display = std::make_shared<DisplayMesh>();
  display->vertices = std::move(picture.vertices);
  display->triangles = std::move(picture.triangles);
  return display;
}

// What is shown of a round core: points of its surface, or just around it.
Shape picture_of(const Primitive& round) {
  constexpr int kResolution = 16;
  const Vec3d& size = round.size;
  if (round.kind == Primitive::Kind::kCylinder) return make_cylinder(size.x, 2 * size.z);
  if (round.kind == Primitive::Kind::kEllipsoid) {
    Shape picture = make_uv_sphere(1, kResolution);
    for (Vec3d& v : picture.vertices) v = {v.x * size.x, v.y * size.y, v.z * size.z};
    return picture;
  }
  constexpr std::uint32_t kAround = 2 * kResolution;
  Shape cone;
  cone.vertices = {{0, 0, size.z}, {0, 0, -size.z}};
  for (std::uint32_t j = 0; j < kAround; ++j) {
    double sine, cosine;
    sin_cos_pi(2 * j, kAround, &sine, &cosine);
    cone.vertices.push_back({size.x * cosine, size.x * sine, -size.z});
    const std::uint32_t here = 2 + j, next = 2 + (j + 1) % kAround;
    cone.triangles.push_back({0, here, next});
    cone.triangles.push_back({1, next, here});
  }
  return cone;
}

// One product's: nothing where it is exact, as with powers of two.
double rounding_of_product(double a, double b, double product) {
  constexpr double kNoRemainderBelow = 0x1p-960;  // there the remainder might underflow
  const double off = std::abs(std::fma(a, b, -product));
  return std::abs(product) < kNoRemainderBelow && a != 0 && b != 0 ? std::numeric_limits<double>::min() : off;
}

// How far the scaled vertices may be from those that file and scale mean, metres.
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
  return worst * (1 + 0x1p-40);  // and of the sums above
}

// How far the pieces stand out of what they are the hulls of, and what that leaves empty.
class Excess {
 public:
  /// The piece of a mesh, as make_hull_piece() has it.
  PiecePtr add(const DisplayMesh& mesh, double radius, std::uint64_t loaded, bool distinct) {
    std::vector<Triangle> faces;
    PiecePtr piece = make_hull_piece(mesh.vertices, mesh.triangles, radius, loaded, distinct, &faces);
    const HullExcess excess = hull_excess(mesh.vertices, mesh.triangles, *piece, faces);
    distance_ = std::max(distance_, excess.distance);
    hull_ += excess.hull_volume;
    solid_ += excess.solid_volume;
    return piece;
  }
  double distance() const { return distance_; }
  double empty_share() const {
    return hull_ > 0 ? std::clamp(1 - solid_ / hull_, 0.0, 1.0) : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  double distance_ = 0, hull_ = 0, solid_ = 0;
};

// A vertex of the file in the body's frame. Turning y up is exact: (x, y, z) becomes (x, -z, y).
Vec3d in_body(const Vec3d& v, const MeshRecipe& recipe) {
  const Vec3d scaled{recipe.scale.x * v.x, recipe.scale.y * v.y, recipe.scale.z * v.z};
  return recipe.up == UpAxis::kY ? Vec3d{scaled.x, 0 - scaled.z, scaled.y} : scaled;
}

// The mesh as one, scaled: vertices and triangles of all submeshes, one after another.
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

std::uint64_t digest_of(const Surface& surface, double radius) {
  Digest digest;
  digest.add(surface.digest());
  digest.add(radius);
  if (const Decomposition* pieces = surface.decomposition()) {
    digest.add(pieces->inner);
    for (const PiecePtr& piece : pieces->pieces) digest.add(piece->digest);
  }
  return digest.value();
}

// The hulls of a mesh's parts, and how far they stand out of it.
void add_hulls(const std::vector<Submesh>& submeshes, const DisplayMesh& whole, const MeshRecipe& recipe,
               std::uint64_t loaded, Geometry& out) {
  Excess excess;
  if (recipe.convexify != Convexify::kSubmeshes)
    out.pieces = {excess.add(whole, recipe.radius, loaded, submeshes.size() == 1)};
  else
    for (const Submesh& submesh : submeshes)
      out.pieces.push_back(excess.add(joined({submesh}, recipe), recipe.radius, submesh.loaded_vertices, true));
  out.hull_excess = excess.distance();
  out.empty_share = excess.empty_share();
}

// The pieces that a file proposes, in the mesh's frame.
std::vector<std::vector<Vec3d>> proposed(const Mesh& pieces, const MeshRecipe& recipe) {
  std::vector<std::vector<Vec3d>> out;
  for (const Submesh& piece : pieces.submeshes) out.push_back(joined({piece}, recipe).vertices);
  return out;
}

// The piece of a mesh whose triangles are, or enclose, the body. \param pieces of kDecompose; may be null
PiecePtr true_piece(const DisplayMesh& mesh, const MeshRecipe& recipe, std::uint64_t loaded, const Mesh* pieces) {
  const Convexify convexify = recipe.convexify;
  const std::string who = "convexify: " + std::string(word_of(convexify)) + ": ";
  if (mesh.triangles.empty()) throw std::invalid_argument(who + "the mesh has no triangles");
  try {
    const PiecePtr piece =
        make_surface_piece(mesh.vertices, mesh.triangles, convexify != Convexify::kSurface, recipe.radius, loaded);
    if (convexify == Convexify::kSurface) return piece;
    if (const std::string why = hollow_place(*piece->surface); !why.empty())
      throw std::invalid_argument("the mesh does not enclose all that its faces go around: " + why);
    if (!pieces) return piece;
    return make_decomposed_piece(mesh.vertices, mesh.triangles, proposed(*pieces, recipe), recipe.radius, loaded);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(who + e.what());
  }
}

// What a mesh is by default. The hull of a closed one that is convex but for its vertices' rounding is its proxy: what
// it stands out by is slack. One that is open or hollow counts as its hull.
void add_exact_geometry(const std::vector<Submesh>& submeshes, const DisplayMesh& whole, const MeshRecipe& recipe,
                        std::uint64_t loaded, Geometry& out) {
  constexpr double kOfRounding = 0x1p-20;  // share of the size: eight times what float32 moves a vertex by
  if (whole.triangles.empty() || !open_edge(whole.vertices, whole.triangles).empty())
    return add_hulls(submeshes, whole, recipe, loaded, out);
  const PiecePtr hull = make_hull_piece(whole.vertices, whole.triangles, recipe.radius, loaded, submeshes.size() == 1);
  const std::optional<double> excess = convex_excess(whole.vertices, whole.triangles, *hull);
  if (excess && *excess <= kOfRounding * hull->spread) {
    out.pieces = {hull};
    out.model_error = (out.model_error + *excess) * (1 + 0x1p-52);
    return;
  }
  const PiecePtr solid = make_surface_piece(whole.vertices, whole.triangles, true, recipe.radius, loaded);
  if (hollow_place(*solid->surface).empty())
    out.pieces = {solid};
  else
    add_hulls(submeshes, whole, recipe, loaded, out);
}

}  // namespace

namespace {

// \param hull of the surface's vertices
PiecePtr piece_around(const Piece& hull, const std::shared_ptr<const Surface>& surface) {
  return make_piece(hull.vertices, hull.radius, hull.loaded_vertices, digest_of(*surface, hull.radius), hull.table,
                    surface);
}

}  // namespace

PiecePtr make_surface_piece(std::vector<Vec3d> vertices, std::vector<Triangle> triangles, bool is_solid, double radius,
                            std::uint64_t loaded_vertices, std::shared_ptr<const Decomposition> decomposition) {
  // The hull first: it looks at the coordinates.
  const PiecePtr hull = make_hull_piece(vertices, {}, radius, loaded_vertices);
  auto surface = std::make_shared<Surface>(std::move(vertices), std::move(triangles), is_solid);
  surface->set_decomposition(std::move(decomposition));
  return piece_around(*hull, surface);
}

PiecePtr make_decomposed_piece(std::vector<Vec3d> vertices, std::vector<Triangle> triangles,
                               std::span<const std::vector<Vec3d>> proposed, double radius,
                               std::uint64_t loaded_vertices) {
  const PiecePtr hull = make_hull_piece(vertices, {}, radius, loaded_vertices);
  auto surface = std::make_shared<Surface>(std::move(vertices), std::move(triangles), true);
  surface->set_decomposition(
      std::make_shared<const Decomposition>(prove_decomposition(*surface, proposed).decomposition));
  return piece_around(*hull, surface);
}

PiecePtr with_radius(const Piece& piece, double radius) {
  if (piece.primitive) return make_primitive_piece(*piece.primitive, radius);
  const std::uint64_t digest = piece.surface ? digest_of(*piece.surface, radius) : 0;
  return make_piece(piece.vertices, radius, piece.loaded_vertices, digest, piece.table, piece.surface);
}

std::vector<Triangle> triangles_as_loaded(const Surface& surface) {
  std::vector<Triangle> triangles(surface.triangles().size());
  for (std::size_t i = 0; i < triangles.size(); ++i) triangles[surface.places()[i]] = surface.triangles()[i];
  return triangles;
}

Geometry geometry_of_shape(const Shape& shape, double radius, const std::string& source) {
  Shape grown = shape;
  grown.radius += radius;
  Geometry out;
  out.pieces = {make_hull_piece(shape.vertices, shape.triangles, grown.radius)};
  out.display = display_of(shape.radius > 0 ? grown : shape);  // boxes and prisms are shown without their rounding
  out.model_error = shape.model_error;
  out.source = source;
  return out;
}

Geometry geometry_of_primitive(const Primitive& primitive, double radius, const std::string& source) {
  Geometry out;
  out.pieces = {make_primitive_piece(primitive, radius)};
  if (primitive.kind != Primitive::Kind::kHalfSpace) out.display = display_of(picture_of(primitive));
  out.source = source;
  return out;
}

Primitive cone_of(double radius, double length) {
  return {Primitive::Kind::kCone, {radius, radius, 0.5 * length}};
}

Primitive cylinder_of(double radius, double length) {
  return {Primitive::Kind::kCylinder, {radius, radius, 0.5 * length}};
}

PiecePtr with_prism(const PiecePtr& piece) {
  if (!piece->primitive || piece->primitive->kind != Primitive::Kind::kCylinder) return piece;
  const Vec3d& size = piece->primitive->size;
  return geometry_of_shape(make_cylinder(size.x, 2 * size.z), piece->radius, "cylinder").pieces[0];
}

Geometry geometry_of_points(std::span<const Vec3d> points, double radius) {
  Geometry out;
  auto display = std::make_shared<DisplayMesh>();
  out.pieces = {make_hull_piece(points, {}, radius, 0, false, &display->triangles)};
  display->vertices = out.pieces[0]->vertices;
  if (!display->triangles.empty()) out.display = std::move(display);
  out.source = "points";
  return out;
}

std::string mesh_source(const std::string& file, Convexify convexify, const Geometry& made) {
  if (convexify == Convexify::kAuto) convexify = made.pieces[0]->surface ? Convexify::kSolid : Convexify::kHull;
  const Surface* surface = made.pieces[0]->surface.get();
  if (convexify == Convexify::kDecompose && surface && !surface->decomposition())
    return file + " " + std::string(kNoPiecesYet);
  return file + " (" + std::string(word_of(convexify)) + ")";
}

Geometry geometry_of_mesh(const Mesh& mesh, const MeshRecipe& recipe, const std::string& source, const Mesh* pieces) {
  const Vec3d& scale = recipe.scale;
  const Convexify convexify = recipe.convexify;
  for (int k = 0; k < 3; ++k)
    if (!(std::abs(scale[k]) > 0 && std::abs(scale[k]) <= kMaxCoordinate))
      throw std::invalid_argument("scale: expected finite numbers other than 0, got " + std::to_string(scale[k]));
  std::uint64_t loaded = 0;
  for (const Submesh& submesh : mesh.submeshes) loaded += submesh.loaded_vertices;
  auto whole = std::make_shared<DisplayMesh>(joined(mesh.submeshes, recipe));
  Geometry out;
  out.model_error = out.model_inner = rounding_of(mesh.submeshes, scale);
  if (convexify == Convexify::kAuto)
    add_exact_geometry(mesh.submeshes, *whole, recipe, loaded, out);
  else if (convexify == Convexify::kHull || convexify == Convexify::kSubmeshes)
    add_hulls(mesh.submeshes, *whole, recipe, loaded, out);
  else
    out.pieces = {true_piece(*whole, recipe, loaded, pieces)};
  out.display = std::move(whole);
  out.source = mesh_source(source, convexify, out);
  return out;
}

Geometry geometry_of_triangles(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                               Convexify convexify, double radius) {
  if (convexify == Convexify::kDecompose)
    throw std::invalid_argument(
        "convexify: decompose: only of a mesh file, which pieces are proposed for beside it (clearance decompose "
        "FILE)");
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
  return geometry_of_mesh(mesh, {.convexify = convexify, .radius = radius}, "mesh");
}

}  // namespace clearance
