// Device memory that other processes can map (engine/device/shared_memory.h).
#pragma once

#include <cstring>
#include <string>

#include "engine/cuda/memory/memory.cuh"
#include "engine/device/shared_memory.h"

namespace clearance::cuda {

static_assert(sizeof(cudaIpcMemHandle_t) == sizeof(MemoryHandle::ipc));
static_assert(sizeof(cudaUUID_t) == sizeof(MemoryHandle::uuid));

// Accepts partially created blocks, which share() leaves when it fails.
inline void release_shared(const SharedBlock& block) {
  try {
    const OnDevice here(block.device);
    if (block.stream) {
      cudaStreamSynchronize(static_cast<cudaStream_t>(block.stream));
      cudaStreamDestroy(static_cast<cudaStream_t>(block.stream));
    }
    if (block.data) cudaFree(block.data);
    cudaGetLastError();
  } catch (const DeviceError&) {
    // The device and its memory are lost.
  }
}

inline void wait_for_shared(const SharedBlock& block) {
  const OnDevice here(block.device);
  check(cudaStreamSynchronize(static_cast<cudaStream_t>(block.stream)), "waiting for a plan in shared memory");
}

inline bool is_shared_done(const SharedBlock& block) {
  const OnDevice here(block.device);
  const cudaError_t now = cudaStreamQuery(static_cast<cudaStream_t>(block.stream));
  if (now == cudaErrorNotReady) {
    cudaGetLastError();  // clears the status, which is no error but would be returned by this thread's next call
    return false;
  }
  check(now, "waiting for a plan in shared memory");
  return true;
}

inline SharedBlock share(int device, std::size_t bytes) {
  const OnDevice here(device);
  SharedBlock block;
  block.device = device;
  try {
    block.data = DeviceKind::allocate(bytes);
    cudaStream_t stream{};
    check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "making a stream");
    block.stream = stream;
    check(cudaMemsetAsync(block.data, 0, bytes, stream), "clearing shared memory");
    wait_for_shared(block);
    cudaIpcMemHandle_t handle{};
    check(cudaIpcGetMemHandle(&handle, block.data), "sharing device memory between processes");
    std::memcpy(block.handle.ipc.data(), &handle, sizeof handle);
    cudaDeviceProp properties{};
    check(cudaGetDeviceProperties(&properties, device), "getting the device's UUID");
    std::memcpy(block.handle.uuid.data(), &properties.uuid, sizeof properties.uuid);
  } catch (...) {
    release_shared(block);
    throw;
  }
  return block;
}

}  // namespace clearance::cuda
