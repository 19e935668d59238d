// GJK as in the report of 2023, with one source for one thread, many threads, and a block of a GPU.
//
// The report's idea (section 3.3): all available threads first fill a table of all dot and cross products of a simplex.
// Then the simplex is reduced by the signs of barycentric coordinates, which are sums of table entries, in four ordered
// steps: tetrahedron, triangle, segment, point. No recursion, and the size only decreases.
//
// Departures:
// - The report's Algorithm 2 stops as soon as dot(p, d) <= 0, which decides overlap but yields no distance. Here the
//   iteration continues until no vertex is nearer than v by more than the tolerance, which the plane through the last
//   support vertex proves (van den Bergen 1999); a negative dot product only proves that the bodies are apart.
// - Figure 3 drops every vertex with a negative coordinate at once. That is wrong if a simplex is obtuse
//   (Reduction::kFigure3, kept for the tests that show it); by default a segment must also be the nearest feature as
//   seen from both its faces.
// Signs still select wrong features of slivers, in any precision: gjk.h compares distances instead.
#pragma once

#include <cstdint>

#include "engine/base/vec.h"

namespace clearance::baselines {

/// Answer of a baseline for a pair.
struct PairAnswer {
  double distance = 0;     ///< in metres; 0 if they overlap
  Vec3d point_a{0, 0, 0};  ///< nearest points, world frame; undefined if the bodies overlap
  Vec3d point_b{0, 0, 0};
  std::int32_t iterations = 0;  ///< of GJK
  std::uint8_t overlap = 0;     ///< 1 if they share a point
  std::uint8_t limit = 0;       ///< 1 if the iteration limit was reached without an answer
};

enum class Reduction : std::uint8_t { kRegions, kFigure3 };

inline constexpr int kMaxIterations = 200;
inline constexpr double kTolerance = 1e-12;  ///< of |v|^2: half of it is the relative error of the distance
inline constexpr double kTouching = 1e-15;   ///< |v| over the largest |w| that rounding alone can produce

/// A vertex of the Minkowski difference A - B.
struct DifferenceVertex {
  Vec3d w;
  std::uint32_t a, b;
};

/// Dot and cross products of up to four vertices, ordered such that those of the first n vertices come first.
struct Terms {
  double dots[10];
  double crosses[18];

  static constexpr int kCount = 28;
  CLEARANCE_HD double dot(int i, int j) const { return i < j ? dots[j * (j + 1) / 2 + i] : dots[i * (i + 1) / 2 + j]; }
  /// w_i x w_j for i < j.
  CLEARANCE_HD Vec3d cross(int i, int j) const {
    const double* c = crosses + 3 * (j * (j - 1) / 2 + i);
    return {c[0], c[1], c[2]};
  }
  CLEARANCE_HD void compute(const DifferenceVertex* p, int n, int term) {
    if (term < 10) {
      const int j = term < 1 ? 0 : term < 3 ? 1 : term < 6 ? 2 : 3, i = term - j * (j + 1) / 2;
      if (j < n) dots[term] = clearance::dot(p[i].w, p[j].w);
      return;
    }
    const int pair = (term - 10) / 3, k = (term - 10) % 3;
    const int j = pair < 1 ? 1 : pair < 3 ? 2 : 3, i = pair - j * (j - 1) / 2;
    const int k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
    if (j < n) crosses[term - 10] = p[i].w[k1] * p[j].w[k2] - p[i].w[k2] * p[j].w[k1];
  }
};

/// A run of GJK. A plain struct, so that it can be in a GPU's shared memory; begin() initialises it.
struct SignGjk {
  DifferenceVertex p[4];  ///< the simplex, newest vertex last
  double weight[4];       ///< of the point nearest to the origin, not divided by their sum
  Terms terms;
  Vec3d v;                ///< that point
  double vv, largest;     ///< |v|^2; the largest |w|^2 so far
  DifferenceVertex next;  ///< the support vertex that was found
  std::int32_t size, iterations;
  std::uint8_t done, overlap, limit;

  CLEARANCE_HD void begin(const Vec3d& guess) {
    v = guess;
    vv = squared_norm(guess);
    if (!(vv > 0)) v = {1, 0, 0};
    largest = 0;
    size = iterations = 0;
    done = overlap = limit = 0;
  }

  /// Ends the run at `next`, or adds it to the simplex.
  CLEARANCE_HD void take() {
    if (size > 0) {
      done = vv - dot(v, next.w) <= kTolerance * vv;
      for (int i = 0; i < size; ++i)
        done |= p[i].a == next.a && p[i].b == next.b;  // then nothing of a polytope is left
      if (!done && iterations == kMaxIterations) done = limit = 1;
      if (done) return;
    }
    ++iterations;
    p[size++] = next;
    const double ww = squared_norm(next.w);
    if (ww > largest) largest = ww;
  }

