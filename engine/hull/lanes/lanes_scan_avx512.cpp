#define CLEARANCE_ISA lanes_scan_avx512
#include "engine/hull/lanes/lanes_scan.h"

namespace clearance {

SupportPoint<double> scan_avx512(const VertexColumns& vertices, const Vec3d& n) {
  return lanes_scan_avx512::scan_in_packs(vertices, n);
}

}  // namespace clearance
