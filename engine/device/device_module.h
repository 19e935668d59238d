// What the library of the kernels (libclearance-cuda.so) gives the engine, which opens it when it is first asked for a
// device. So nothing of ours needs CUDA to start, and no program carries the kernels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "engine/device/device.h"
#include "engine/device/shared_memory.h"

namespace clearance::cuda {

/// The functions behind those of device.h.
struct DeviceModule {
  const DeviceInfo& (*installed_device)();
  std::string (*device_name)(int number);
  std::shared_ptr<Device> (*open)(const Scene& scene, int number, std::uint64_t memory_limit);
  bool (*is_pinned)(const void* memory);
  void (*pin)(std::byte* memory, std::size_t bytes);
  void (*unpin)(std::byte* memory);
  std::byte* (*allocate_pinned)(std::size_t bytes);
  void (*release_pinned)(std::byte* memory);
  SharedMemoryCalls shared_memory;
};

inline constexpr const char* kModuleFile = "libclearance-cuda.so";
/// What the library shows: a DeviceModule, and as a text the digest of the code that it was built from. The engine
/// hands it its own objects, so it takes none but that of its own code.
inline constexpr const char* kModuleSymbol = "clearance_device_module";
inline constexpr const char* kModuleCodeSymbol = "clearance_device_module_code";

}  // namespace clearance::cuda
