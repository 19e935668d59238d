// Stands in for device.cu where the build has no CUDA.
#include "engine/device/device.h"

namespace clearance::cuda {

const DeviceInfo& installed_device() {
  static const DeviceInfo none{false, "", "this build has no CUDA"};
  return none;
}
std::string installed_device_name(int) {
  return {};
}
std::shared_ptr<Device> open_device(const Scene&, int, std::uint64_t) {
  throw DeviceError(DeviceError::kLost, installed_device().reason);
}
bool is_pinned(const void*) {
  return false;
}
RegisteredMemory::RegisteredMemory(std::byte*, std::size_t) : memory_(nullptr) {
  throw DeviceError(DeviceError::kLost, installed_device().reason);
}
RegisteredMemory::~RegisteredMemory() = default;
PinnedMemory::PinnedMemory(std::size_t) {
  throw DeviceError(DeviceError::kLost, installed_device().reason);
}
PinnedMemory::~PinnedMemory() = default;

}  // namespace clearance::cuda
