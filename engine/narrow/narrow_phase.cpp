#include "engine/narrow/narrow_phase.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>

#include "engine/hull/primitive.h"
#include "engine/narrow/epa.h"
#include "engine/narrow/overlap.h"
#include "engine/narrow/pair_run.h"
#include "engine/narrow/proof.h"
#include "engine/narrow/witness.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// The CSO of two convex parts for GJK and EPA, in the frame of a.
template <class T>
class SupportedCso {
 public:
  SupportedCso(const PlacedPair<T>& pair, WorkMeter* meter)
      : pair_(pair), meter_(meter), units_(kDearer * WorkMeter::units_of(*pair.a, *pair.b)) {}

  CsoSupport<T> operator()(const Vec3<T>& v) const {
    if (meter_) meter_->spend(units_);
    const SupportPoint<T> a = pair_.points_a.farthest(-v);
    const SupportPoint<T> b = pair_.points_b.farthest(pair_.R.transpose_times(v));
    return {vertex(a.index, b.index), -dot(v, pair_.D) - (a.value + b.value)};
  }

  CsoVertex<T> vertex(std::uint32_t ia, std::uint32_t ib) const { return {pair_.cso_vertex(ia, ib), ia, ib}; }

  /// Counts a step of EPA in addition to its support: each vertex adds two faces, and each step scans all faces.
  /// Returns whether the slice is over.
  bool count_step(std::size_t vertices) const {
    if (!meter_) return false;
    meter_->spend(kDearer * (vertices / kVerticesPerUnit));
    return meter_->is_over();
  }

  /// From the centre of b to the centre of a, the centre of the CSO.
  Vec3<T> centre() const { return cast<T>(pair_.a->centre) - pair_.R * cast<T>(pair_.b->centre) - pair_.D; }

 private:
  static constexpr std::uint64_t kDearer = std::is_same_v<T, DoubleDouble> ? 16 : 1, kVerticesPerUnit = 32;

  const PlacedPair<T>& pair_;
  WorkMeter* meter_;
  std::uint64_t units_;
};

// Collects bounds from every attempt: the narrowest interval, the witness of its upper end, the normal of its lower
// end, and optionally their proof.
class Answer {
 public:
  /// \param proof null if not needed
  Answer(const NarrowLimits& limits, const Mat3d& R_wa, double radius_a, double radius_b, NarrowProof* proof = nullptr)
      : limits_(limits), R_wa_(R_wa), radius_a_(radius_a), radius_b_(radius_b), proof_(proof) {}

  /// \param n axes of a
  template <class T>
  void raise_lower(double lower, const Vec3<T>& n) {
    assert(!std::isnan(lower));
    if (!(lower > answer_.bounds.lower)) return;
    answer_.bounds.lower = lower;
    const Vec3d m = rescaled(cast<double>(n));
    answer_.normal = (R_wa_ * m) * (1 / norm(m));
    if (!proof_) return;
    proof_->direction = cast<DoubleDouble>(n);
    proof_->lower_in_double_double = std::is_same_v<T, DoubleDouble>;
  }
  /// Takes the points given by a simplex.
  template <class T>
  void take_witness(const PlacedPair<T>& pair, const Simplex<T>& simplex) {
    const Witness w = certify_upper(pair, simplex);
    assert(!std::isnan(w.upper));
    if (!lower_upper(w.upper, w) || !proof_) return;
    begin_upper_proof<T>();
    const SimplexPoint<T> point(simplex);
    for (int i = 0; i < simplex.size; ++i)
      add_to_proof(pair, simplex.vertex[i].a, simplex.vertex[i].b, DoubleDouble(point.share[i]));
    if (simplex.size == 0) add_to_proof(pair, 0, 0, 1);
  }
  /// Returns whether it is lower than the bound so far.
  bool lower_upper(double upper, const Witness& w) {
    if (!(upper < answer_.bounds.upper)) return false;
    answer_.bounds.upper = upper;
    witness_ = w;
    return true;
  }
  /// Takes an upper bound without a witness of its own (a ball in the overlap), with the nearest points of the surface
  /// in its place.
  template <class T>
  void lower_upper(const PlacedPair<T>& pair, double upper, const Witness& w, std::span<const CsoVertex<T>> vertices,
                   std::span<const CsoFace<T>> faces) {
    if (!lower_upper(upper, w) || !proof_) return;
    begin_upper_proof<T>();
    for (const CsoVertex<T>& v : vertices) add_to_proof(pair, v.a, v.b, 0);
    for (const CsoFace<T>& f : faces)
      proof_->faces.push_back({{f.vertex[0], f.vertex[1], f.vertex[2]}, cast<DoubleDouble>(f.normal)});
  }

