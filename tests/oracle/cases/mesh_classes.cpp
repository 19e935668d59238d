// Generators of the mesh classes, and their table.
#include <algorithm>
#include <cmath>

#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/exact/lattice.h"

namespace clearance::exact {

namespace {

// ---- placing

/// A point of the box around a body, in its frame.
Vec3d somewhere_in(Random& random, const Solid& s) {
  Vec3d low = s.vertices[0], high = low, p;
  for (const Vec3d& v : s.vertices)
    for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], v[k]), high[k] = std::max(high[k], v[k]);
  for (int k = 0; k < 3; ++k) p[k] = random.uniform(low[k], high[k]);
  return p;
}

/// Rotates both at random, or neither, and places a point of b at a point of a's box or anywhere near. Mostly also
/// moves b until the remaining gap is between `least` and 1 of the smaller size, on either side of contact.
Case placed(Random& random, SolidPtr a, SolidPtr b, double least = 1e-15) {
  Case c{std::move(a), std::move(b), random.rotation(), random.rotation()};
  if (random.chance(0.2)) c.X_wa = c.X_wb = {};
  const double near = random.chance(0.4) ? 0 : random.uniform(0, 2) * (reach(*c.a) + c.a->radius + c.b->radius);
  c.X_wb.translation = rotation_of(c.X_wa) * somewhere_in(random, *c.a) -
                       rotation_of(c.X_wb) * somewhere_in(random, *c.b) + random.direction() * near;
  if (random.chance(0.6)) {
    const double small = std::min(reach(*c.a) + c.a->radius, reach(*c.b) + c.b->radius);
    set_gap(c, (random.chance(0.8) ? 1 : -1) * small * random.log_uniform(least, 1));
  }
  return c;
}

/// A body near a mesh of size 1: a hull, another mesh, a grown point or segment, mostly smaller.
SolidPtr visitor(Random& random) {
  const double s = random.log_uniform(0.05, 1);
  switch (random.integer(0, 5)) {
    case 0:
      return solid({{0, 0, 0}}, random.chance(0.5) ? 0 : s);
    case 1:
      return solid({{0, 0, -s}, {0, 0, s}}, 0.3 * s);
    case 2:
    case 3:
      return solid(scaled(ordinary(random), s));
    default:
      return solid(scaled(any_mesh(random), {s, s, s}), random.chance(0.7));
  }
}

Case visited(Random& random, Mesh mesh, bool is_solid) {
  SolidPtr a = solid(std::move(mesh), is_solid), b = visitor(random);
  if (random.chance(0.3)) std::swap(a, b);
  return placed(random, std::move(a), std::move(b));
}
bool is_solid_mostly(Random& random) {
  return random.chance(0.75);
}

template <Mesh (*make)(Random&)>
Case shape(Random& random) {
  Mesh mesh = make(random);
  return visited(random, std::move(mesh), is_solid_mostly(random));
}

Case combs(Random& random) {
  Mesh mesh = comb(random, 1e-6);
  return visited(random, std::move(mesh), is_solid_mostly(random));
}
Case plates(Random& random) {
  const auto one = [&] { return solid(plate(random, random.log_uniform(1e-12, 1e-3)), is_solid_mostly(random)); };
  SolidPtr a = one();
  return placed(random, std::move(a), random.chance(0.5) ? one() : visitor(random));
}

// ---- defects of triangulations

