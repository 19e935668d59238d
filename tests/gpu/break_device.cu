// A kernel with an error that makes the device unusable for this process.
#include "tests/gpu/break_device.h"

namespace clearance::test {

namespace {
__global__ void trap() {
  __trap();
}
}  // namespace

void break_device() {
  trap<<<1, 1>>>();
  cudaDeviceSynchronize();
}

}  // namespace clearance::test
