// The poses of links in all configurations of a query, made at once for a device, in slices.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/narrow/work_meter.h"
#include "engine/query/plan.h"

namespace clearance::cuda {

class LinkPoseMaker {
 public:
  /// \param plan moves joints, and outlives this. \param threads that share the work
  LinkPoseMaker(Plan& plan, int threads);
  /// Goes on until the slice is over. Returns true once Plan::made is there.
  bool advance(WorkMeter& slice);

 private:
  static constexpr std::uint64_t kBlock = 64;  // configurations that a thread makes at a time
  void make(std::uint64_t first, std::uint64_t end);

  Plan& plan_;
  int threads_;
  std::shared_ptr<MadePoses> made_;
  std::uint64_t next_ = 0;  // configuration
};

}  // namespace clearance::cuda
