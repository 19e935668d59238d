// Another process that maps device memory: `memory_client write|read|hold|die HANDLE FILE OFFSET BYTES`. Copies the
// bytes of the file to the mapping, or of the mapping to the file; or is killed while it has the mapping. hold: writes
// to the FIFO FILE.mapped once it has the mapping, and reads once FILE.go is opened; exits with 3 if the memory no
// longer exists.
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

namespace {

void check(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return;
  std::fprintf(stderr, "memory_client: %s: %s\n", what, cudaGetErrorString(error));
  std::exit(1);
}

void open_fifo(const std::string& path, const char* mode) {
  std::FILE* const fifo = std::fopen(path.c_str(), mode);  // waits for the other end
  if (!fifo) return;
  if (*mode == 'w') std::fputc('.', fifo);
  std::fclose(fifo);
}

void expect(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "memory_client: %s\n", what);
  std::exit(1);
}

}  // namespace

int main(int argc, char** argv) {
  expect(argc == 6, "expected write|read|hold|die HANDLE FILE OFFSET BYTES");
  const std::string what = argv[1], hex = argv[2];
  const std::size_t offset = std::strtoull(argv[4], nullptr, 10), bytes = std::strtoull(argv[5], nullptr, 10);
  cudaIpcMemHandle_t handle{};
  expect(hex.size() == 2 * sizeof handle, "HANDLE: expected 64 bytes as hexadecimal digits");
  for (std::size_t i = 0; i < sizeof handle; ++i)
    reinterpret_cast<unsigned char*>(&handle)[i] =
        static_cast<unsigned char>(std::stoi(hex.substr(2 * i, 2), nullptr, 16));
  void* mapped = nullptr;
  check(cudaIpcOpenMemHandle(&mapped, handle, cudaIpcMemLazyEnablePeerAccess), "cudaIpcOpenMemHandle");
  if (what == "die") std::raise(SIGKILL);
  if (what == "hold") {
    open_fifo(std::string(argv[3]) + ".mapped", "wb");
    open_fifo(std::string(argv[3]) + ".go", "rb");
  }
  std::vector<char> memory(bytes);
  std::FILE* const file = std::fopen(argv[3], what == "write" ? "rb" : "wb");
  expect(file, "cannot open FILE");
  char* const at = static_cast<char*>(mapped) + offset;
  if (what == "write") {
    expect(std::fread(memory.data(), 1, bytes, file) == bytes, "FILE is too short");
    check(cudaMemcpy(at, memory.data(), bytes, cudaMemcpyHostToDevice), "copying to the mapping");
    check(cudaDeviceSynchronize(), "waiting");
  } else {
    const cudaError_t copied = cudaMemcpy(memory.data(), at, bytes, cudaMemcpyDeviceToHost);
    if (what == "hold" && copied != cudaSuccess) return 3;
    check(copied, "copying from the mapping");
    expect(std::fwrite(memory.data(), 1, bytes, file) == bytes, "cannot write FILE");
  }
  expect(std::fclose(file) == 0, "cannot write FILE");
  check(cudaIpcCloseMemHandle(mapped), "cudaIpcCloseMemHandle");
  return 0;
}
