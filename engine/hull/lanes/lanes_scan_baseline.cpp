#define CLEARANCE_ISA lanes_scan_baseline
#include "engine/hull/lanes/lanes_scan.h"

namespace clearance {

SupportPoint<double> scan_baseline(const VertexColumns& vertices, const Vec3d& n) {
  return lanes_scan_baseline::scan_in_packs(vertices, n);
}

}  // namespace clearance
