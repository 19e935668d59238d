#include "engine/broad/box_columns.h"

#include <limits>

#include "engine/base/clones.h"

namespace clearance {

CLEARANCE_CLONES __attribute__((flatten)) void box_gaps(const Aabb& a, const BoxColumnsView& b, std::size_t count,
                                                        double* __restrict gaps) {
  const double *lx = b.column[0], *ly = b.column[1], *lz = b.column[2];
  const double *hx = b.column[3], *hy = b.column[4], *hz = b.column[5];
  const Aabb box = a;
  for (std::size_t i = 0; i < count; ++i)
    gaps[i] = certify_box_gap(box, {{lx[i], ly[i], lz[i]}, {hx[i], hy[i], hz[i]}});
}

CLEARANCE_CLONES __attribute__((flatten)) void box_gaps(const BoxColumnsView& a, const BoxColumnsView& b,
                                                        std::size_t count, double* __restrict gaps) {
  const double *alx = a.column[0], *aly = a.column[1], *alz = a.column[2];
  const double *ahx = a.column[3], *ahy = a.column[4], *ahz = a.column[5];
  const double *lx = b.column[0], *ly = b.column[1], *lz = b.column[2];
  const double *hx = b.column[3], *hy = b.column[4], *hz = b.column[5];
  for (std::size_t i = 0; i < count; ++i)
    gaps[i] = certify_box_gap({{alx[i], aly[i], alz[i]}, {ahx[i], ahy[i], ahz[i]}},
                              {{lx[i], ly[i], lz[i]}, {hx[i], hy[i], hz[i]}});
}

namespace {

CLEARANCE_CLONES __attribute__((flatten)) void certify_hull_boxes(const HullExtents& hull, const PoseColumnsView& at,
                                                                  std::size_t count, double* __restrict lx,
                                                                  double* __restrict ly, double* __restrict lz,
                                                                  double* __restrict hx, double* __restrict hy,
                                                                  double* __restrict hz) {
  const double *xx = at.column[0], *xy = at.column[1], *xz = at.column[2];
  const double *yx = at.column[3], *yy = at.column[4], *yz = at.column[5];
  const double *zx = at.column[6], *zy = at.column[7], *zz = at.column[8];
  const double *tx = at.column[9], *ty = at.column[10], *tz = at.column[11];
  const Vec3d centre = hull.centre, half = hull.half;
  const double spread = hull.spread, rho = hull.rho, radius = hull.radius;
  for (std::size_t i = 0; i < count; ++i) {
    const Mat3d R{{{xx[i], xy[i], xz[i]}, {yx[i], yy[i], yz[i]}, {zx[i], zy[i], zz[i]}}};
    const Aabb box = certify_box(centre, half, spread, rho, radius, R, {tx[i], ty[i], tz[i]});
    lx[i] = box.low.x;
    ly[i] = box.low.y;
    lz[i] = box.low.z;
    hx[i] = box.high.x;
    hy[i] = box.high.y;
    hz[i] = box.high.z;
  }
}

CLEARANCE_CLONES __attribute__((flatten)) void join_columns(const double* __restrict from, double* __restrict to,
                                                            std::size_t count, bool low) {
  if (low)
    for (std::size_t i = 0; i < count; ++i) to[i] = from[i] < to[i] ? from[i] : to[i];
  else
    for (std::size_t i = 0; i < count; ++i) to[i] = to[i] < from[i] ? from[i] : to[i];
}

}  // namespace

void certify_boxes(const Piece& piece, const PoseColumnsView& at, BoxColumns& boxes) {
  if (!is_half_space(piece))
    return certify_hull_boxes(piece, at, boxes.size(), boxes.column(0), boxes.column(1), boxes.column(2),
                              boxes.column(3), boxes.column(4), boxes.column(5));
  const auto* const c = at.column;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const Mat3d R{{{c[0][i], c[1][i], c[2][i]}, {c[3][i], c[4][i], c[5][i]}, {c[6][i], c[7][i], c[8][i]}}};
    boxes.set(i, certify_box(piece, R, {c[9][i], c[10][i], c[11][i]}));
  }
}

void join_boxes(const BoxColumns& boxes, BoxColumns& wholes) {
  const BoxColumnsView from = boxes.view();
  for (std::size_t k = 0; k < 6; ++k) join_columns(from.column[k], wholes.column(k), boxes.size(), k < 3);
}

std::size_t gaps_within(const double* gaps, std::size_t count, double max_distance, std::uint32_t* near) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < count; ++i) {  // without a branch: few are near, but nobody knows which
    near[found] = static_cast<std::uint32_t>(i);
    found += !(gaps[i] > max_distance) | !(gaps[i] < std::numeric_limits<double>::infinity());
  }
  return found;
}

}  // namespace clearance