Case slivers(Random& random) {
  Mesh mesh = any_mesh(random);
  split(random, mesh, random.integer(1, 30), random.log_uniform(1e-17, 1e-3));
  if (random.chance(0.5)) mesh = scaled(std::move(mesh), {1, 1, random.log_uniform(1e-6, 1)});
  return visited(random, std::move(mesh), is_solid_mostly(random));
}
Case duplicated(Random& random) {
  Mesh mesh = any_mesh(random);
  const std::size_t before = mesh.triangles.size();
  if (random.chance(0.3)) append(mesh, Mesh(mesh));  // twice: all winding numbers are doubled
  for (std::size_t i = 0; i < before; ++i) {
    if (!random.chance(0.2)) continue;
    const Triangle t = mesh.triangles[i];
    mesh.triangles.push_back(t);
    mesh.triangles.push_back({t[1], t[0], t[2]});  // and reversed, so that it stays closed
  }
  return visited(random, std::move(mesh), is_solid_mostly(random));
}
Case cracks(Random& random) {
  const Mesh whole = any_mesh(random);
  return visited(random, cracked(random, whole, random.chance(0.2) ? 0 : random.log_uniform(1e-16, 1e-2)), false);
}
Case inverted(Random& random) {
  return visited(random, flipped(any_mesh(random)), true);
}
Case tangled(Random& random) {
  Mesh mesh = any_mesh(random);
  shake(random, mesh, random.uniform(0.05, 0.7));
  return visited(random, std::move(mesh), is_solid_mostly(random));
}
Case degenerate(Random& random) {
  Mesh mesh = any_mesh(random);
  for (int i = random.integer(1, 8); i > 0; --i) {
    const Triangle t =
        mesh.triangles[static_cast<std::size_t>(random.integer(0, static_cast<int>(mesh.triangles.size()) - 1))];
    const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
    if (random.chance(0.3)) {
      mesh.triangles.push_back({t[0], t[0], t[1]});
    } else if (random.chance(0.3)) {
      mesh.triangles.push_back({t[2], t[2], t[2]});
    } else {  // three vertices on a line, there and back
      mesh.vertices.push_back(2.0 * mesh.vertices[t[1]] - mesh.vertices[t[0]]);
      mesh.triangles.push_back({t[0], t[1], n});
      mesh.triangles.push_back({t[1], t[0], n});
    }
  }
  return visited(random, std::move(mesh), is_solid_mostly(random));
}
Case few_triangles(Random& random) {
  const auto soup = [&] {
    Mesh mesh;
    const int count = random.integer(1, 3);
    for (int i = 0; i < 3 * count; ++i)
      mesh.vertices.push_back(random.direction() * (random.chance(0.1) ? 0 : random.uniform(0, 1)));
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(count); ++i)
      mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    return mesh;
  };
  SolidPtr a = solid(soup(), false, random.chance(0.2) ? 0.1 : 0);
  return placed(random, std::move(a), random.chance(0.5) ? solid(soup(), false) : visitor(random));
}

// ---- inside and outside

/// A shell within a shell: with the opposite orientation a cavity, with the same one a doubled winding number. b is
/// mostly within.
Case shells(Random& random) {
  const double inner = random.uniform(0.5, 0.99);
  Mesh mesh = random.chance(0.5) ? box_mesh({1, 1, 1}) : ball(random);
  Mesh core = scaled(random.chance(0.5) ? mesh : box_mesh({0.5, 0.5, 0.5}), {inner, inner, inner});
  append(mesh, random.chance(0.6) ? flipped(std::move(core)) : core);
  if (random.chance(0.2)) mesh = flipped(std::move(mesh));
  const double s = random.uniform(0.05, 0.5);
  SolidPtr a = solid(std::move(mesh), true);
  SolidPtr b =
      random.chance(0.5) ? solid(scaled(ordinary(random), s)) : solid(scaled(any_mesh(random), {s, s, s}), true);
  if (random.chance(0.5)) std::swap(a, b);
  return placed(random, std::move(a), std::move(b));
}
/// One within the other, up to its skin. In a solid they overlap by at least a tiny depth. Some have another component
/// outside, some the axes of the other.
Case held(Random& random) {
  const double s = random.log_uniform(1e-3, 0.3);
  if (random.chance(0.2)) {
    Case c{solid(box_mesh({1, 1, 1}), true), solid(box({s, s, s})), {}, {}};
    if (random.chance(0.5)) std::swap(c.a, c.b);
    return c;
  }
  const Mesh mesh = random.chance(0.5) ? box_mesh({1, 1, 1}) : ball(random);
  Mesh part = scaled(any_mesh(random), {s, s, s});
  if (random.chance(0.5)) {
    Mesh outside = moved(part, {0, 0, 5});
    append(outside, part);
    part = std::move(outside);
  }
  SolidPtr b = random.chance(0.3) ? solid(scaled(ordinary(random), s)) : solid(std::move(part), true);
  Case c{solid(mesh, false), std::move(b), random.rotation(), random.rotation()};
  c.X_wb.translation = random.direction() * random.uniform(0, 0.5);
  set_gap(c, s * random.log_uniform(1e-18, 1));
  c.a = solid(mesh, random.chance(0.6));
  if (random.chance(0.5)) std::swap(c.a, c.b), std::swap(c.X_wa, c.X_wb);
  return c;
}
/// One in the other's cavity, with its own body in its own cavity: apart, although boxes and hulls contain each other.
Case nested(Random& random) {
  const auto hollow = [&](double size, double wall) {
    Mesh mesh = box_mesh({size, size, size});
    append(mesh, flipped(box_mesh({size - wall, size - wall, size - wall})));
    return mesh;
  };
  const double wall = random.log_uniform(1e-6, 0.1), size = random.uniform(0.1, 0.6);
  Case c{solid(hollow(1, wall), true), solid(hollow(size, size * wall), true), random.rotation(), {}};
  if (random.chance(0.5)) c.X_wb = random.rotation();
  const double free = 1 - wall - std::sqrt(3.0) * size;
  c.X_wb.translation = random.direction() * std::max(0.0, free * random.uniform(0, 1.5));
  if (random.chance(0.5)) set_gap(c, random.log_uniform(1e-15, 1e-2));
  if (random.chance(0.5)) std::swap(c.a, c.b), std::swap(c.X_wa, c.X_wb);
  return c;
}
/// Rings that pass through each other's holes.
Case linked(Random& random) {
  Case c{solid(ring(random), is_solid_mostly(random)), solid(ring(random), is_solid_mostly(random)), {}, {}};
  c.X_wb = {{random.uniform(0.7, 1.3), 0, 0}, std::sqrt(0.5), std::sqrt(0.5), 0, 0};
  if (random.chance(0.5)) {
    const Pose turn = random.rotation(random.direction());
    c.X_wa = compose(turn, c.X_wa), c.X_wb = compose(turn, c.X_wb);
  }
  if (random.chance(0.5)) set_gap(c, random.log_uniform(1e-15, 1e-2));
  return c;
}
Case parts(Random& random) {
  Mesh mesh = any_mesh(random);
  for (int i = random.integer(1, 3); i > 0; --i) append(mesh, moved(any_mesh(random), 2 * random.direction()));
  return visited(random, std::move(mesh), is_solid_mostly(random));
}

