// Farthest vertices of hulls, for all lanes at once or for each on its own. Compiled as lanes_kernel.h is.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "engine/base/pack.h"
#include "engine/hull/direction_table.h"
#include "engine/hull/primitive.h"
#include "engine/narrow/lanes.h"

namespace clearance::CLEARANCE_ISA {

// One value for each lane: in memory, to write single lanes, and as a pack, to compute on all.
template <class T>
struct alignas(64) Column {
  T at[Pack<T>::kLanes];
  HWY_INLINE Pack<T> pack() const { return Pack<T>::load(at); }
  HWY_INLINE void set(Pack<T> p) { p.store(at); }
};

template <class T>
struct Columns3 {
  Column<T> x, y, z;
  HWY_INLINE Vec3<Pack<T>> pack() const { return {x.pack(), y.pack(), z.pack()}; }
  HWY_INLINE void set(const Vec3<Pack<T>>& p) {
    x.set(p.x);
    y.set(p.y);
    z.set(p.z);
  }
  template <class From>
  HWY_INLINE void set(int lane, const Vec3<From>& v) {
    x.at[lane] = static_cast<T>(v.x);
    y.at[lane] = static_cast<T>(v.y);
    z.at[lane] = static_cast<T>(v.z);
  }
};

template <class T>
struct PlacedColumns {
  Columns3<T> row[3];
  HWY_INLINE Mat3<Pack<T>> pack() const { return {{row[0].pack(), row[1].pack(), row[2].pack()}}; }
};

// A hull's vertices in the form that lanes use (RunSetup::kFromCentres).
template <class T>
struct Source;
template <>
struct Source<double> {
  const double *x, *y, *z;
  Vec3d centre;
  HWY_INLINE explicit Source(const LaneHull& h) : x(h.x), y(h.y), z(h.z), centre(h.centre) {}
  HWY_INLINE static Vec3<double> vertex(const LaneHull& h, std::uint32_t i) { return h.vertices[i]; }
};
template <>
struct Source<float> {
  const float *x, *y, *z;
  Vec3d centre;
  HWY_INLINE explicit Source(const LaneHull& h) : x(h.x_f32), y(h.y_f32), z(h.z_f32), centre{0, 0, 0} {}
  HWY_INLINE static Vec3<float> vertex(const LaneHull& h, std::uint32_t i) {
    return {h.x_f32[i], h.y_f32[i], h.z_f32[i]};
  }
};

template <class T>
struct FoundVertex {
  Vec3<Pack<T>> p;
  Pack<T> index, value;
};

// The farthest vertex of a hull along n, by a scan. Ties go to the lowest index, as in support().
template <class T>
struct Scan {
  const T *x, *y, *z;
  std::size_t count;
  Vec3<Pack<T>> n;
  Pack<T> best, index;