  /// Keeps a surface around the origin, from which double-double makes a better common point.
  template <class T>
  void keep_surface(std::span<const CsoVertex<T>> vertices, std::span<const CsoFace<T>> faces) {
    surface_vertices_.clear();
    surface_faces_.clear();
    for (const CsoVertex<T>& v : vertices) surface_vertices_.push_back({{}, v.a, v.b});
    for (const CsoFace<T>& f : faces) surface_faces_.push_back({f.vertex, f.twin, {}});
  }
  bool has_surface() const { return !surface_faces_.empty(); }
  std::vector<CsoVertex<DoubleDouble>>& surface_vertices() { return surface_vertices_; }
  std::span<const CsoFace<DoubleDouble>> surface_faces() const { return surface_faces_; }
  void replace_witness(const Witness& w) { witness_ = w; }

  const Interval& bounds() const { return answer_.bounds; }
  bool wants_depth() const { return limits_.signed_distance; }
  /// An overlap is proved, but less than the limits request.
  bool is_shallow() const { return answer_.bounds.upper <= 0 && answer_.bounds.upper > -limits_.min_penetration; }
  double tolerance(double distance) const { return tolerance_at(distance, limits_.abs_tol, limits_.rel_tol); }

  bool converged() const {
    const auto [lower, upper] = answer_.bounds;
    if (lower > limits_.max_distance) return true;
    if (upper == kInf) return false;
    if (upper <= limits_.stop_below) return true;
    if (!limits_.signed_distance && upper <= 0) return true;
    const double least = limits_.signed_distance ? lower : std::max(lower, 0.0);
    if (least == -kInf) return false;
    const double distance = lower > 0 ? upper : (upper <= 0 ? lower : 0.0);
    return upper - least <= tolerance(distance);
  }

  NarrowAnswer finish() {
    answer_.converged = converged();
    answer_.beyond = answer_.bounds.lower > limits_.max_distance;
    // Without signed distance the separating direction may be unknown. The witnesses' own line replaces it.
    const double length = witness_.length, radius = radius_a_ + radius_b_;
    if (!(norm(answer_.normal) > 0)) answer_.normal = length > 0 ? witness_.separation * (1 / length) : Vec3d{1, 0, 0};
    const bool apart = answer_.bounds.upper > 0 || length > 0;
    const Vec3d outward = apart && length > 0 && !deep_ ? witness_.separation * (1 / length) : answer_.normal;
    answer_.point_a = witness_.core_a + outward * radius_a_;
    answer_.point_b = witness_.core_b - outward * radius_b_;
    if (!limits_.signed_distance && answer_.bounds.upper <= 0) {
      // A common point: on the segment between the cores, within both radii.
      const double share = radius > 0 ? radius_a_ / radius : 0.5;
      answer_.point_a = witness_.core_a + witness_.separation * share;
      answer_.point_b = witness_.core_b - witness_.separation * (1 - share);
    }
    return answer_;
  }
  void mark_deep() { deep_ = true; }

 private:
  template <class T>
  void begin_upper_proof() {
    proof_->upper_in_double_double = std::is_same_v<T, DoubleDouble>;
    proof_->vertices.clear();
    proof_->faces.clear();
    proof_->points_a.clear();
    proof_->points_b.clear();
  }
  template <class T>
  void add_to_proof(const PlacedPair<T>& pair, std::uint32_t a, std::uint32_t b, const DoubleDouble& share) {
    const auto named = [](const ConvexPart& convex_part, const CorePoints<T>& points, std::uint32_t i, auto& known) {
      if (!is_round(convex_part)) return i;
      known.push_back(cast<DoubleDouble>(points[i]));
      return static_cast<std::uint32_t>(known.size() - 1);
    };
    proof_->vertices.push_back({named(*pair.a, pair.points_a, a, proof_->points_a),
                                named(*pair.b, pair.points_b, b, proof_->points_b), share});
  }

