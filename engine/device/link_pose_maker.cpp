#include "engine/device/link_pose_maker.h"

#include <algorithm>
#include <exception>

#include "engine/base/fp_environment.h"
#include "engine/query/configuration_poses.h"

namespace clearance::cuda {

LinkPoseMaker::LinkPoseMaker(Plan& plan, int threads)
    : plan_(plan), threads_(threads), made_(std::make_shared<MadePoses>()) {
  const std::uint64_t K = plan.size.configurations, M = plan.bodies.size();
  made_->poses.resize(K * M);
  made_->facts.resize(K * M);
  made_->travels.resize(K * plan.motions.size());
}

bool LinkPoseMaker::advance(WorkMeter& slice) {
  const std::uint64_t K = plan_.size.configurations;
  while (next_ < K) {
    const std::uint64_t end = std::min(K, next_ + kBlock * static_cast<std::uint64_t>(threads_));
    make(next_, end);
    slice.count((end - next_) * plan_.bodies.size());
    next_ = end;
    if (slice.is_over() && next_ < K) return false;
  }
  plan_.made = std::move(made_);
  return true;
}

void LinkPoseMaker::make(std::uint64_t first, std::uint64_t end) {
  const std::uint64_t M = plan_.bodies.size(), motions = plan_.motions.size(),
                      blocks = (end - first + kBlock - 1) / kBlock;
  std::exception_ptr failure;  // an exception may not leave a parallel region
#pragma omp parallel for num_threads(threads_) schedule(static) if (blocks > 1)
  for (std::uint64_t block = 0; block < blocks; ++block) {
    try {
      const FpEnvironment environment;  // the thread's own
      const std::uint64_t begin = first + block * kBlock, count = std::min(kBlock, end - begin);
      ConfigurationPoses poses(plan_);
      const ConfigurationPoses::Block some = poses.at(begin, count);
      const auto put = [&](const auto& from, auto& to, std::uint64_t each) {
        std::copy(from.begin(), from.end(), to.begin() + static_cast<std::ptrdiff_t>(begin * each));
      };
      put(some.poses, made_->poses, M);
      put(some.facts, made_->facts, M);
      put(some.travels, made_->travels, motions);
    } catch (...) {
#pragma omp critical(clearance_link_pose_failure)
      failure = std::current_exception();
    }
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace clearance::cuda
