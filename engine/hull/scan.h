// The farthest vertex along a direction by a scan in SIMD lanes.
#pragma once

#include <cstddef>

#include "engine/base/vec.h"
#include "engine/hull/support.h"

namespace clearance {

/// Coordinates of vertices by columns.
struct VertexColumns {
  const double *x, *y, *z;
  std::size_t count;  ///< a multiple of kScanBlock, at least one block
};
/// Vertices that every instruction set takes together: a register of AVX-512, two of AVX2, four of the baseline.
inline constexpr std::size_t kScanBlock = 8;

/// Returns the vertex with the largest computed n . v, ties to the lowest index, and index 0 if n is not a number. All
/// instruction sets give the same bits.
using Scan = SupportPoint<double> (*)(const VertexColumns& vertices, const Vec3d& n);

// One Scan for each instruction set (lanes/); the first two on x86 only.
namespace lanes_scan_avx512 {
SupportPoint<double> scan(const VertexColumns& vertices, const Vec3d& n);
}
namespace lanes_scan_avx2 {
SupportPoint<double> scan(const VertexColumns& vertices, const Vec3d& n);
}
namespace lanes_scan_baseline {
SupportPoint<double> scan(const VertexColumns& vertices, const Vec3d& n);
}

}  // namespace clearance
