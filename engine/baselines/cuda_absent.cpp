// In place of cuda_gjk.cu where the build has no CUDA.
#include <stdexcept>

#include "cuda_gjk.h"

namespace clearance::baselines {

const std::vector<std::string>& cuda_narrow_names() {
  static const std::vector<std::string> none;
  return none;
}

std::unique_ptr<NarrowBaseline> make_cuda_narrow(std::string_view, const NarrowOptions&) {
  throw std::runtime_error("this build has no CUDA");
}

double transfer_us(Transfer, const World&, std::size_t, int) {
  throw std::runtime_error("this build has no CUDA");
}

}  // namespace clearance::baselines
