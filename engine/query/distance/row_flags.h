// Flags of rows that covers write.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/selection/plan.h"

namespace clearance {

/// kFlagRenormalised and kFlagBeyondLimits of pairs, where the configurations do not change them.
class RowFlags {
 public:
  /// \param plan must outlive this
  explicit RowFlags(const Plan& plan);

  /// 0 for a body without a pair.
  std::uint16_t of(BodyPair pair) const {
    return pair.b == kNone ? std::uint16_t{0} : static_cast<std::uint16_t>(flags_[pair.a] | flags_[pair.b]);
  }
  /// Whether a configuration adds to the flags, so that of() does not hold: a joint beyond its limits, or a pose that is
  /// not normalised.
  bool are_changed_by(std::uint64_t configuration) const;

 private:
  void take_moved();

  const Plan& plan_;
  std::vector<std::uint16_t> flags_;  // by body
};

}  // namespace clearance
