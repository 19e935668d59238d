#include "engine/mesh/loader/loader_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>

#include "engine/base/sanitizers.h"
#include "engine/mesh/loader/loader_sandbox.h"
#include "engine/mesh/mesh_format.h"

namespace clearance {

namespace {

void limit(int resource, std::uint64_t value) {
  const rlimit both{value, value};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &both);
}

// The sealed file that the host process passed on.
std::string_view mapped_file() {
  struct stat info{};
  if (::fstat(kMeshFileFd, &info) != 0 || info.st_size <= 0) return {};
  const auto size = static_cast<std::size_t>(info.st_size);
  const void* content = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, kMeshFileFd, 0);
  return content == MAP_FAILED ? std::string_view() : std::string_view(static_cast<const char*>(content), size);
}

}  // namespace

int loader_main(int argc, char** argv, ImportFile import) {
  const std::string_view content = mapped_file();
  if (argc != 5 || ::fcntl(kMeshResultFd, F_GETFD) < 0 || content.empty()) {
    std::fprintf(stderr, "clearance-mesh-loader reads mesh files for the clearance library; do not run it by hand\n");
    return 2;
  }
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
#ifdef SYS_close_range
  ::syscall(SYS_close_range, unsigned{kMeshFileFd} + 1, ~0u, 0u);  // descriptors that the host process left open
#endif
  const std::uint64_t memory_bytes = std::strtoull(argv[2], nullptr, 10);
  const std::uint64_t seconds = std::strtoull(argv[3], nullptr, 10);
#if !defined(CLEARANCE_ASAN) && !defined(CLEARANCE_TSAN)
  limit(RLIMIT_AS, memory_bytes + content.size());  // sanitizers map terabytes of shadow
#endif
  limit(RLIMIT_CPU, seconds);
  limit(RLIMIT_FSIZE, memory_bytes);
  limit(RLIMIT_CORE, 0);
  LoaderLimits limits = LoaderLimits::kAll;
  try {
    if (!confine_loader(kMeshResultFd).empty()) limits = LoaderLimits::kNoCallFilter;
  } catch (const std::exception& e) {
    ::_exit(write_mesh_error(kMeshResultFd, MeshState::kError, e.what()) ? 0 : 3);
  }
  const bool whole = import(argv[1], content, memory_bytes, kMeshResultFd, argv[4][0] == '1') &&
                     ::pwrite(kMeshResultFd, &limits, sizeof limits, offsetof(MeshHeader, limits)) == sizeof limits;
  ::_exit(whole ? 0 : 3);  // skips assimp's slow destructors
}

}  // namespace clearance

#if defined(CLEARANCE_ASAN)
// Crashes end the process by their signal, as without the sanitizer, which has its own memory limit.
extern "C" __attribute__((visibility("default"))) const char* __asan_default_options() {
  return "handle_segv=0:handle_abort=0:handle_sigbus=0:handle_sigfpe=0:hard_rss_limit_mb=4096:detect_leaks=0";
}
#endif