  NarrowLimits limits_;
  Mat3d R_wa_;
  double radius_a_, radius_b_;
  NarrowProof* proof_;
  NarrowAnswer answer_;
  Witness witness_{kInf, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0};
  bool deep_ = false;
  std::vector<CsoVertex<DoubleDouble>> surface_vertices_;
  std::vector<CsoFace<DoubleDouble>> surface_faces_;
};

template <class T>
GjkLimits<T> gjk_limits(const NarrowLimits& limits, const PlacedPair<T>& pair) {
  GjkLimits<T> g =
      run_limits<T>(limits.abs_tol, limits.rel_tol, pair.radius > T(0), limits.max_distance < RunSetup<T>::kUnbounded);
  g.radius = pair.radius;
  if (g.bounded)
    g.max_distance = T(core_cut_off(limits.max_distance, static_cast<double>(pair.radius), pair.lower_error()));
  g.max_iterations = limits.max_iterations;
  return g;
}

// Tries the normals of all faces that the last simplex and the last support span. Near contact they are exact where v
// is not.
template <class T>
void try_face_normals(const PlacedPair<T>& pair, const Gjk<T>& g, Answer& answer) {
  CsoVertex<T> p[4];
  int n = 0;
  for (int i = 0; i < g.simplex.size && n < 4; ++i) p[n++] = g.simplex.vertex[i];
  if (n < 4 && !std::any_of(p, p + n, [&](const CsoVertex<T>& q) { return same(q, g.last); })) p[n++] = g.last;
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j)
      for (int k = j + 1; k < n; ++k) {
        Vec3<T> normal = cross(p[j].w - p[i].w, p[k].w - p[i].w);
        if (!(squared_norm(normal) > T(0))) continue;
        if (dot(normal, p[i].w) > T(0)) normal = -normal;
        answer.raise_lower(certify_lower(pair, normal), normal);
        if (answer.converged()) return;
      }
}

// Tries the nearest points of every vertex, edge and triangle of a few vertices, for simplices of which GJK kept no
// nearest point.
template <class T>
void try_witnesses(const PlacedPair<T>& pair, const Simplex<T>& s, Answer& answer) {
  for (int mask = 1; mask < 1 << s.size; ++mask) {
    Simplex<T> part;
    for (int i = 0; i < s.size; ++i)
      if (mask >> i & 1) part.vertex[part.size++] = s.vertex[i];
    const Vec3<T>&p = part.vertex[0].w, &q = part.vertex[1].w, &r = part.vertex[2].w;
    if (part.size == 1) {
      part.weight[0] = T(1);
    } else if (part.size == 2) {
      part.weight[0] = dot(q, q - p);
      part.weight[1] = -dot(p, q - p);
    } else if (part.size == 3) {
      const Vec3<T> n = cross(q - p, r - p);
      part.weight[0] = dot(n, cross(q, r));
      part.weight[1] = dot(n, cross(r, p));
      part.weight[2] = dot(n, cross(p, q));
    } else {
      weigh_origin(part);
    }
    bool inside = true;
    for (int i = 0; i < part.size; ++i) inside = inside && part.weight[i] > T(0);
    if (inside) answer.take_witness(pair, part);
  }
}

template <class T>
void take_overlap(const PlacedPair<T>& pair, std::span<const CsoVertex<T>> vertices, std::span<const CsoFace<T>> faces,
                  const Simplex<T>& nearest, Answer& answer) {
  const double ball = certify_ball(pair, vertices, faces);
  if (!(ball > 0)) return;
  const Witness witness = certify_upper(
      pair, answer.wants_depth() ? nearest : around_origin<T>(vertices.data(), faces.data(), faces.size()));
  // Rounding left the surface concave, so that its nearest point is far from its nearest plane. Double-double resolves
  // it.
  if (std::is_same_v<T, double> && answer.wants_depth() &&
      witness.length - ball > answer.tolerance(ball) + 2 * pair.upper_error())
    return;
  answer.mark_deep();
  if (!answer.wants_depth() && !(witness.length <= 0.5 * pair.upper_error()) && !pair.is_round())
    answer.keep_surface<T>(vertices, faces);
  answer.lower_upper(pair, certify_overlap(*pair.a, *pair.b, ball), witness, vertices, faces);
}

