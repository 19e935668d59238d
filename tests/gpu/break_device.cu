// A kernel that goes wrong, after which the device answers nothing more in this process.
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
