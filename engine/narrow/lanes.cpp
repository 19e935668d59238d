#include "engine/narrow/lanes.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/base/instruction_sets.h"
#include "engine/hull/direction_table.h"
#include "engine/narrow/certify.h"

namespace clearance {

LaneHull::LaneHull(const ConvexPart& p)
    : HullExtents(p),
      x(p.x.data()),
      y(p.y.data()),
      z(p.z.data()),
      x_f32(p.x_f32.data()),
      y_f32(p.y_f32.data()),
      z_f32(p.z_f32.data()),
      count(p.x.empty() ? 0 : p.vertices.size()),
      vertices(p.vertices.data()),
      vertex_count(p.vertices.size()),
      cells(p.table ? p.table->cells.data() : nullptr),
      lists(p.table ? p.table->lists.data() : nullptr),
      grid_bits(p.table ? p.table->grid_bits : 0),
      has_table(p.table != nullptr),
      round(is_round(p) ? p.primitive.get() : nullptr) {}

bool fits_f32(const ConvexPart& a, const ConvexPart& b) {
  return !a.table && !b.table && !a.primitive && !b.primitive &&
         sizes_fit_f32(a.spread + a.radius, b.spread + b.radius);
}

#ifdef CLEARANCE_LANES_X86
void run_lanes_avx512(const LaneBatch&);
void run_f32_lanes_avx512(const LaneBatch&);
void run_lanes_avx2(const LaneBatch&);
void run_f32_lanes_avx2(const LaneBatch&);
extern const int kLanes_avx512, kLanes_avx2;
#endif
void run_lanes_baseline(const LaneBatch&);
void run_f32_lanes_baseline(const LaneBatch&);
extern const int kLanes_baseline;

std::span<const LaneKernel> lane_kernels() {
  static const auto& kernels = *new std::vector<LaneKernel>([] {  // queries may outlast main()
    std::vector<LaneKernel> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back({"avx512", kLanes_avx512, run_lanes_avx512, run_f32_lanes_avx512});
    if (has_avx2_lanes()) k.push_back({"avx2", kLanes_avx2, run_lanes_avx2, run_f32_lanes_avx2});
#endif
    k.push_back({"baseline", kLanes_baseline, run_lanes_baseline, run_f32_lanes_baseline});
    return k;
  }());
  return kernels;
}

const LaneKernel& lane_kernel(std::string_view name) {
  const std::span<const LaneKernel> kernels = lane_kernels();
  if (name == "auto") return kernels[0];
  std::string names;
  for (const LaneKernel& k : kernels) {
    if (k.name == name) return k;
    names.append(names.empty() ? "" : ", ").append(k.name);
  }
  if (name == "avx512" || name == "avx2")
    throw std::runtime_error("instruction set '" + std::string(name) + "' is not on this machine; there are: " + names);
  throw std::invalid_argument("instruction set: expected auto, avx512, avx2 or baseline, got '" + std::string(name) +
                              "'");
}

}  // namespace clearance
