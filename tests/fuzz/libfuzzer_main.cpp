// libFuzzer's entry point for the one target that is linked with it.
#include "server/base/log.h"
#include "tests/fuzz/fuzz_target.h"

extern "C" __attribute__((visibility("default"))) int LLVMFuzzerInitialize(int*, char***) {
  clearance::log::start("off");
  return 0;
}

extern "C" __attribute__((visibility("default"))) int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                                                             std::size_t size) {
  static const clearance::fuzz::Target target = clearance::fuzz::targets().begin()->second;
  target(std::as_bytes(std::span(data, size)));
  return 0;
}
