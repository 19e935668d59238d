// The devices of this machine, as reported by the kernel library. Without the library there are none.
#include <dlfcn.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

#include "engine/base/helper_program.h"
#include "engine/device/device_module.h"
#include "engine_code.h"

namespace clearance::cuda {

namespace {

struct Opened {
  const DeviceModule* module = nullptr;
  DeviceInfo none;  ///< holds the reason if the module is missing
};

#ifdef CLEARANCE_CUDA_MODULE_BUILT
constexpr const char* kBuilt = CLEARANCE_CUDA_MODULE_BUILT;
#else
constexpr const char* kBuilt = nullptr;
#endif

// Never closed: devices and their memory live as long as the process.
const DeviceModule& load_module() {
  const std::string path = helper_library(kModuleFile, "CLEARANCE_CUDA_MODULE", kBuilt, ", which holds the kernels,");
  void* const library = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) throw std::runtime_error(::dlerror());
  const auto* const code = static_cast<const char* const*>(::dlsym(library, kModuleCodeSymbol));
  const auto* const module = static_cast<const DeviceModule*>(::dlsym(library, kModuleSymbol));
  if (!code || !module) throw std::runtime_error(path + " is not a library of Clearance's kernels");
  if (std::strcmp(*code, kEngineCode) != 0)
    throw std::runtime_error(path + " was built from other code than this engine; build or install both together");
  return *module;
}

const Opened& opened() {
  static const auto& one = *new Opened([] {
    Opened o;
    try {
      o.module = &load_module();
    } catch (const std::runtime_error& error) {
      o.none.reason = error.what();
    }
    return o;
  }());
  return one;
}

const DeviceModule& module_or_throw() {
  if (!opened().module) throw DeviceError(DeviceError::kLost, opened().none.reason);
  return *opened().module;
}

}  // namespace

const DeviceInfo& installed_device() {
  return opened().module ? opened().module->installed_device() : opened().none;
}
std::string installed_device_name(int number) {
  return module_or_throw().device_name(number);
}
std::shared_ptr<Device> open_device(const engine::Scene& scene, int number, std::uint64_t memory_limit) {
  return module_or_throw().open(scene, number, memory_limit);
}
bool is_pinned(const void* memory) {
  return opened().module && opened().module->is_pinned(memory);
}
RegisteredMemory::RegisteredMemory(std::byte* memory, std::size_t bytes) : memory_(memory) {
  module_or_throw().pin(memory, bytes);
}
RegisteredMemory::~RegisteredMemory() {
  module_or_throw().unpin(memory_);
}
PinnedMemory::PinnedMemory(std::size_t bytes) : data_(module_or_throw().allocate_pinned(bytes)) {}
PinnedMemory::~PinnedMemory() {
  module_or_throw().release_pinned(data_);
}
const SharedMemoryCalls& installed_memory() {
  return module_or_throw().shared_memory;
}
SharedMemory::SharedMemory(int device, std::size_t bytes)
    : bytes_((bytes + kConvexPart - 1) / kConvexPart * kConvexPart) {
  constexpr auto kMost = static_cast<std::size_t>(PTRDIFF_MAX);
  if (bytes == 0 || bytes > kMost)
    throw DeviceError(DeviceError::kNoMemory, "shared device memory: expected 1 to " + std::to_string(kMost) +
                                                  " bytes, not " + std::to_string(bytes));
  calls_ = &memory_calls();
  block_ = calls_->share(device, bytes_);
}
SharedMemory::~SharedMemory() {
  calls_->release(block_);
}
void SharedMemory::wait() {
  calls_->wait(block_);
}
bool SharedMemory::is_done() {
  return calls_->is_done(block_);
}

}  // namespace clearance::cuda