// ---- size and place

Case scales(Random& random) {
  Case c = visited(random, any_mesh(random), is_solid_mostly(random));
  const double s = random.log_uniform(1e-6, 1e3);
  const auto by = [&](const Solid& old) {
    return std::make_shared<const Solid>(Solid{scaled(old.vertices, s), s * old.radius, old.triangles, old.is_solid});
  };
  c.a = by(*c.a), c.b = by(*c.b);
  c.X_wa.translation = c.X_wa.translation * s, c.X_wb.translation = c.X_wb.translation * s;
  return c;
}
Case far_from_world(Random& random) {
  Case c = visited(random, any_mesh(random), is_solid_mostly(random));
  const Vec3d t = random.direction() * random.log_uniform(1e3, 1e6);
  c.X_wa.translation += t, c.X_wb.translation += t;
  return c;
}
Case far_from_frame(Random& random) {
  const Vec3d t = random.direction() * random.log_uniform(1e3, 1e6);
  return visited(random, moved(any_mesh(random), t), is_solid_mostly(random));
}

// ---- clouds

/// Points on the skin of a mesh, some of them twice, or anywhere about it; few, since the oracle is slow.
std::vector<CloudPoint> points_about(Random& random, double size) {
  const Mesh mesh = any_mesh(random);
  std::vector<CloudPoint> points;
  const Vec3d shift = random.chance(0.2) ? random.direction() * random.log_uniform(1, 1e4) : Vec3d{0, 0, 0};
  for (int i = random.integer(1, 60); i > 0; --i) {
    const auto pick = [&](std::size_t n) {
      return static_cast<std::size_t>(random.integer(0, static_cast<int>(n) - 1));
    };
    const Triangle& t = mesh.triangles[pick(mesh.triangles.size())];
    const double u = random.uniform(), v = random.uniform(0, 1 - u);
    Vec3d p = mesh.vertices[t[0]] * (1 - u - v) + mesh.vertices[t[1]] * u + mesh.vertices[t[2]] * v;
    if (random.chance(0.1)) p = random.direction() * random.uniform(0, 2);
    p = (p + shift) * size;
    points.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    if (random.chance(0.1)) points.push_back(points[pick(points.size())]);
  }
  return points;
}
/// A cloud next to a body as for meshes, or to another cloud.
Case with_cloud(Random& random, SolidPtr a) {
  SolidPtr b = random.chance(0.25) ? cloud(points_about(random, random.log_uniform(0.1, 1)), 0,
                                           random.chance(0.5) ? 0 : random.log_uniform(1e-3, 0.1))
                                   : visitor(random);
  if (random.chance(0.3)) std::swap(a, b);
  return placed(random, std::move(a), std::move(b));
}
Case points(Random& random) {
  return with_cloud(random, cloud(points_about(random, 1), 0));
}
Case balls(Random& random) {
  return with_cloud(random, cloud(points_about(random, random.log_uniform(0.1, 10)), 0, random.log_uniform(1e-4, 0.3)));
}
/// Boxes of a grid or anywhere, whose corners are exact.
Case voxels(Random& random) {
  std::vector<CloudPoint> points = points_about(random, 1);
  const bool on_grid = random.chance(0.6);
  const float edge = std::ldexp(on_grid ? 1.0f : static_cast<float>(random.integer(1, 15)), -random.integer(4, 8));
  for (CloudPoint& p : points)
    for (float& x : p) x = std::round(x / edge * 64) / 64 * edge;  // a multiple of both
  if (on_grid)
    for (CloudPoint& p : points)
      for (float& x : p) x = (std::floor(x / edge) + 0.5f) * edge;
  return with_cloud(random, cloud(std::move(points), edge, random.chance(0.8) ? 0 : random.log_uniform(1e-3, 0.1)));
}
/// Many of them within a solid's cavity, in the solid itself, or on either side of its skin.
Case cloud_in_solid(Random& random) {
  Mesh shell = box_mesh({1, 1, 1});
  if (random.chance(0.7)) append(shell, flipped(box_mesh({0.9, 0.9, 0.9})));
  std::vector<CloudPoint> points = points_about(random, random.uniform(0.1, 0.6));
  if (random.chance(0.3)) points.push_back({0.95f, 0, 0});
  Case c{solid(shell, true), cloud(std::move(points), 0, random.chance(0.7) ? 0 : 1e-3), random.rotation(), {}};
  c.X_wb = random.chance(0.5) ? c.X_wa : random.rotation();
  c.X_wb.translation = c.X_wa.translation + random.direction() * random.uniform(0, 0.3);
  if (random.chance(0.5)) std::swap(c.a, c.b), std::swap(c.X_wa, c.X_wb);
  return c;
}
bool has_cloud(const Case& c, const Result&) {
  return !c.a->cloud.empty() || !c.b->cloud.empty();
}