/// State of a paused EPA, and the answer before it.
template <class T>
struct PausedEpa final : PausedPair {
  PausedEpa(const Answer& before, const Gjk<T>& g) : answer(before), gjk(g) {}
  Answer answer;
  Gjk<T> gjk;
  Epa<T> epa;
};
using PausedPairPtr = std::unique_ptr<PausedPair>;

/// Takes a paused EPA in this arithmetic, or null.
template <class T>
std::unique_ptr<PausedEpa<T>> take_paused(PausedPairPtr* paused) {
  auto* const epa = paused ? dynamic_cast<PausedEpa<T>*>(paused->get()) : nullptr;
  if (epa) paused->release();
  return std::unique_ptr<PausedEpa<T>>(epa);
}

// Limit for the surface around the overlap of a round core. No number of vertices makes it exact, and each step scans
// all of them. The interval of the depth includes the rest.
constexpr std::size_t kMostRoundVertices = 256;

/// Throws WorkMeter::PairUnfinished.
/// \param resumed the paused EPA to continue, or null to begin
template <class T>
void expand_polytope(const PlacedPair<T>& pair, SupportedCso<T>& cso, const NarrowLimits& limits, const Gjk<T>& g,
                     Answer& answer, std::unique_ptr<PausedEpa<T>> resumed, PausedPairPtr* paused) {
  EpaLimits e = epa_limits<T>(limits.abs_tol, limits.rel_tol, pair.radius > T(0) && !pair.is_round(), pair.scale);
  if (!limits.signed_distance)
    e.stop_below = 2 * pair.ball_error() + std::max(0.0, limits.min_penetration - static_cast<double>(pair.radius));
  if (pair.is_round()) e.max_vertices = kMostRoundVertices;
  static thread_local Epa<T> epa;
  std::size_t steps = 0;  // one at least, however short the slice is
  const auto pause = [&](std::size_t vertices) { return cso.count_step(vertices) && paused && steps++ > 0; };
  if (resumed) std::swap(epa, resumed->epa);
  if ((resumed ? epa.go_on(cso, pause) : epa.run(cso, e, g.simplex, pause)) == EpaEnd::kPaused) {
    if (!resumed) resumed = std::make_unique<PausedEpa<T>>(answer, g);
    std::swap(epa, resumed->epa);
    *paused = std::move(resumed);
    throw WorkMeter::PairUnfinished();
  }
  if (epa.probed()) answer.raise_lower(certify_lower(pair, epa.gap(), norm(epa.direction())), epa.direction());
  if (!epa.faces().empty()) take_overlap<T>(pair, epa.vertices(), epa.faces(), epa.nearest(), answer);
  if (answer.bounds().upper > 0) {  // no overlap proved: touching or apart, where points prove the most
    if (epa.nearest().size > 0) answer.take_witness(pair, epa.nearest());
    try_witnesses(pair, g.simplex, answer);
  }
}

// The tetrahedron that GJK ended with, as a surface with outward faces.
template <class T>
void take_tetrahedron(const PlacedPair<T>& pair, const Simplex<T>& s, Answer& answer) {
  assert(s.size == 4);
  CsoFace<T> faces[4];
  if (!tetrahedron_faces(s, faces)) return;
  take_overlap<T>(pair, std::span<const CsoVertex<T>>(s.vertex, 4), faces, s, answer);
}

// The simplex with which float64 ended, as vertex indices: double-double begins from it.
struct SeedSimplex {
  std::uint32_t a[3] = {}, b[3] = {};
  int size = 0;
};

template <class T>
Gjk<T> run_gjk(const PlacedPair<T>& pair, const NarrowLimits& limits, SupportedCso<T>& cso, const SeedSimplex& seed) {
  Simplex<T> start;
  for (int i = 0; i < seed.size; ++i) start.vertex[start.size++] = cso.vertex(seed.a[i], seed.b[i]);
  return gjk<T>(cso, first_direction(cso.centre()), start, gjk_limits(limits, pair));
}

