// Replaces cuda_gjk.cu in a build without CUDA.
#include <stdexcept>

#include "bench/report/cuda_gjk.h"

namespace clearance::baselines {

const std::vector<std::string>& cuda_narrow_names() {
  static const std::vector<std::string> none;
  return none;
}

std::unique_ptr<NarrowBaseline> make_cuda_narrow(std::string_view, const NarrowOptions&) {
  throw std::runtime_error("this build has no CUDA");
}

struct Transfers::Impl {};
Transfers::Transfers(const World&, std::size_t) {
  throw std::runtime_error("this build has no CUDA");
}
Transfers::~Transfers() = default;
std::size_t Transfers::run(Transfer) {
  return 0;
}

}  // namespace clearance::baselines
