// The proof that a surface of CSO triangles contains a ball around the origin: surfaces of EPA are proved, never deeper
// than exact, and any damage to the surface is detected.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "engine/narrow/epa.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 21;

struct Cso {
  const PlacedPair<double>& pair;

  CsoSupport<double> operator()(const Vec3d& v) const {
    const SupportPoint<double> a = support(*pair.a, -v);
    const SupportPoint<double> b = support(*pair.b, pair.R.transpose_times(v));
    return {{pair.cso_vertex(a.index, b.index), a.index, b.index}, -dot(v, pair.D) - (a.value + b.value)};
  }
};

/// A case and the surface that EPA leaves, without a seed.
struct Surfaced {
  Case c;
  ConvexPartPtr a, b;
  PlacedPair<double> pair;
  Epa<double> epa;
  std::vector<CsoFace<double>> faces;

  explicit Surfaced(const Case& from)
      : c(from),
        a(make_convex_part(c.a->vertices, c.a->radius)),
        b(make_convex_part(c.b->vertices, c.b->radius)),
        pair(*a, rotation_of(c.X_wa), c.X_wa.translation, *b, rotation_of(c.X_wb), c.X_wb.translation) {
    EpaLimits limits;
    limits.noise = 8 * 0x1p-53 * pair.scale;
    epa.run(Cso{pair}, limits, {});
    faces.assign(epa.faces().begin(), epa.faces().end());
  }
  double ball() const { return certify_ball<double>(pair, epa.vertices(), faces); }
};

template <class Use>
void for_cases(const Use& use) {
  for (const CaseClass& cls : case_classes())
    for (int i = 0; i < (cls.cost > 3 ? 5 : 40); ++i) {
      Surfaced s(make_case(cls, kSeed, static_cast<std::uint64_t>(i)));
      if (!s.faces.empty()) use(s, cls.name + ' ' + std::to_string(i));
    }
}

TEST(Surface, IsProvedAndNeverDeeperThanExact) {
  int proved = 0, deep = 0;
  for_cases([&](const Surfaced& s, const std::string& where) {
    const double ball = s.ball();
    const Result exact_value = exact_answer(s.c);
    deep += exact_value.cores_overlap && exact_value.distance.compare(-(s.pair.radius + 1e-9 * s.pair.scale)) < 0;
    if (!(ball > 0)) return;
    ++proved;
    ASSERT_LE(exact_value.distance.compare(certify_overlap(*s.a, *s.b, ball)), 0) << where;
  });
  std::printf("%d surfaces proved, of %d clear overlaps\n", proved, deep);
  EXPECT_GT(deep, 300);
  EXPECT_GT(proved, deep * 9 / 10);
}

TEST(Surface, WithADamagedFaceIsRejected) {
  int tried = 0;
  for_cases([&](Surfaced& s, const std::string& where) {
    if (!(s.ball() > 0)) return;
    ++tried;
    const std::vector<CsoFace<double>> whole = s.faces;
    const std::size_t f = static_cast<std::size_t>(tried) * 7 % whole.size(), g = (f + 1) % whole.size();
    s.faces[f] = whole[g];  // a hole, and one face twice
    EXPECT_LE(s.ball(), 0) << where;
    s.faces = whole;
    s.faces.pop_back();
    EXPECT_LE(s.ball(), 0) << where;
    s.faces = whole;
    std::swap(s.faces[f].vertex[0], s.faces[f].vertex[1]);
    EXPECT_LE(s.ball(), 0) << where;
    s.faces = whole;
    std::swap(s.faces[f].twin[1], s.faces[f].twin[2]);
    EXPECT_LE(s.ball(), 0) << where;
    s.faces = whole;
    s.faces[f].twin[0] = half_edge(static_cast<std::uint32_t>(f), 3);
    EXPECT_LE(s.ball(), 0) << where;
    s.faces = whole;
    s.faces[f].normal = -s.faces[f].normal;
    EXPECT_LE(s.ball(), 0) << where;
    s.faces = whole;
    for (CsoFace<double>& face : s.faces) {  // inside out it is still around the origin
      std::swap(face.vertex[0], face.vertex[1]);
      std::swap(face.twin[1], face.twin[2]);
      for (std::uint32_t& t : face.twin) t = half_edge(face_of(t), edge_of(t) == 0 ? 0 : 3 - edge_of(t));
    }
    EXPECT_GT(s.ball(), 0) << where;
  });
  EXPECT_GT(tried, 300);
}

