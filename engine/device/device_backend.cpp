// The engine's device: opened, lost, counted; and what may stand in for it.
#include <algorithm>

#include "engine/device/device_job.h"
#include "engine/device/several_devices.h"
#include "engine/device/shared_memory.h"

namespace clearance::cuda {

namespace {

struct StandIn {
  DeviceInfo info;
  DeviceStandIn::Open open;
  const SharedMemoryCalls* memory = nullptr;
};
StandIn& stand_in() {
  static StandIn one;
  return one;
}

}  // namespace

DeviceStandIn::DeviceStandIn(DeviceInfo info, Open open, const SharedMemoryCalls* memory) {
  stand_in() = {std::move(info), std::move(open), memory};
}
DeviceStandIn::~DeviceStandIn() {
  stand_in() = {};
}

bool has_stand_in() {
  return stand_in().open != nullptr;
}
const SharedMemoryCalls& memory_calls() {
  return stand_in().memory ? *stand_in().memory : installed_memory();
}
const DeviceInfo& device_info() {
  return stand_in().open ? stand_in().info : installed_device();
}
std::string device_name(int number) {
  return stand_in().open ? stand_in().info.name : installed_device_name(number);
}
std::shared_ptr<Device> make_device(const Scene& scene, int number, std::uint64_t memory_limit) {
  return stand_in().open ? stand_in().open(scene, number, memory_limit) : open_device(scene, number, memory_limit);
}

DeviceBackend::DeviceBackend(const Scene& scene, const Options& options) : scene_(scene), options_(options) {
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
  if (error.kind == DeviceError::kNoRoom) ++without_room;
  const std::lock_guard lock(mutex_);
  error_ = error.what();
}

std::unique_ptr<DeviceWarmTable> DeviceBackend::take_warm(const Plan& plan, std::uint64_t rows) {
  const std::uint64_t pair_limits = warm_question(plan);
  if (rows == 0 || rows > WarmStore::kMostSimplices) return nullptr;
  std::unique_ptr<DeviceWarmTable> table = warm_.take(plan.query.warm_slot);
  if (table && table->pair_limits == pair_limits && table->rows == rows) return table;
  table = std::make_unique<DeviceWarmTable>();
  table->client = plan.query.warm_slot;
  table->pair_limits = pair_limits;
  table->rows = rows;
  try {
    table->memory = device_->make_warm(rows);
  } catch (const DeviceError& error) {
    if (error.kind != DeviceError::kNoRoom) throw;
    return nullptr;
  }
  return table;
}

void DeviceBackend::append(Counters& counters) const {
  const DeviceCounters d = device_ ? device_->counters() : DeviceCounters();
  counters.insert(counters.end(), {{"cuda.scene_bytes", d.scene_bytes},
                                   {"cuda.query_bytes", d.query_bytes},
                                   {"cuda.pinned_bytes", d.pinned_bytes},
                                   {"cuda.allocations", d.allocations},
                                   {"cuda.kernel_ns", d.kernel_ns},
                                   {"cuda.broad_phase_ns", d.broad_phase_ns},
                                   {"cuda.chunks", d.launches},
                                   {"cuda.queries", queries},
                                   {"cuda.queries_on_cpu", queries_on_cpu},
                                   {"cuda.queries_without_room", without_room},
                                   {"cuda.usable", usable_ ? 1u : 0u},
                                   {"cuda.pairs_settled", converged},
                                   {"cuda.pairs_finished_on_cpu", finished_on_cpu},
                                   {"cuda.motions_finished_on_cpu", motions_finished_on_cpu},
                                   {"cuda.reply_bytes_copied", reply_bytes_copied}});
  if (several_) several_->append(counters);
}

}  // namespace clearance::cuda
