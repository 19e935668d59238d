// The point of a simplex nearest to the origin, from every feature's best-conditioned vertex. For scalars only.
#pragma once

#include <cstdint>

#include "engine/narrow/gjk/simplex.h"

namespace clearance {

enum class Carries : std::uint8_t { kNo, kPoint, kOrigin };

/// The point of a feature's plane (of its line, its vertex) that is nearest to the origin, and the unscaled weights of
/// its vertices there. A plane is spanned by the two shortest edges and measured from vertex 0. Returns kOrigin for a
/// tetrahedron around the origin, and kNo for a flat feature or a tetrahedron without the origin.
template <class T>
CLEARANCE_HD inline Carries weigh(Simplex<T>& f, Vec3<T>& point) {
  const T zero = T(0);
  const Vec3<T>&p = f.vertex[0].w, &q = f.vertex[1].w, &r = f.vertex[2].w, &t = f.vertex[3].w;
  point = p;
  if (f.size == 1) {
    f.weight[0] = T(1);
  } else if (f.size == 2) {
    const Vec3<T> e = q - p;
    const T ee = squared_norm(e), along = -dot(p, e);
    if (!(ee > zero)) return Carries::kNo;
    f.weight[0] = ee - along;
    f.weight[1] = along;
    point = cross(e, cross(p, e)) * (T(1) / ee);
  } else if (f.size == 3) {
    Vec3<T> e[3] = {q - p, r - q, p - r};
    int longest = 0;
    for (int i = 1; i < 3; ++i)
      if (squared_norm(e[i]) > squared_norm(e[longest])) longest = i;
    const Vec3<T> n = cross(e[(longest + 1) % 3], e[(longest + 2) % 3]);
    const T nn = squared_norm(n);
    if (!(nn > zero)) return Carries::kNo;
    f.weight[0] = dot(n, cross(q, r));
    f.weight[1] = dot(n, cross(r, p));
    f.weight[2] = dot(n, cross(p, q));
    point = n * (dot(n, p) / nn);
  } else {
    const T w[4] = {dot(q, cross(r, t)), -dot(p, cross(r, t)), dot(p, cross(q, t)), -dot(p, cross(q, r))};
    const bool positive = w[0] > zero;
    for (int i = 0; i < 4; ++i)
      if (!(positive ? w[i] > zero : w[i] < zero)) return Carries::kNo;
    return Carries::kOrigin;
  }
  return Carries::kPoint;
}

/// Last resort of reduce_to_nearest(), for bodies of sizes in the ratio 1e12 with features 1e-10 wide and 1e2 long.
/// Weighs every feature from its vertex nearest to the origin, since the cross product of two long, almost parallel
/// edges, or a far vertex, would lose that ratio's digits. Scalars only.
template <class T>
CLEARANCE_HD inline Nearest<T> reduce_carefully(const Simplex<T>& old, const CsoVertex<T>& newest) {
  const T zero = T(0);
  Nearest<T> best;
  best.encloses = false;
  bool found = false;
  for (int mask = 0; mask < 1 << old.size; ++mask) {
    Simplex<T> f;
    f.vertex[f.size++] = newest;
    for (int i = 0; i < old.size; ++i)
      if (mask >> i & 1) f.vertex[f.size++] = old.vertex[i];
    int near = 0;
    for (int i = 1; i < f.size; ++i)
      if (squared_norm(f.vertex[i].w) < squared_norm(f.vertex[near].w)) near = i;
    const CsoVertex<T> first = f.vertex[near];
    f.vertex[near] = f.vertex[0];
    f.vertex[0] = first;
    Vec3<T> point;
    const Carries carries = weigh(f, point);
    best.encloses = carries == Carries::kOrigin;
    if (best.encloses) return best;
    if (carries == Carries::kNo) continue;
    T sum = zero;
    bool inside = true;
    for (int i = 0; i < f.size; ++i) {
      inside = inside && f.weight[i] > zero;
      sum = sum + f.weight[i];
    }
    const T d = squared_norm(point);
    if (!inside || (found && !(d < best.squared_distance))) continue;
    for (int i = 0; i < f.size; ++i) f.weight[i] = f.weight[i] / sum;
    found = true;
    best.simplex = f;
    best.v = point;
    best.squared_distance = d;
  }
  return best;
}

}  // namespace clearance
