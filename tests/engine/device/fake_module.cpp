// A kernel library without kernels, which reports that there is no device.
#include <cstdio>
#include <cstdlib>

#include "engine/device/device_module.h"
#ifdef CLEARANCE_OLD
#define CODE "that of yesterday"
#else
#include "engine_code.h"
#define CODE clearance::kEngineCode
#endif

namespace {

const bool may_be_opened = [] {
  if (std::getenv("CLEARANCE_TEST_END_WHEN_OPENED")) std::_Exit(4);
  return true;
}();

}  // namespace

#ifndef CLEARANCE_FOREIGN
// Host memory in place of a device's. Calls are printed, so that a test can check them.
static clearance::cuda::SharedBlock share(int device, std::size_t bytes) {
  if (device == 7)
    throw clearance::cuda::DeviceError(clearance::cuda::DeviceError::kNoMemory, "a planted lack of room");
  std::fprintf(stderr, "share %zu on %d, ", bytes, device);
  clearance::cuda::SharedBlock block;
  block.data = static_cast<std::byte*>(std::calloc(bytes, 1));
  block.device = device;
  block.handle.ipc[63] = std::byte{42};
  return block;
}
static void wait_for_shared(const clearance::cuda::SharedBlock& block) {
  std::fprintf(stderr, "wait on %d, ", block.device);
}
static void release_shared(const clearance::cuda::SharedBlock& block) {
  std::fprintf(stderr, "release on %d, ", block.device);
  std::free(block.data);
}
static bool is_shared_done(const clearance::cuda::SharedBlock&) {
  return true;
}
static const clearance::cuda::DeviceInfo& none() {
  static const clearance::cuda::DeviceInfo info{false, "", "no device today", 0};
  return info;
}
extern "C" __attribute__((visibility("default"))) const char* const clearance_device_module_code = CODE;
extern "C" __attribute__((visibility("default"))) const clearance::cuda::DeviceModule clearance_device_module = {
    none,    nullptr, nullptr,
    nullptr, nullptr, nullptr,
    nullptr, nullptr, {share, wait_for_shared, release_shared, is_shared_done}};
#endif
