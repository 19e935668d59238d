#define CLEARANCE_ISA lanes_scan_avx512
#include "engine/hull/lanes/lanes_scan.h"

namespace clearance {

SupportPoint<double> lanes_scan_avx512::scan(const VertexColumns& vertices, const Vec3d& n) {
  return scan_in_packs(vertices, n);
}

}  // namespace clearance