// One attempt in one arithmetic. Returns GJK's last simplex, from which the next attempt begins.
// \param done a run of GJK on this pair, if there was one already
template <class T>
Simplex<T> attempt(const PlacedPair<T>& pair, const NarrowLimits& limits, const SeedSimplex& seed, Answer& answer,
                   WorkMeter* meter, PausedPairPtr* paused = nullptr, const Gjk<T>* done = nullptr) {
  SupportedCso<T> cso(pair, meter);
  if (auto resumed = take_paused<T>(paused)) {
    answer = resumed->answer;
    const Gjk<T> g = resumed->gjk;
    expand_polytope(pair, cso, limits, g, answer, std::move(resumed), paused);
    return g.simplex;
  }
  const Gjk<T> g = done ? *done : run_gjk(pair, limits, cso, seed);
  const auto end = static_cast<GjkEnd>(g.end);

  if (end == GjkEnd::kEncloses && g.simplex.size == 4) {
    if (!limits.signed_distance) {
      take_tetrahedron(pair, g.simplex, answer);
      if (answer.converged() && !answer.is_shallow()) return g.simplex;
    }
  } else {
    answer.take_witness(pair, g.simplex);
    if (g.squared_distance > T(Arithmetic<T>::kSafelySquared) && end != GjkEnd::kLimit)
      answer.raise_lower(certify_lower(pair, g.gap, norm(g.v)), -g.v);
    else if (squared_norm(g.v) > T(0))
      answer.raise_lower(certify_lower(pair, -g.v), -g.v);
    if (answer.converged()) return g.simplex;
    try_face_normals(pair, g, answer);
    if (answer.converged() || answer.bounds().lower > 0) return g.simplex;
  }
  expand_polytope<T>(pair, cso, limits, g, answer, nullptr, paused);
  return g.simplex;
}

template <class T>
SeedSimplex seed_of(const Simplex<T>& s) {
  SeedSimplex seed;
  seed.size = std::min(s.size, 3);
  for (int i = 0; i < seed.size; ++i) {
    seed.a[i] = s.vertex[i].a;
    seed.b[i] = s.vertex[i].b;
  }
  return seed;
}

Mat3<DoubleDouble> double_double_rotation(const PoseMatrix& pose) {
  return rotation_of_double_double(pose.X_wb);
}

template <class T>
void attempt_plane(const PlacedPair<T>& pair, Answer& answer) {
  const PlaneBounds plane = certify_plane(pair, answer.wants_depth());
  answer.mark_deep();  // its points lie along the normal, apart or not
  answer.raise_lower(plane.bounds.lower, Vec3<T>{T(0), T(0), T(1)});
  answer.lower_upper(plane.bounds.upper, plane.nearest);
}

// Answers a half-space, a, and another part, without a search. Proves nothing for two half-spaces.
NarrowAnswer against_half_space(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                const PoseMatrix& pose_b, const NarrowLimits& limits, bool in_fine) {
  if (is_half_space(b)) return {};
  Answer answer(limits, pose_a.R_wb, a.radius, b.radius);
  if (!in_fine) attempt_plane(PlacedPair<double>(a, pose_a.R_wb, pose_a.t_w, b, pose_b.R_wb, pose_b.t_w), answer);
  if (in_fine || !answer.converged())
    attempt_plane(PlacedPair<DoubleDouble>(a, double_double_rotation(pose_a), pose_a.t_w, b,
                                           double_double_rotation(pose_b), pose_b.t_w),
                  answer);
  NarrowAnswer r = answer.finish();
  r.rounding = rounding_of(a, pose_a, b, pose_b);
  return r;
}
// The same with the half-space as a or b. Nothing if neither is one.
std::optional<NarrowAnswer> against_half_space(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                               const PoseMatrix& pose_b, bool in_fine, const NarrowLimits& limits) {
  if (is_half_space(a)) return against_half_space(a, pose_a, b, pose_b, limits, in_fine);
  if (!is_half_space(b)) return {};
  NarrowAnswer r = against_half_space(b, pose_b, a, pose_a, limits, in_fine);
  std::swap(r.point_a, r.point_b);
  r.normal = -r.normal;
  return r;
}

