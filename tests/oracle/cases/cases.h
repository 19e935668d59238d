// Seeded classes of hard pairs, as careless modelling, unlucky poses and unusual units produce them.
#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "engine/bvh/cloud_point.h"
#include "engine/pose/pose.h"
#include "tests/oracle/exact/exact_distance.h"
#include "tests/oracle/exact/exact_surface.h"

namespace clearance::exact {

/// Geometry of a body: the hull of the vertices (metres, body frame) or, with triangles, these, grown by a radius.
struct Solid {
  std::vector<Vec3d> vertices;
  double radius = 0;
  std::vector<Triangle> triangles = {};
  bool is_solid = false;  ///< the enclosed volume belongs to the body
  /// If not empty, the body is a cloud: these points (float32) or the boxes about them, from which the triangles are
  /// made.
  std::vector<CloudPoint> cloud = {};
  float voxel = 0;             ///< metres: the edge of those boxes; 0 for points
  bool is_half_space = false;  ///< z <= 0, grown by the radius; without vertices, and not supported by exact_answer()
};
/// Cases with the same shape share the pointer.
using SolidPtr = std::shared_ptr<const Solid>;

/// Two bodies, each of one part.
struct Case {
  SolidPtr a, b;
  Pose X_wa, X_wb;
};

inline ConvexPartView view(const Solid& s) {
  return {s.vertices, s.radius};
}
inline BodyView body_view(const Solid& s) {
  return {s.vertices, s.triangles, s.is_solid, s.radius};
}
/// \param depth for overlapping hulls; not available with triangles
inline Result exact_answer(const Case& c, bool depth = true) {
  if (c.a->triangles.empty() && c.b->triangles.empty())
    return exact_distance(view(*c.a), c.X_wa, view(*c.b), c.X_wb, depth);
  return exact_distance(body_view(*c.a), c.X_wa, body_view(*c.b), c.X_wb);
}

/// Seeded numbers.
class Random {
 public:
  explicit Random(std::uint64_t seed) : bits_(seed) {}
  double uniform(double low = 0, double high = 1) {
    return low + (high - low) * (static_cast<double>(bits_() >> 11) * 0x1p-53);
  }
  double log_uniform(double low, double high);  ///< both > 0
  int integer(int low, int high) { return low + static_cast<int>(bits_() % static_cast<unsigned>(high - low + 1)); }
  bool chance(double p) { return uniform() < p; }
  double sign() { return chance(0.5) ? 1.0 : -1.0; }
  double normal();
  Vec3d direction();                             ///< unit up to rounding, evenly distributed
  Pose rotation(Vec3d translation = {0, 0, 0});  ///< evenly distributed, |q| = 1 up to rounding
 private:
  std::mt19937_64 bits_;
};

struct CaseClass {
  std::string name;  ///< "group_kind", as in the published table
  std::string what;  ///< one line for the table
  Case (*make)(Random&);
  /// Whether a case has the property that the class is for; null if it always has by construction.
  bool (*hits)(const Case&, const Result&) = nullptr;
  double least_share = 1.0;  ///< required share of such cases
  int cost = 1;              ///< approximate time of a case, relative to one with 42 vertices
};

/// All classes of hulls, in the order of the table.
const std::vector<CaseClass>& case_classes();
/// All classes with non-convex bodies.
const std::vector<CaseClass>& mesh_classes();

/// Case number `index` of a class. Depends on the seed and the index only.
Case make_case(const CaseClass& c, std::uint64_t seed, std::uint64_t index);

/// Shifts b along the exact normal, in doubles, so that the signed distance becomes about `gap`. Bodies with triangles
/// have a normal only if they are apart; others stay.
void set_gap(Case& c, double gap);

/// A case that a search found to be hard, or that once had a wrong answer.
struct MinedCase {
  Case pair;
  double exact;  ///< signed distance, metres, rounded down
};
/// The cases of mined_cases.inc.
const std::vector<MinedCase>& mined_cases();

/// Largest distance of a vertex from the body's origin, not rounded up.
double reach(const Solid& s);
/// S of the error bounds: |D| + rho_a + rho_b + r_a + r_b, metres.
double scale_of(const Case& c);

}  // namespace clearance::exact
