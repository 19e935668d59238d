// Generators of the case classes, and their table.
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/hull/shapes.h"
#include "tests/oracle/cases/case_shapes.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/exact/lattice.h"

namespace clearance::exact {

namespace {

double largest(const Vec3d& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

// ---- placing

/// Rotates both at random and places b at random near a, so that some pairs are apart and some overlap. Mostly also
/// sets a gap between `least` and 1 of the smaller size, on either side of contact.
Case placed(Random& random, SolidPtr a, SolidPtr b, double least = 1e-16) {
  Case c{std::move(a), std::move(b), random.rotation(), random.rotation()};
  const double ra = reach(*c.a) + c.a->radius, rb = reach(*c.b) + c.b->radius, small = std::min(ra, rb);
  c.X_wb.translation = random.direction() * (random.uniform(0, 1.5) * (ra + rb));
  if (small > 0 && random.chance(0.6)) set_gap(c, random.sign() * small * random.log_uniform(least, 1));
  return c;
}

Pose turned(const Pose& X, const Pose& by) {
  Pose r = compose({{0, 0, 0}, X.qw, X.qx, X.qy, X.qz}, by);
  r.translation = X.translation;
  return r;
}

Case any(Random& random) {
  return placed(random, solid(ordinary(random)), solid(ordinary(random)));
}

// ---- size and place

Case nano(Random& random) {
  const double s = random.log_uniform(1e-10, 1e-8);
  return placed(random, solid(scaled(ordinary(random), s)),
                solid(scaled(ordinary(random), s * random.uniform(0.5, 2))));
}
Case giga(Random& random) {
  const double s = random.log_uniform(1e8, 1e10);
  return placed(random, solid(scaled(ordinary(random), s)),
                solid(scaled(ordinary(random), s * random.uniform(0.5, 2))));
}
Case ratio(Random& random) {
  const double s = random.log_uniform(1e-6, 1e6), r = random.log_uniform(1e3, 1e12);
  SolidPtr small = solid(scaled(ordinary(random), s / std::sqrt(r))),
           large = solid(scaled(ordinary(random), s * std::sqrt(r)));
  if (random.chance(0.5)) std::swap(small, large);
  return placed(random, small, large, 1e-4);
}
bool ratio_hits(const Case& c, const Result&) {
  const double q = reach(*c.a) / reach(*c.b);
  return std::max(q, 1 / q) > 100;
}

Case far_from_world(Random& random) {
  Case c = any(random);
  const Vec3d t = random.direction() * random.log_uniform(1e6, 1e9);
  c.X_wa.translation += t;
  c.X_wb.translation += t;
  if (random.chance(0.5)) set_gap(c, random.sign() * random.log_uniform(1e-12, 1));
  return c;
}
bool far_from_world_hits(const Case& c, const Result&) {
  return norm(c.X_wa.translation) > 9e5 && norm(c.X_wb.translation) > 9e5;
}

Case far_from_frame(Random& random) {
  const auto off = [&](std::vector<Vec3d> v) {
    const Vec3d t = random.direction() * random.log_uniform(1e6, 1e9);
    for (Vec3d& p : v) p += t;
    return solid(std::move(v));
  };
  Case c{off(ordinary(random)), random.chance(0.7) ? off(ordinary(random)) : solid(ordinary(random)), random.rotation(),
         random.rotation()};
  // Moved back to the world's origin, as a careless modeller would do.
  c.X_wa.translation = -(rotation_of(c.X_wa) * c.a->vertices[0]);
  c.X_wb.translation = -(rotation_of(c.X_wb) * c.b->vertices[0]) + random.direction() * random.uniform(0, 3);
  if (random.chance(0.7)) set_gap(c, random.sign() * random.log_uniform(1e-9, 10));
  return c;
}
bool far_from_frame_hits(const Case& c, const Result&) {
  return reach(*c.a) > 9e5;
}

// ---- gap

/// Bodies that touch exactly: two lattice bodies with rational rotations, an extreme point of one at an extreme point
/// of the other. With radii, they are moved apart by their sum along (3, 4, 12), whose length is 13.
Case exact_contact(Random& random) {
  int na, nb;
  Case c;
  c.X_wa = lattice_rotation(random, &na);
  c.X_wb = lattice_rotation(random, &nb);
  const bool rounded = random.chance(0.3);
  const double k = rounded ? random.integer(1, 20) : 0, share = random.integer(0, 13);
  Solid a{lattice_points(random, 5, 12 * na), k * share}, b{lattice_points(random, 5, 12 * nb), k * (13 - share)};
  const std::vector<Vec3d> wa = in_world(a, c.X_wa, na), wb = in_world(b, c.X_wb, nb);
  Vec3d n;
  if (rounded) {
    n = {3 * random.sign(), 4 * random.sign(), 12 * random.sign()};
    if (random.chance(0.3)) n = {0, 5 * random.sign(), 12 * random.sign()};
    const int turn = random.integer(0, 2);
    if (turn == 1) n = {n.y, n.z, n.x};
    if (turn == 2) n = {n.z, n.x, n.y};
  } else {
    const std::vector<Vec3d>& w = random.chance(0.5) ? wa : wb;
    const auto some = [&] { return w[static_cast<std::size_t>(random.integer(0, static_cast<int>(w.size()) - 1))]; };
    const Vec3d p = some();
    n = random.chance(0.7) ? cross(some() - p, some() - p) * (1.0 / 144) : Vec3d{0, 0, 0};  // a facet's normal, perhaps
    if (largest(n) == 0)
      n = {static_cast<double>(random.integer(-2, 2)), static_cast<double>(random.integer(-2, 2)), 1};
  }
  const Vec3d t{static_cast<double>(random.integer(-999, 999)), static_cast<double>(random.integer(-999, 999)), 0};
  const double unit = std::ldexp(1.0, random.integer(-30, 30));
  c.X_wa.translation = t * unit;
  c.X_wb.translation = (t + extreme_point(random, wa, n) - extreme_point(random, wb, -n) + k * n) * unit;
  c.a = solid(scaled(a.vertices, unit), a.radius * unit);
  c.b = solid(scaled(b.vertices, unit), b.radius * unit);
  return c;
}
bool exact_contact_hits(const Case&, const Result& r) {
  return r.distance.compare(0) == 0;
}

/// The same, off by the last bits of one coordinate.
Case last_bit(Random& random) {
  Case c = exact_contact(random);
  const double most = std::max(largest(c.X_wb.translation), scale_of(c));
  double& t = c.X_wb.translation[random.integer(0, 2)];
  t += random.sign() * random.integer(1, 4) * 0x1p-52 * most;
  return c;
}
bool last_bit_hits(const Case& c, const Result& r) {
  return std::abs(r.distance.lower()) < 1e-14 * (scale_of(c) + largest(c.X_wb.translation));
}

Case tiny_gap(Random& random) {
  Case c = any(random);
  set_gap(c, random.sign() * random.log_uniform(1e-15, 1e-1));
  return c;
}
bool tiny_gap_hits(const Case&, const Result& r) {
  return std::abs(r.distance.lower()) < 0.2;
}

Case far_gap(Random& random) {
  Case c = any(random);
  set_gap(c, random.log_uniform(1e2, 1e9));
  return c;
}
bool far_gap_hits(const Case&, const Result& r) {
  return r.distance.lower() > 50;
}

// ---- shape

Case needles(Random& random) {
  return placed(random, needle(random), random.chance(0.7) ? needle(random) : solid(ordinary(random)), 1e-12);
}

Case plates(Random& random) {
  return placed(random, plate(random), random.chance(0.7) ? plate(random) : solid(ordinary(random)), 1e-12);
}

Case slivers(Random& random) {
  return placed(random, sliver(random), random.chance(0.7) ? sliver(random) : solid(ordinary(random)), 1e-14);
}

Case nearly_coplanar(Random& random) {
  Case c = placed(random, nearly_flat(random), random.chance(0.7) ? nearly_flat(random) : solid(ordinary(random)));
  if (random.chance(0.3)) {  // in one plane, or almost
    c.b = solid(c.a->vertices);
    c.X_wb = c.X_wa;
    c.X_wb.translation += random.direction() * random.log_uniform(1e-16, 2);
  }
  return c;
}

Case flats(Random& random) {
  Case c = placed(random, flat(random), random.chance(0.7) ? flat(random) : solid(ordinary(random)));
  if (random.chance(0.3)) {  // both in one plane exactly
    std::vector<Vec3d> v = c.a->vertices;
    const Vec3d w = v[0];
    for (Vec3d& p : v) p = 2 * w - p;
    c.b = solid(std::move(v));
    c.X_wb = c.X_wa;
  }
  return c;
}

Case collinear(Random& random) {
  Case c = placed(random, line(random), random.chance(0.6) ? line(random) : solid(ordinary(random)));
  if (random.chance(0.3)) {  // on one line, or parallel
    c.b = solid(c.a->vertices);
    c.X_wb = c.X_wa;
    const Vec3d along = rotation_of(c.X_wa) * c.a->vertices[0];
    c.X_wb.translation += along * random.uniform(-3, 3);
    if (random.chance(0.5)) c.X_wb.translation += random.direction() * random.log_uniform(1e-16, 1);
  }
  return c;
}

Case duplicated(Random& random) {
  return placed(random, repeated(random), repeated(random));
}

Case single_points(Random& random) {
  Case c;
  c.a = solid({{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)}});
  c.X_wa = random.rotation();
  if (random.chance(0.3)) {  // with another point
    c.b = random.chance(0.5) ? c.a : solid({random.direction()});
    c.X_wb = random.chance(0.5) ? c.X_wa : random.rotation();
    c.X_wb.translation += random.direction() * (random.chance(0.2) ? 0.0 : random.log_uniform(1e-17, 1e3));
    return c;
  }
  // Next to a body: on its vertices, edges or faces, or slightly off them.
  c.b = solid(ordinary(random));
  if (random.chance(0.15)) {  // on a vertex exactly
    c.a = solid({c.b->vertices[0]});
    c.X_wb = c.X_wa;
    return c;
  }
  c.X_wb = random.rotation();
  const auto some = [&] {
    return c.b->vertices[static_cast<std::size_t>(random.integer(0, static_cast<int>(c.b->vertices.size()) - 1))];
  };
  const Vec3d p = random.chance(0.5) ? some() : 0.5 * (some() + some());
  c.X_wa.translation = rotation_of(c.X_wb) * p - rotation_of(c.X_wa) * c.a->vertices[0];
  if (random.chance(0.7)) c.X_wa.translation += random.direction() * random.log_uniform(1e-17, 2);
  return c;
}

Case many_coplanar(Random& random) {
  const auto one = [&] {
    return solid(prism(random, random.integer(24, 200), random.chance(0.5) ? 1.0 : random.uniform(0.2, 1.5)));
  };
  Case c = placed(random, one(), random.chance(0.6) ? one() : solid(ordinary(random)));
  if (random.chance(0.4)) {  // stacked: a facet of many vertices on another
    c.X_wb = c.X_wa;
    c.X_wb.translation += rotation_of(c.X_wa) * Vec3d{random.uniform(-1, 1), random.uniform(-1, 1), 2};
    set_gap(c, random.sign() * random.log_uniform(1e-16, 1e-1));
  }
  return c;
}

Case lattice_ties(Random& random) {
  Case c{solid(lattice_points(random, 4, 1)), solid(lattice_points(random, 4, 1)), {}, {}};
  const auto shift = [&] { return static_cast<double>(random.integer(-3, 3)); };
  c.X_wa.translation = {shift(), shift(), shift()};
  c.X_wb.translation = {shift(), shift(), shift()};
  int n;
  if (random.chance(0.3)) {
    const Vec3d t = c.X_wb.translation;
    c.X_wb = lattice_rotation(random, &n);
    c.X_wb.translation = t;
  }
  return c;
}

Case dense_spheres(Random& random) {
  static constexpr std::array<int, 6> kResolutions = {16, 16, 24, 32, 50, 100};  // 482 ... 19802 vertices
  const auto one = [&] { return dense_sphere(kResolutions[static_cast<std::size_t>(random.integer(0, 5))]); };
  Case c{one(), one(), random.rotation(), random.rotation()};
  c.X_wb.translation = random.direction() * random.uniform(1.5, 4);  // relation_deep has deep pairs of so many facets
  if (random.chance(0.7)) set_gap(c, random.sign() * random.log_uniform(1e-16, 0.1));
  return c;
}
bool dense_spheres_hits(const Case& c, const Result&) {
  return c.a->vertices.size() >= 482;
}

// ---- relation

/// Faces and edges of b parallel to those of a: the same rotation, or by right angles more.
Case parallel(Random& random) {
  Case c{faced(random), faced(random), random.rotation(), {}};
  c.X_wb = c.X_wa;
  if (random.chance(0.5)) {
    Pose by;
    (random.chance(0.5) ? by.qx : by.qz) = random.sign();  // 90 degrees
    c.X_wb = turned(c.X_wa, by);
  }
  const Vec3d axis = rotation_of(c.X_wa) *
                     Vec3d{random.integer(0, 1) * random.sign(), random.integer(0, 1) * random.sign(), random.sign()};
  c.X_wb.translation = axis * 3.0 + random.direction() * random.log_uniform(1e-3, 1);
  set_gap(c, random.sign() * random.log_uniform(1e-16, 1));
  return c;
}

Case almost_parallel(Random& random) {
  Case c = parallel(random);
  const double angle = random.log_uniform(1e-17, 1e-3);
  const Vec3d axis = random.direction();
  c.X_wb = turned(c.X_wb, {{0, 0, 0}, 1, angle * axis.x, angle * axis.y, angle * axis.z});
  set_gap(c, random.sign() * random.log_uniform(1e-16, 1));
  return c;
}

Case coincident(Random& random) {
  Case c = any(random);
  c.b = c.a;
  c.X_wb = c.X_wa;
  switch (random.integer(0, 3)) {
    case 0:
      break;
    case 1:
      c.X_wb.translation[random.integer(0, 2)] += random.sign() * random.log_uniform(1e-18, 1e-12);
      break;
    case 2:
      c.X_wb.qx *= 1 + 0x1p-52;
      break;
    default:
      c.X_wb = turned(c.X_wb, {{0, 0, 0}, 1, random.sign() * random.log_uniform(1e-17, 1e-10), 0, 0});
  }
  return c;
}
bool coincident_hits(const Case& c, const Result& r) {
  return r.cores_overlap || r.distance.lower() < 1e-9 * scale_of(c);
}

Case concentric(Random& random) {
  const auto one = [&]() -> SolidPtr {
    switch (random.integer(0, 3)) {
      case 0:
        return solid(box({1, 1, 1}));
      case 1:
        return solid(box({random.uniform(0.2, 1), random.uniform(0.2, 1), random.uniform(0.2, 1)}));
      case 2:
        return solid(make_uv_sphere(1, 5).vertices);
      default:
        return solid(make_uv_sphere(random.uniform(0.5, 1), random.integer(3, 9)).vertices);
    }
  };
  Case c{one(), one(), {}, {}};
  if (random.chance(0.5)) c.X_wa = random.rotation();
  if (random.chance(0.5)) c.X_wb = random.rotation();
  if (random.chance(0.5)) c.b = solid(scaled(c.b->vertices, random.log_uniform(1e-6, 1)));
  const Vec3d t = random.direction() * random.uniform(0, 10);
  c.X_wa.translation = c.X_wb.translation = t;
  return c;
}

Case deep(Random& random) {
  Case c{solid(ordinary(random)), solid(ordinary(random)), random.rotation(), random.rotation()};
  if (random.chance(0.1)) c.a = dense_sphere(16);
  c.X_wb.translation = random.direction() * random.uniform(0, 0.5);
  return c;
}
bool overlap_hits(const Case&, const Result& r) {
  return r.distance.sign < 0 || r.cores_overlap;
}

Case crossing(Random& random) {
  const auto bar = [&] {
    const double length = random.log_uniform(1e1, 1e6);
    return solid(box({random.uniform(0.1, 1), random.uniform(0.1, 1), length}));
  };
  Case c{bar(), bar(), random.rotation(), random.rotation()};
  if (random.chance(0.3)) c.X_wb = turned(c.X_wa, {{0, 0, 0}, 1, 1, 0, 0});  // at right angles
  if (random.chance(0.2)) c.X_wb = turned(c.X_wa, {{0, 0, 0}, 1, random.log_uniform(1e-9, 1e-2), 0, 0});
  c.X_wb.translation = random.direction() * random.uniform(0, 1);
  if (random.chance(0.6)) set_gap(c, random.sign() * random.log_uniform(1e-14, 1));
  return c;
}

// ---- rounded

/// Two bodies with radii: apart, cores apart but grown bodies overlapping, or cores overlapping.
Case rounded_pair(Random& random, std::vector<Vec3d> a, std::vector<Vec3d> b) {
  const double ra = random.log_uniform(1e-3, 10), rb = random.chance(0.2) ? 0 : random.log_uniform(1e-3, 10);
  return placed(random, solid(std::move(a), ra), solid(std::move(b), rb));
}
Case spheres(Random& random) {
  Case c = rounded_pair(random, {{0, 0, 0}}, {{0, 0, 0}});
  if (random.chance(0.1)) c.X_wb.translation = c.X_wa.translation;
  return c;
}
Case capsules(Random& random) {
  const auto core = [&]() -> std::vector<Vec3d> {
    const double h = random.log_uniform(1e-3, 1e3);
    return {{0, 0, -h}, {0, 0, h}};
  };
  Case c = rounded_pair(random, core(), core());
  if (random.chance(0.2)) {  // parallel or collinear
    c.X_wb.qw = c.X_wa.qw, c.X_wb.qx = c.X_wa.qx, c.X_wb.qy = c.X_wa.qy, c.X_wb.qz = c.X_wa.qz;
    set_gap(c, random.sign() * random.log_uniform(1e-14, 1));
  }
  return c;
}
Case rounded_hulls(Random& random) {
  return rounded_pair(random, ordinary(random), ordinary(random));
}
bool rounded_hits(const Case& c, const Result&) {
  return c.a->radius > 0;
}

// ---- input

Case odd_quaternions(Random& random) {
  Case c = any(random);
  for (Pose* X : {&c.X_wa, &c.X_wb}) {
    const double s = random.log_uniform(2e-6, 5e5);
    X->qw *= s, X->qx *= s, X->qy *= s, X->qz *= s;
  }
  set_gap(c, random.sign() * random.log_uniform(1e-15, 1));
  return c;
}
bool odd_quaternions_hits(const Case& c, const Result&) {
  return check(c.X_wa) != PoseQuality::kBad;
}

}  // namespace

const std::vector<CaseClass>& case_classes() {
  static const std::vector<CaseClass> kClasses = {
      {"ordinary", "random hulls, boxes and uv spheres of size 1, at random and near contact", any},
      {"size_nano", "both of about a nanometre", nano},
      {"size_giga", "both of about a million kilometres", giga},
      {"size_ratio", "sizes in a ratio of 1e3 to 1e12", ratio, ratio_hits},
      {"place_far_from_world", "both 1e6 to 1e9 m from the world's origin", far_from_world, far_from_world_hits},
      {"place_far_from_frame", "meshes 1e6 to 1e9 m from their own frame's origin", far_from_frame,
       far_from_frame_hits},
      {"gap_exact_contact", "bodies that touch exactly, with and without radius", exact_contact, exact_contact_hits},
      {"gap_last_bit", "those, off by the last bits of one coordinate", last_bit, last_bit_hits},
      {"gap_tiny", "1e-15 to 0.1 of the size, either side of contact", tiny_gap, tiny_gap_hits, 0.9},
      {"gap_far", "1e2 to 1e9 times the size", far_gap, far_gap_hits},
      {"shape_needles", "length over thickness 1e3 to 1e9 and more", needles},
      {"shape_plates", "thickness over width 1e-12 to 1e-3", plates},
      {"shape_slivers", "4 to 8 points almost on a segment or a plane", slivers},
      {"shape_nearly_coplanar", "vertices off a plane by 1e-17 to 1e-8", nearly_coplanar},
      {"shape_flat", "vertices exactly in a plane, also both in one plane", flats},
      {"shape_collinear", "vertices exactly or almost on a line, also both on one line", collinear},
      {"shape_duplicated", "vertices repeated, or on edges and faces, or off by a last bit", duplicated},
      {"shape_single_points", "a point against a point or a body, on its vertices, edges and faces", single_points},
      {"shape_many_coplanar", "prisms with facets of 24 to 200 vertices, also stacked", many_coplanar, nullptr, 1.0, 3},
      {"shape_lattice_ties", "small integer coordinates: ties everywhere", lattice_ties},
      {"shape_dense_spheres", "spheres of 482 to 19802 vertices", dense_spheres, dense_spheres_hits, 1.0, 40},
      {"relation_parallel", "parallel faces and edges", parallel},
      {"relation_almost_parallel", "the same, turned by 1e-17 to 1e-3", almost_parallel},
      {"relation_coincident", "the same body at the same place, or off by last bits", coincident, coincident_hits},
      {"relation_concentric", "symmetric bodies with one centre", concentric, overlap_hits},
      {"relation_deep", "one far inside the other", deep, overlap_hits, 0.7, 3},
      {"relation_crossing", "bars of length 10 to 1e6 that cross", crossing},
      {"rounded_spheres", "spheres", spheres, rounded_hits},
      {"rounded_capsules", "capsules, also parallel and collinear", capsules, rounded_hits},
      {"rounded_hulls", "hulls with radius", rounded_hulls, rounded_hits},
      {"input_quaternions", "quaternions of norm 2e-6 to 5e5", odd_quaternions, odd_quaternions_hits},
  };
  return kClasses;
}

}  // namespace clearance::exact
