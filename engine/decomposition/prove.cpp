#include "engine/decomposition/prove.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "engine/base/fp_environment.h"
#include "engine/hull/hull.h"

namespace clearance {

ProvedDecomposition prove_decomposition(const Surface& exact_value, std::span<const std::vector<Vec3d>> proposed,
                                        const ProofEffort& effort) {
  const FpEnvironment environment;
  if (proposed.empty()) throw std::invalid_argument("there is no piece");
  if (exact_value.is_cloud()) throw std::invalid_argument("points are not decomposed");
  ProvedDecomposition out;
  std::vector<ConvexPartPtr>& cores = out.decomposition.parts;
  for (std::size_t i = 0; i < proposed.size(); ++i) try {
      cores.push_back(make_hull_part(proposed[i], {}, 0));
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument("piece " + std::to_string(i) + ": " + e.what());
    }
  const ProvedLength inner = prove_inner(exact_value, cores, effort);
  out.decomposition.inner = inner.bound;
  out.inner_met = inner.met;
  for (const ConvexPartPtr& core : cores) {
    const ProvedLength outer = prove_outer(exact_value, *core, effort);
    out.decomposition.outer.push_back(outer.bound);
    out.outer_met = std::max(out.outer_met, outer.met);
  }
  return out;
}

}  // namespace clearance
