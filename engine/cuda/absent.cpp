// Stands in for device.cu where the build has no CUDA.
#include <stdexcept>

#include "device.h"

namespace clearance::cuda {

const DeviceInfo& device_info() {
  static const DeviceInfo none{false, "", "this build has no CUDA"};
  return none;
}
std::shared_ptr<Device> make_device(const Scene&) {
  throw std::runtime_error(device_info().reason);
}
bool is_pinned(const void*) {
  return false;
}
PinnedMemory::PinnedMemory(std::size_t) {
  throw std::runtime_error(device_info().reason);
}
PinnedMemory::~PinnedMemory() = default;

}  // namespace clearance::cuda