  HWY_INLINE Scan(const LaneHull& hull, const Vec3<Pack<T>>& direction) : count(hull.count), n(direction), index(0.0) {
    const Source<T> from(hull);
    x = from.x;
    y = from.y;
    z = from.z;
    best = value(0);
  }
  HWY_INLINE Pack<T> value(std::size_t i) const {
    return n.x * Pack<T>(x[i]) + n.y * Pack<T>(y[i]) + n.z * Pack<T>(z[i]);
  }
  HWY_INLINE void update(std::size_t i, Pack<T> i_pack) {
    const Pack<T> s = value(i);
    index = select(s > best, i_pack, index);
    best = max(s, best);
  }
  HWY_INLINE FoundVertex<T> found() const {
    return {{Pack<T>::gather(x, index), Pack<T>::gather(y, index), Pack<T>::gather(z, index)}, index, best};
  }
};

// 0, 1, 2, ...
template <class T>
struct alignas(64) Counting {
  T at[Pack<T>::kLanes];
  constexpr Counting() : at() {
    for (int l = 0; l < Pack<T>::kLanes; ++l) at[l] = static_cast<T>(l);
  }
};
template <class T>
constexpr Counting<T> kCounting;

// A hull's farthest vertex for one lane.
template <class T>
struct OneFound {
  std::uint32_t index;
  T value;
};

// The same from the hull's direction table.
template <class T>
HWY_INLINE OneFound<T> look_up(const LaneHull& hull, double u, double v, const Vec3<T>& n) {
  const std::uint32_t* list = hull.lists + find_list(hull.cells, hull.grid_bits, u, v);
  OneFound<T> found{0, 0};
  for (std::uint32_t i = 1; i <= list[0]; ++i) {
    const Vec3d& w = hull.vertices[list[i]];
    const T s = n.x * static_cast<T>(w.x) + n.y * static_cast<T>(w.y) + n.z * static_cast<T>(w.z);
    if (i == 1 || s > found.value) found = {list[i], s};
  }
  return found;
}

// The same by a scan, with as many vertices at a time as there are lanes. The arrays are padded (`ConvexPart::x`).
template <class T>
HWY_INLINE OneFound<T> scan_across(const T* x, const T* y, const T* z, std::size_t count, const Vec3<T>& n) {
  using P = Pack<T>;
  const P nx(n.x), ny(n.y), nz(n.z);
  const auto values = [&](std::size_t i) {
    return nx * P::load_unaligned(x + i) + ny * P::load_unaligned(y + i) + nz * P::load_unaligned(z + i);
  };
  const P lanes(static_cast<double>(P::kLanes));
  P best = values(0), index = P::load(kCounting<T>.at), i_pack = index;
  for (std::size_t i = P::kLanes; i < count; i += P::kLanes) {
    const P s = values(i);
    i_pack = i_pack + lanes;
    index = select(s > best, i_pack, index);
    best = max(s, best);
  }
  const T most = most_of(best);
  const T first = least_of(select(best == P(most), index, P(static_cast<double>(count))));
  return {static_cast<std::uint32_t>(static_cast<std::int64_t>(first)), most};
}

// Scans both hulls together, so that the arithmetic of one fills the latency of the other.
template <class T>
HWY_INLINE void scan_both(Scan<T>& a, Scan<T>& b) {
  const std::size_t common = a.count < b.count ? a.count : b.count;
  const Pack<T> one(1.0);
  Pack<T> i_pack = one;
  std::size_t i = 1;
  for (; i < common; ++i, i_pack = i_pack + one) {
    a.update(i, i_pack);
    b.update(i, i_pack);
  }
  for (Pack<T> k = i_pack; i < a.count; ++i, k = k + one) a.update(i, k);
  for (i = common; i < b.count; ++i, i_pack = i_pack + one) b.update(i, i_pack);
}

template <class T>
HWY_INLINE FoundVertex<T> scan_one(const LaneHull& hull, const Vec3<Pack<T>>& n) {
  Scan<T> scan(hull, n);
  Pack<T> i_pack(1.0);
  for (std::size_t i = 1; i < hull.count; ++i, i_pack = i_pack + Pack<T>(1.0)) scan.update(i, i_pack);
  return scan.found();
}

// Points of a round core that a lane has found, by number. The first is its origin, as in CorePoints.
struct FoundPoints {
  static constexpr std::uint32_t kMost = 48;
  Vec3d at[kMost];
  std::uint32_t count;

  HWY_INLINE void clear() {
    at[0] = {0, 0, 0};
    count = 1;
  }
  // The number of a point; a new one is added.
  HWY_INLINE std::uint32_t number_of(const Vec3d& p) {
    for (std::uint32_t i = 0; i < count; ++i)
      if (at[i].x == p.x && at[i].y == p.y && at[i].z == p.z) return i;
    at[count] = p;
    return count++;
  }
};

// Searches of each lane's own core along its own direction.
template <class T>
struct EachSearch {
  Columns3<T> direction, p;
  Column<T> u, v, index, value;

  HWY_INLINE explicit EachSearch(const Vec3<Pack<T>>& n) {
    const MapPoint<Pack<T>> point = map_point(n);
    u.set(point.u);
    v.set(point.v);
    direction.set(n);
  }
  // \param busy whether it needs the farthest vertex; otherwise it gets the first
  // \param points of this lane and core, if it is round
  HWY_INLINE void find(int lane, const LaneHull& hull, bool busy, FoundPoints* points) {
    OneFound<T> found{0, 0};
    if constexpr (std::is_same_v<T, double>) {
      if (busy && hull.round) {
        const Vec3d along{direction.x.at[lane], direction.y.at[lane], direction.z.at[lane]};
        const FarthestPoint<double> far = farthest_of_round(*hull.round, along);
        p.set(lane, far.point);
        index.at[lane] = points->number_of(far.point);
        value.at[lane] = far.value;
        return;
      }
    }
    if (busy) {
      const Vec3<T> along{direction.x.at[lane], direction.y.at[lane], direction.z.at[lane]};
      const Source<T> from(hull);
      found = hull.has_table ? look_up<T>(hull, u.at[lane], v.at[lane], along)
                             : scan_across<T>(from.x, from.y, from.z, hull.count, along);
    }
    p.set(lane, Source<T>::vertex(hull, found.index));
    index.at[lane] = static_cast<T>(found.index);
    value.at[lane] = found.value;
  }
  HWY_INLINE FoundVertex<T> found() const { return {p.pack(), index.pack(), value.pack()}; }
};

// The farthest vertices of each lane's own hull; none is round.
template <class T>
HWY_INLINE FoundVertex<T> find_each(const LaneHull* const* hulls, const bool* busy, const Vec3<Pack<T>>& n) {
  EachSearch<T> search(n);
  for (int lane = 0; lane < Pack<T>::kLanes; ++lane) search.find(lane, *hulls[lane], busy[lane], nullptr);
  return search.found();
}

}  // namespace clearance::CLEARANCE_ISA