  /// Keeps the vertices that carry the point nearest to the origin.
  /// \param previous whether v is a point of the simplex
  CLEARANCE_HD void reduce(Reduction reduction) {
    const int n = size;
    Feature f;
    if (n == 4 && encloses()) {
      done = overlap = 1;
      return;
    }
    f = reduction == Reduction::kRegions ? by_regions(n) : by_figure_3(n);
    const Vec3d point = nearest_of(f);
    const double d = squared_norm(point);
    if (n > 1 && !(d < vv)) {  // rounding or a wrong feature: no progress
      done = 1;
      size = previous_size;  // the weights belong to the previous simplex
      return;
    }
    for (int i = 0; i < f.size; ++i) p[i] = p[f.at[i]];  // at[] ascends
    for (int i = 0; i < f.size; ++i) weight[i] = f.weight[i];
    previous_size = size = f.size;
    v = point;
    vv = d;
    if (vv <= kTouching * kTouching * largest) done = overlap = 1;
  }

  CLEARANCE_HD void write(const Vec3d* a, const Vec3d* b, PairAnswer& out) const {
    out.iterations = iterations;
    out.overlap = overlap;
    out.limit = limit;
    out.distance = overlap ? 0.0 : norm(v);
    Vec3d on_a{0, 0, 0}, on_b{0, 0, 0};
    double sum = 0;
    for (int i = 0; i < size && i < 3; ++i) {
      on_a += a[p[i].a] * weight[i];
      on_b += b[p[i].b] * weight[i];
      sum += weight[i];
    }
    out.point_a = on_a * (1 / sum);
    out.point_b = on_b * (1 / sum);
  }

 private:
  std::int32_t previous_size;

  struct Feature {
    int size;
    int at[3];
    double weight[3];
  };

  /// The tetrahedron's step: tests whether the origin's barycentric coordinates have one sign.
  CLEARANCE_HD bool encloses() const {
    double lambda[4];
    coordinates(lambda);
    const bool positive = lambda[0] > 0;
    for (int i = 0; i < 4; ++i)
      if (positive ? !(lambda[i] > 0) : !(lambda[i] < 0)) return false;
    return true;
  }
  CLEARANCE_HD void coordinates(double lambda[4]) const {
    lambda[0] = dot(p[1].w, terms.cross(2, 3));
    lambda[1] = -dot(p[0].w, terms.cross(2, 3));
    lambda[2] = dot(p[0].w, terms.cross(1, 3));
    lambda[3] = -dot(p[0].w, terms.cross(1, 2));
  }

  /// Barycentric coordinates of the origin's projection onto the plane of i < j < k.
  CLEARANCE_HD Vec3d face_normal(int i, int j, int k, double* lambda) const {
    const Vec3d ij = terms.cross(i, j), jk = terms.cross(j, k), ik = terms.cross(i, k), normal = ij + jk - ik;
    lambda[0] = dot(normal, jk);
    lambda[1] = -dot(normal, ik);
    lambda[2] = dot(normal, ij);
    return normal;
  }
  /// The same for the projection onto the line of i and j.
  CLEARANCE_HD void on_line(int i, int j, double* lambda) const {
    lambda[0] = terms.dot(j, j) - terms.dot(i, j);
    lambda[1] = terms.dot(i, i) - terms.dot(i, j);
  }

  /// The nearest feature among those with the newest vertex; no others can be nearest.
  CLEARANCE_HD Feature by_regions(int n) const {
    const int last = n - 1;
    bool behind[3] = {true, true, true};  // whether the edge (i, last) is outside all its faces
    for (int i = 0; i < last; ++i)        // triangles
      for (int j = i + 1; j < last; ++j) {
        double lambda[3];
        face_normal(i, j, last, lambda);
        if (lambda[0] > 0 && lambda[1] > 0 && lambda[2] > 0 && outside(n, i, j))
          return {3, {i, j, last}, {lambda[0], lambda[1], lambda[2]}};
        behind[j] = behind[j] && !(lambda[0] > 0);
        behind[i] = behind[i] && !(lambda[1] > 0);
      }
    for (int i = 0; i < last; ++i) {  // segments
      double lambda[2];
      on_line(i, last, lambda);
      if (lambda[0] > 0 && lambda[1] > 0 && behind[i]) return {2, {i, last, 0}, {lambda[0], lambda[1], 0}};
    }
    return {1, {last, 0, 0}, {1, 0, 0}};
  }
  /// Returns whether the origin is on the outer side of the face (i, j, last) of a tetrahedron.
  CLEARANCE_HD bool outside(int n, int i, int j) const {
    if (n < 4) return true;
    double lambda[4];
    coordinates(lambda);
    const double volume = lambda[0] + lambda[1] + lambda[2] + lambda[3];
    return lambda[3 - i - j] * volume <= 0;
  }

