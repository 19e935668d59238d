// The engine's device: opened, lost, counted; and what may stand in for it.
#include "device_job.h"

namespace clearance::cuda {

namespace {

struct StandIn {
  DeviceInfo info;
  DeviceStandIn::Open open;
};
StandIn& stand_in() {
  static StandIn one;
  return one;
}

}  // namespace

DeviceStandIn::DeviceStandIn(DeviceInfo info, Open open) { stand_in() = {std::move(info), std::move(open)}; }
DeviceStandIn::~DeviceStandIn() { stand_in() = {}; }

const DeviceInfo& device_info() { return stand_in().open ? stand_in().info : installed_device(); }
std::shared_ptr<Device> make_device(const Scene& scene, std::uint64_t memory_limit) {
  return stand_in().open ? stand_in().open(scene, memory_limit) : open_device(scene, memory_limit);
}

DeviceBackend::DeviceBackend(const Scene& scene, const Options& options) : scene_(scene), options_(options) {
  try {
    device_ = make_device(scene, options.memory_limit);
    usable_ = true;
  } catch (const DeviceError& error) {
    if (!options.fallback) throw;
    error_ = error.what();
  }
}

std::string DeviceBackend::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

void DeviceBackend::note(const DeviceError& error) {
  if (error.kind == DeviceError::kLost)
    usable_ = false;
  else
    ++without_room;
  const std::lock_guard lock(mutex_);
  error_ = error.what();
}

std::unique_ptr<DeviceWarmTable> DeviceBackend::take_warm(const Plan& plan) {
  const std::uint64_t rows = plan.size.configurations * plan.size.pairs, question = warm_question(plan);
  if (rows == 0 || rows > WarmStore::kMostSimplices) return nullptr;
  std::unique_ptr<DeviceWarmTable> table = warm_.take(plan.query.warm_slot);
  if (table && table->question == question && table->rows == rows) return table;
  table = std::make_unique<DeviceWarmTable>();
  table->client = plan.query.warm_slot;
  table->question = question;
  table->rows = rows;
  try {
    table->memory = device_->make_warm(rows);
  } catch (const DeviceError& error) {
    if (error.kind == DeviceError::kLost) throw;
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
                                   {"cuda.chunks", d.launches},
                                   {"cuda.queries", queries},
                                   {"cuda.queries_on_cpu", queries_on_cpu},
                                   {"cuda.queries_without_room", without_room},
                                   {"cuda.usable", usable_ ? 1u : 0u},
                                   {"cuda.pairs_settled", settled},
                                   {"cuda.pairs_finished_on_cpu", finished_on_cpu},
                                   {"cuda.reply_bytes_copied", reply_bytes_copied}});
}

}  // namespace clearance::cuda