// All faces of a separated body lie beyond planes normal to the separating direction: closed, but not around the
// origin.
TEST(Surface, ThatIsClosedButElsewhereIsRejected) {
  int tried = 0;
  for_cases([&](Surfaced& s, const std::string& where) {
    if (!s.epa.probed() || !(s.epa.gap() > 1e-6 * s.pair.scale)) return;
    ++tried;
    for (CsoFace<double>& face : s.faces) face.normal = -s.epa.direction();
    std::vector<Vec3d> w;
    for (const CsoVertex<double>& v : s.epa.vertices()) w.push_back(v.w);
    ASSERT_GT(view_surface(w.data(), s.faces.data(), s.faces.size(), s.pair.scale).ball, 0) << where;
    EXPECT_LE(s.ball(), 0) << where;
  });
  EXPECT_GT(tried, 200);
}

// Volumes underflow long before squares do, and with them the error bounds of their signs: a tetrahedron just outside
// the origin then seems to contain it.
TEST(Surface, OfTinyBodiesIsNotProvedByVolumesThatUnderflow) {
  Random random(kSeed);
  const ConvexPartPtr origin = make_convex_part({{0, 0, 0}});
  int tried = 0, looks_proved = 0;
  for (const int exponent : {-500, -400, -358, -357, -356, -340, -300, -200})
    for (int i = 0; i < 5000; ++i) {
      const double size = std::ldexp(random.uniform(1, 2), exponent);
      std::vector<Vec3d> v(4);
      for (Vec3d& p : v) p = {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
      // Beyond the face across from v[0], by a fiftieth of the height.
      const double q = random.uniform(0.2, 0.4), r = random.uniform(0.2, 0.4);
      const Vec3d o = v[0] * -0.02 + v[1] * q + v[2] * r + v[3] * (1.02 - q - r);
      Simplex<double> s;
      s.size = 4;
      for (std::uint32_t k = 0; k < 4; ++k) s.vertex[k] = {v[k] - o, k, 0};
      CsoFace<double> faces[4];
      if (!tetrahedron_faces(s, faces)) continue;
      for (CsoFace<double>& face : faces)
        if (dot(face.normal, s.vertex[face.vertex[0]].w) < 0) face.normal = -face.normal;
      for (std::uint32_t k = 0; k < 4; ++k) v[k] = s.vertex[k].w * size;
      const ConvexPartPtr beside = make_convex_part(v);
      const PlacedPair<double> pair(*beside, rotation_of(Pose{}), {0, 0, 0}, *origin, rotation_of(Pose{}), {0, 0, 0});
      const auto volume = [&](const CsoFace<double>& f) {
        return dot(v[f.vertex[0]], cross(v[f.vertex[1]], v[f.vertex[2]]));
      };
      ++tried;
      looks_proved += std::all_of(faces, faces + 4, [&](const auto& f) { return volume(f) > 0; }) ||
                      std::all_of(faces, faces + 4, [&](const auto& f) { return volume(f) < 0; });
      EXPECT_LE(certify_ball<double>(pair, s.vertex, faces), 0) << "2^" << exponent << ", try " << i;
    }
  std::printf("%d tetrahedra beside the origin, of %d, have volumes of one sign as computed\n", looks_proved, tried);
  EXPECT_GT(tried, 30000);
  EXPECT_GT(looks_proved, 50);
}

// Rays decide if a side is uncertain; if both methods decide, they agree.
TEST(Surface, IsFoundAroundTheOriginByRaysToo) {
  int tried = 0;
  for_cases([&](Surfaced& s, const std::string& where) {
    if (!(s.ball() > 0)) return;
    std::vector<Vec3d> w;
    for (const CsoVertex<double>& v : s.epa.vertices()) w.push_back(s.pair.cso_vertex(v.a, v.b));
    const auto* faces = s.faces.data();
    const std::size_t count = s.faces.size();
    const SurfaceView<double> view = view_surface(w.data(), faces, count, s.pair.scale);
    if (!view.one_side()) return;
    ++tried;
    EXPECT_FALSE(view_surface(w.data(), faces, count, 1e100).one_side());
    EXPECT_TRUE(is_surrounded(w.data(), faces, count, view.ball)) << where;
  });
  EXPECT_GT(tried, 300);
}

}  // namespace
}  // namespace clearance::exact
