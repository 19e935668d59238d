// A library of no kernels, as the engine opens it: says that there is no device.
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
static const clearance::cuda::DeviceInfo& none() {
  static const clearance::cuda::DeviceInfo info{false, "", "no device today", 0};
  return info;
}
extern "C" __attribute__((visibility("default"))) const char* const clearance_device_module_code = CODE;
extern "C" __attribute__((visibility("default"))) const clearance::cuda::DeviceModule clearance_device_module = {
    none, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr};
#endif
