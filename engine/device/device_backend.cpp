// The engine's device: opening, loss, counters, and the fake device of tests.
#include <algorithm>

#include "engine/device/device_job.h"
#include "engine/device/several_devices.h"
#include "engine/device/shared_memory.h"

namespace clearance::cuda {

namespace {

struct FakeDeviceSlot {
  DeviceInfo info;
  FakeDevice::Open open;
  const SharedMemoryCalls* memory = nullptr;
};
FakeDeviceSlot& fake_device() {
  static FakeDeviceSlot one;
  return one;
}

}  // namespace

FakeDevice::FakeDevice(DeviceInfo info, Open open, const SharedMemoryCalls* memory) {
  fake_device() = {std::move(info), std::move(open), memory};
}
FakeDevice::~FakeDevice() {
  fake_device() = {};
}

bool has_fake_device() {
  return fake_device().open != nullptr;
}
const SharedMemoryCalls& memory_calls() {
  return fake_device().memory ? *fake_device().memory : installed_memory();
}
const DeviceInfo& device_info() {
  return fake_device().open ? fake_device().info : installed_device();
}
std::string device_name(int number) {
  return fake_device().open ? fake_device().info.name : installed_device_name(number);
}
std::shared_ptr<Device> make_device(const engine::Scene& scene, int number, std::uint64_t memory_limit) {
  return fake_device().open ? fake_device().open(scene, number, memory_limit)
                            : open_device(scene, number, memory_limit);
}

DeviceBackend::DeviceBackend(const engine::Scene& scene, const Options& options) : scene_(scene), options_(options) {
  const std::vector<int> numbers = options.devices.empty() ? std::vector<int>{kCurrentDevice} : options.devices;
  std::vector<NumberedDevice> devices;
  for (const int number : numbers) {
    try {
      devices.push_back({number, make_device(scene, number, options.memory_limit)});
    } catch (const DeviceError& error) {
      const DeviceError named = numbers.size() > 1 ? of_device(number, error) : error;
      if (!options.fallback) throw named;
      error_ = named.what();
      devices.push_back({number, nullptr});
    }
  }
  usable_ = std::any_of(devices.begin(), devices.end(), [](const NumberedDevice& d) { return d.device != nullptr; });
  if (!usable_) return;
  if (devices.size() > 1) several_ = std::make_shared<SeveralDevices>(std::move(devices));
  device_ = several_ ? several_ : devices[0].device;
}

std::string DeviceBackend::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

void DeviceBackend::note(const DeviceError& error) {
  if (error.kind == DeviceError::kLost) usable_ = false;
  if (error.kind == DeviceError::kNoMemory) ++without_room;
  const std::lock_guard lock(mutex_);
  error_ = error.what();
}

void DeviceBackend::append(Counters& counters) const {
  const DeviceCounters d = device_ ? device_->counters() : DeviceCounters();
  counters.insert(counters.end(), {{"cuda.scene_bytes", d.scene_bytes},
                                   {"cuda.scene_bytes_uploaded", d.scene_bytes_uploaded},
                                   {"cuda.query_bytes", d.query_bytes},
                                   {"cuda.pinned_bytes", d.pinned_bytes},
                                   {"cuda.allocations", d.allocations},
                                   {"cuda.kernel_ns", d.kernel_ns},
                                   {"cuda.broad_phase_ns", d.broad_phase_ns},
                                   {"cuda.chunks", d.launches},
                                   {"cuda.queries", queries},
                                   {"cuda.queries_on_cpu", queries_on_cpu},
                                   {"cuda.queries_without_memory", without_room},
                                   {"cuda.usable", usable_ ? 1u : 0u},
                                   {"cuda.pairs_converged", converged},
                                   {"cuda.pairs_finished_on_cpu", finished_on_cpu},
                                   {"cuda.motions_finished_on_cpu", motions_finished_on_cpu},
                                   {"cuda.reply_bytes_copied", reply_bytes_copied}});
  if (several_) several_->append(counters);
}

}  // namespace clearance::cuda
