#include <cstdio>
#include <cstdlib>

#include "tests/gpu/device_memory.h"

namespace clearance::test {

namespace {
void check(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return;
  std::fprintf(stderr, "%s: %s\n", what, cudaGetErrorString(error));
  std::abort();
}
cudaStream_t stream_of(void* p) {
  return static_cast<cudaStream_t>(p);
}
}  // namespace

void copy_to_device(std::byte* to, const void* from, std::size_t bytes) {
  check(cudaMemcpy(to, from, bytes, cudaMemcpyHostToDevice), "cudaMemcpy");
  // A copy from pageable memory may return before the data has arrived, and queries have streams of their own.
  check(cudaStreamSynchronize(cudaStreamLegacy), "cudaStreamSynchronize");
}
void copy_from_device(void* to, const std::byte* from, std::size_t bytes) {
  check(cudaMemcpy(to, from, bytes, cudaMemcpyDeviceToHost), "cudaMemcpy");
}

int device_count() {
  int devices = 0;
  check(cudaGetDeviceCount(&devices), "cudaGetDeviceCount");
  return devices;
}

DeviceMemory::DeviceMemory(std::size_t bytes) : bytes_(bytes) {
  void* p = nullptr;
  check(cudaMalloc(&p, bytes > 0 ? bytes : 1), "cudaMalloc");
  data_ = static_cast<std::byte*>(p);
}
DeviceMemory::~DeviceMemory() {
  cudaFree(data_);
}
void DeviceMemory::put(const void* from, std::size_t bytes) {
  copy_to_device(data_, from, bytes);
}
void DeviceMemory::fill(int byte) {
  check(cudaMemset(data_, byte, bytes_), "cudaMemset");
  check(cudaDeviceSynchronize(), "cudaDeviceSynchronize");
}
std::vector<std::byte> DeviceMemory::get() const {
  std::vector<std::byte> bytes(bytes_);
  copy_from_device(bytes.data(), data_, bytes_);
  return bytes;
}

MappedMemory::MappedMemory(std::span<const std::byte, 64> handle, std::span<const std::byte, 16> uuid) {
  const int devices = device_count();
  bool found = false;
  for (int i = 0; i < devices && !found; ++i) {
    cudaDeviceProp properties{};
    check(cudaGetDeviceProperties(&properties, i), "cudaGetDeviceProperties");
    found = std::memcmp(&properties.uuid, uuid.data(), uuid.size()) == 0;
    if (found) check(cudaSetDevice(i), "cudaSetDevice");
  }
  if (!found) check(cudaErrorInvalidDevice, "no device has that UUID");
  cudaIpcMemHandle_t ipc{};
  static_assert(sizeof ipc == 64);
  std::memcpy(&ipc, handle.data(), sizeof ipc);
  void *mapped = nullptr, *sum = nullptr;
  check(cudaIpcOpenMemHandle(&mapped, ipc, cudaIpcMemLazyEnablePeerAccess), "cudaIpcOpenMemHandle");
  check(cudaMalloc(&sum, sizeof(unsigned long long)), "cudaMalloc");
  data_ = static_cast<std::byte*>(mapped);
  sum_ = static_cast<std::byte*>(sum);
}
MappedMemory::~MappedMemory() {
  cudaFree(sum_);
  cudaIpcCloseMemHandle(data_);
}
void MappedMemory::put(std::size_t offset, const void* from, std::size_t bytes) {
  copy_to_device(data_ + offset, from, bytes);
}
std::vector<std::byte> MappedMemory::get(std::size_t offset, std::size_t bytes) const {
  std::vector<std::byte> copy(bytes);
  copy_from_device(copy.data(), data_ + offset, bytes);
  return copy;
}

__global__ void sum_words(const unsigned long long* words, std::size_t count, unsigned long long* sum) {
  unsigned long long mine = 0;
  for (std::size_t i = blockIdx.x * std::size_t{blockDim.x} + threadIdx.x; i < count;
       i += std::size_t{gridDim.x} * blockDim.x)
    mine += words[i];
  atomicAdd(sum, mine);
}
std::uint64_t MappedMemory::sum(std::size_t offset, std::size_t bytes) {
  auto* const sum = reinterpret_cast<unsigned long long*>(sum_);
  check(cudaMemsetAsync(sum, 0, sizeof *sum), "cudaMemset");
  sum_words<<<264, 256>>>(reinterpret_cast<const unsigned long long*>(data_ + offset), bytes / sizeof *sum, sum);
  check(cudaGetLastError(), "starting a kernel");
  unsigned long long result = 0;
  check(cudaMemcpy(&result, sum, sizeof result, cudaMemcpyDeviceToHost), "cudaMemcpy");
  return result;
}

DeviceStream::DeviceStream() {
  cudaStream_t stream = nullptr;
  check(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking), "cudaStreamCreate");
  stream_ = stream;
}
DeviceStream::~DeviceStream() {
  if (graph_) cudaGraphExecDestroy(static_cast<cudaGraphExec_t>(graph_));
  cudaStreamDestroy(stream_of(stream_));
}
void DeviceStream::wait() {
  check(cudaStreamSynchronize(stream_of(stream_)), "cudaStreamSynchronize");
}
void DeviceStream::capture(const std::function<void()>& work) {
  cudaGraph_t graph = nullptr;
  check(cudaStreamBeginCapture(stream_of(stream_), cudaStreamCaptureModeGlobal), "cudaStreamBeginCapture");
  work();
  check(cudaStreamEndCapture(stream_of(stream_), &graph), "cudaStreamEndCapture");
  cudaGraphExec_t ready = nullptr;
  check(cudaGraphInstantiate(&ready, graph, 0), "cudaGraphInstantiate");
  cudaGraphDestroy(graph);
  graph_ = ready;
}
void DeviceStream::launch() {
  check(cudaGraphLaunch(static_cast<cudaGraphExec_t>(graph_), stream_of(stream_)), "cudaGraphLaunch");
}

}  // namespace clearance::test
