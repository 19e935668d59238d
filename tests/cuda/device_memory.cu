#include <cstdio>
#include <cstdlib>

#include "device_memory.h"

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

DeviceMemory::DeviceMemory(std::size_t bytes) : bytes_(bytes) {
  void* p = nullptr;
  check(cudaMalloc(&p, bytes > 0 ? bytes : 1), "cudaMalloc");
  data_ = static_cast<std::byte*>(p);
}
DeviceMemory::~DeviceMemory() {
  cudaFree(data_);
}
void DeviceMemory::put(const void* from, std::size_t bytes) {
  check(cudaMemcpy(data_, from, bytes, cudaMemcpyHostToDevice), "cudaMemcpy");
}
void DeviceMemory::fill(int byte) {
  check(cudaMemset(data_, byte, bytes_), "cudaMemset");
  check(cudaDeviceSynchronize(), "cudaDeviceSynchronize");
}
std::vector<std::byte> DeviceMemory::get() const {
  std::vector<std::byte> bytes(bytes_);
  check(cudaMemcpy(bytes.data(), data_, bytes_, cudaMemcpyDeviceToHost), "cudaMemcpy");
  return bytes;
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