  /// As in figure 3 of the report: all vertices with negative coordinates are dropped at once.
  CLEARANCE_HD Feature by_figure_3(int n) const {
    Feature f{n, {0, 1, 2}, {1, 0, 0}};
    if (n == 4) {
      double lambda[4];
      coordinates(lambda);
      const double volume = lambda[0] + lambda[1] + lambda[2] + lambda[3];
      f.size = 0;
      for (int i = 0; i < 4; ++i)
        if (lambda[i] * volume > 0 && f.size < 3) f.at[f.size++] = i;
    }
    if (f.size == 3) {
      double lambda[3];
      face_normal(f.at[0], f.at[1], f.at[2], lambda);
      keep_positive(f, lambda);
    }
    if (f.size == 2) {
      double lambda[2];
      on_line(f.at[0], f.at[1], lambda);
      keep_positive(f, lambda);
    }
    if (f.size == 1) f.weight[0] = 1;
    return f;
  }
  CLEARANCE_HD static void keep_positive(Feature& f, const double* lambda) {
    int kept = 0;
    for (int i = 0; i < f.size; ++i)
      if (lambda[i] > 0) {
        f.at[kept] = f.at[i];
        f.weight[kept++] = lambda[i];
      }
    f.size = kept;
  }

  CLEARANCE_HD Vec3d nearest_of(const Feature& f) const {
    if (f.size == 3) {
      double lambda[3];
      const Vec3d normal = face_normal(f.at[0], f.at[1], f.at[2], lambda);
      return normal * (dot(normal, p[f.at[2]].w) / squared_norm(normal));
    }
    if (f.size == 2) {
      const double sum = f.weight[0] + f.weight[1];
      return p[f.at[0]].w * (f.weight[0] / sum) + p[f.at[1]].w * (f.weight[1] / sum);
    }
    return p[f.at[0]].w;
  }
};

/// One thread, on the host or alone on a GPU.
struct OneThread {
  CLEARANCE_HD bool first() const { return true; }
  CLEARANCE_HD std::uint32_t rank() const { return 0; }
  CLEARANCE_HD std::uint32_t count() const { return 1; }
  CLEARANCE_HD void sync() const {}
  CLEARANCE_HD std::uint32_t highest(double, std::uint32_t index) const { return index; }
};

/// The vertex farthest along a direction; each thread tests every count-th vertex (the report's Algorithm 3).
template <class Threads>
CLEARANCE_HD inline std::uint32_t scan(const Threads& threads, const Vec3d* vertices, std::uint32_t count,
                                       const Vec3d& d) {
  std::uint32_t best = 0;
  double most = -1.7976931348623157e308;
  for (std::uint32_t i = threads.rank(); i < count; i += threads.count()) {
    const double along = dot(vertices[i], d);
    if (along > most) {
      most = along;
      best = i;
    }
  }
  return threads.highest(most, best);
}

/// Runs GJK between two vertex sets.
/// \param s shared by all threads
/// \param support called by all threads with (0 for a or 1 for b, direction); returns the farthest vertex's index, at
/// least to the first thread
/// \param term_threads the threads that fill the table; the same or OneThread
template <class Threads, class TermThreads, class Support>
CLEARANCE_HD inline void run_sign_gjk(SignGjk& s, const Vec3d* a, const Vec3d* b, const Threads& threads,
                                      const TermThreads& term_threads, Support& support,
                                      Reduction reduction = Reduction::kRegions) {
  if (threads.first()) s.begin(a[0] - b[0]);
  threads.sync();
  while (true) {
    const Vec3d v = s.v;
    const std::uint32_t i = support(0, -v), j = support(1, v);
    if (threads.first()) {
      s.next = {a[i] - b[j], i, j};
      s.take();
    }
    threads.sync();
    if (s.done) return;
    if (term_threads.count() > 1 || threads.first())
      for (int term = static_cast<int>(term_threads.rank()); term < Terms::kCount;
           term += static_cast<int>(term_threads.count()))
        s.terms.compute(s.p, s.size, term);
    threads.sync();
    if (threads.first()) s.reduce(reduction);
    threads.sync();
    if (s.done) return;
  }
}

}  // namespace clearance::baselines