// ---- exact contact

/// Cubes of a lattice with rational rotations: faces, edges and vertices that meet exactly.
Case lattice(Random& random) {
  int n = 1;
  const Pose X = lattice_rotation(random, &n);
  const auto one = [&]() -> SolidPtr {
    if (random.chance(0.3)) return solid(box({1.0 * n, 1.0 * n, 2.0 * n}));
    return solid(cells(random, n), random.chance(0.8));
  };
  Case c{one(), one(), X, X};
  // An integer number of steps along the rotated axes is an integer in the world's.
  const auto steps = [&] { return static_cast<double>(random.integer(-4, 4)) / (random.chance(0.3) ? 2 : 1); };
  const Solid shift{{{n * steps(), n * steps(), n * steps()}}, 0};
  c.X_wb.translation = in_world(shift, X, n)[0];
  return c;
}
bool lattice_hits(const Case& c, const Result& r) {
  return !c.a->triangles.empty() || !c.b->triangles.empty() || r.cores_overlap;
}
Case coincident(Random& random) {
  if (random.chance(0.3)) {  // a skin within a skin
    const Mesh mesh = ball(random);
    const double out = 1 + random.log_uniform(1e-14, 1e-2);
    return {solid(mesh, false), solid(scaled(mesh, {out, out, out}), false), {}, {}};
  }
  const SolidPtr a = solid(any_mesh(random), is_solid_mostly(random));
  Case c{a,
         random.chance(0.5) ? a : solid({a->vertices, flipped({a->vertices, a->triangles}).triangles}, true),
         random.rotation(random.direction()),
         {}};
  c.X_wb = c.X_wa;
  if (random.chance(0.3)) c.X_wb.translation += random.direction() * random.log_uniform(1e-16, 1e-1);
  return c;
}
bool coincident_hits(const Case& c, const Result&) {
  return norm(c.X_wa.translation - c.X_wb.translation) < 0.2;
}