// narrow_phase() with an empty answer.
NarrowAnswer narrow_down(Answer answer, const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                         const PoseMatrix& pose_b, const NarrowLimits& limits, const Gjk<double>* done,
                         WorkMeter* meter, PausedPairPtr* paused) {
  const bool in_fine = paused && dynamic_cast<PausedEpa<DoubleDouble>*>(paused->get());
  const PlacedPair<double> pair(a, pose_a.R_wb, pose_a.t_w, b, pose_b.R_wb, pose_b.t_w);
  if (pair.is_round()) paused = nullptr;  // the points found by a paused run would be lost
  SeedSimplex seed;
  if (!in_fine) {
    seed = seed_of(attempt(pair, limits, seed, answer, meter, paused, done));
    if (pair.is_round()) seed = {};  // refers to points that only this attempt has found
  }
  if (in_fine || !answer.converged()) {
    const PlacedPair<DoubleDouble> fine(a, double_double_rotation(pose_a), pose_a.t_w, b,
                                        double_double_rotation(pose_b), pose_b.t_w);
    attempt(fine, limits, seed, answer, meter, paused);
  }
  if (answer.has_surface()) {
    const PlacedPair<DoubleDouble> fine(a, double_double_rotation(pose_a), pose_a.t_w, b,
                                        double_double_rotation(pose_b), pose_b.t_w);
    for (CsoVertex<DoubleDouble>& v : answer.surface_vertices()) v.w = fine.cso_vertex(v.a, v.b);
    answer.replace_witness(
        certify_upper(fine, around_origin<DoubleDouble>(answer.surface_vertices().data(), answer.surface_faces().data(),
                                                        answer.surface_faces().size())));
  }
  NarrowAnswer r = answer.finish();
  r.rounding = rounding_width(pair.scale);
  return r;
}

}  // namespace

NarrowAnswer narrow_phase(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                          const NarrowLimits& limits, const Gjk<double>* done, WorkMeter* meter,
                          std::unique_ptr<PausedPair>* paused) {
  if (const auto plane = against_half_space(a, pose_a, b, pose_b, false, limits)) return *plane;
  return narrow_down(Answer(limits, pose_a.R_wb, a.radius, b.radius), a, pose_a, b, pose_b, limits, done, meter,
                     paused);
}

NarrowAnswer narrow_phase_proved(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                 const PoseMatrix& pose_b, const NarrowLimits& limits, NarrowProof& proof) {
  proof = {};
  if (is_half_space(a) || is_half_space(b)) {
    NarrowAnswer plane;
    plane.bounds = plane_proved(a, pose_a, b, pose_b, proof);
    return plane;
  }
  return narrow_down(Answer(limits, pose_a.R_wb, a.radius, b.radius, &proof), a, pose_a, b, pose_b, limits, nullptr,
                     nullptr, nullptr);
}

double rounding_of(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b) {
  const PlacedPair<double> pair(a, pose_a.R_wb, pose_a.t_w, b, pose_b.R_wb, pose_b.t_w);
  return rounding_width(pair.scale);
}

void take_lane_witness(const ConvexPart& a, const Mat3d& R_wa, const ConvexPart& b, const Mat3d& R_wb,
                       const LaneWitness& lane, Vec3d& point_a, Vec3d& point_b, Vec3d& normal) {
  converged_points(a, R_wa, b, R_wb, lane, point_a, point_b);
  normal = converged_normal(lane);
}

NarrowAnswer narrow_phase_reference(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                    const PoseMatrix& pose_b, const NarrowLimits& limits) {
  NarrowLimits whole = limits;
  whole.max_distance = kInf;
  whole.stop_below = -kInf;
  if (auto plane = against_half_space(a, pose_a, b, pose_b, true, whole)) {
    plane->beyond = plane->bounds.lower > limits.max_distance;
    return *plane;
  }
  Answer answer(whole, pose_a.R_wb, a.radius, b.radius);
  const PlacedPair<DoubleDouble> pair(a, double_double_rotation(pose_a), pose_a.t_w, b, double_double_rotation(pose_b),
                                      pose_b.t_w);
  attempt(pair, whole, SeedSimplex{}, answer, nullptr);
  NarrowAnswer r = answer.finish();
  r.beyond = r.bounds.lower > limits.max_distance;
  r.rounding = rounding_of(a, pose_a, b, pose_b);
  return r;
}

}  // namespace clearance
