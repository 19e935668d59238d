// Interface of the kernel library (libclearance-cuda.so), which the engine opens when a device is first requested. So
// no program of the project needs CUDA to start, and none contains the kernels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "engine/device/device.h"
#include "engine/device/shared_memory.h"

namespace clearance::cuda {

/// Implementations of the functions in device.h.
struct DeviceModule {
  const DeviceInfo& (*installed_device)();
  std::string (*device_name)(int number);
  std::shared_ptr<Device> (*open)(const engine::Scene& scene, int number, std::uint64_t memory_limit);
  bool (*is_pinned)(const void* memory);
  void (*pin)(std::byte* memory, std::size_t bytes);
  void (*unpin)(std::byte* memory);
  std::byte* (*allocate_pinned)(std::size_t bytes);
  void (*release_pinned)(std::byte* memory);
  SharedMemoryCalls shared_memory;
};

inline constexpr const char* kModuleFile = "libclearance-cuda.so";
/// Exported symbols: a DeviceModule, and as a string the digest of the code it was built from. The engine passes its
/// own objects to the library, so it rejects a library with another digest.
inline constexpr const char* kModuleSymbol = "clearance_device_module";
inline constexpr const char* kModuleCodeSymbol = "clearance_device_module_code";

}  // namespace clearance::cuda