Case rounded(Random& random) {
  SolidPtr a = solid(any_mesh(random), is_solid_mostly(random), random.log_uniform(1e-4, 0.3));
  const double s = random.log_uniform(0.05, 1);
  SolidPtr b = random.chance(0.5)
                   ? visitor(random)
                   : solid(scaled(any_mesh(random), {s, s, s}), is_solid_mostly(random), random.log_uniform(1e-4, 0.3));
  if (random.chance(0.5)) std::swap(a, b);
  return placed(random, std::move(a), std::move(b));
}
bool rounded_hits(const Case& c, const Result&) {
  return c.a->radius + c.b->radius > 0;
}

bool has_triangles(const Case& c, const Result&) {
  return !c.a->triangles.empty() || !c.b->triangles.empty();
}

}  // namespace

const std::vector<CaseClass>& mesh_classes() {
  static const std::vector<CaseClass> kClasses = {
      {"mesh_bent", "L, U and S against hulls, points, capsules and other meshes", shape<bent>, has_triangles},
      {"mesh_shelf", "shelves of boards that overlap or are flush", shape<shelf>, has_triangles},
      {"mesh_ring", "tori, from 18 triangles", shape<ring>, has_triangles},
      {"mesh_mug", "mugs whose handles overlap the wall", shape<mug>, has_triangles},
      {"mesh_spiral", "spirals, flat and rising", shape<spiral>, has_triangles},
      {"mesh_comb", "combs and serpentines with gaps of 1e-6", combs, has_triangles},
      {"mesh_plates", "bent plates, 1e-12 to 1e-3 thick", plates, has_triangles},
      {"mesh_slivers", "triangles of a height of 1e-17 to 1e-3", slivers, has_triangles},
      {"mesh_duplicated", "triangles there twice, or there and back", duplicated, has_triangles},
      {"mesh_cracks", "surfaces with holes, T-junctions and cracks of 1e-16 to 1e-2", cracks, has_triangles},
      {"mesh_inverted", "solids whose triangles all look inward", inverted, has_triangles},
      {"mesh_tangled", "meshes that cross themselves", tangled, has_triangles},
      {"mesh_degenerate", "triangles of repeated or collinear vertices", degenerate, has_triangles},
      {"mesh_few", "surfaces of one to three triangles", few_triangles, has_triangles},
      {"mesh_shells", "shells within shells: cavities, and inside twice", shells, has_triangles},
      {"mesh_held", "one within the other, 1e-21 to 0.3 from its skin", held, has_triangles},
      {"mesh_nested", "solids in each other's cavities", nested, has_triangles},
      {"mesh_linked", "rings through each other's holes", linked, has_triangles},
      {"mesh_parts", "bodies of several parts, apart or overlapping", parts, has_triangles},
      {"mesh_scales", "sizes from 1e-6 to 1e3 m", scales, has_triangles},
      {"mesh_far_from_world", "both 1e3 to 1e6 m from the world's origin", far_from_world, has_triangles},
      {"mesh_far_from_frame", "vertices 1e3 to 1e6 m from the frame's origin", far_from_frame, has_triangles},
      {"cloud_points", "points against hulls, meshes and other points", points, has_cloud},
      {"cloud_balls", "the same, grown by 1e-4 to 0.3", balls, has_cloud},
      {"cloud_voxels", "boxes of one size, on a grid or anywhere", voxels, has_cloud},
      {"cloud_in_solid", "points in a solid, in its cavity, either side of its skin", cloud_in_solid, has_cloud},
      {"mesh_lattice", "cubes of a lattice: exact contact of faces, edges, vertices", lattice, lattice_hits, 0.8},
      {"mesh_coincident", "a mesh on itself, or off or larger by 1e-16 to 0.1", coincident, coincident_hits},
      {"mesh_rounded", "surfaces and solids with radius", rounded, rounded_hits},
  };
  return kClasses;
}

}  // namespace clearance::exact
