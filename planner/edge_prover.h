// Proofs of motions, for a planner.
#pragma once

#include <span>

namespace clearance {

/// Proves that straight motions in joint space are free.
class EdgeProver {
 public:
  virtual ~EdgeProver() = default;
  /// Returns whether the whole motion is proved free.
  /// \param ends (2, J) positions of the joints, radians and metres, at both ends; equal for a single state
  virtual bool is_free(std::span<const double> ends) = 0;
};

}  // namespace clearance
