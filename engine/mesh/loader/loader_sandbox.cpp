#include "engine/mesh/loader/loader_sandbox.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>

#include "engine/base/call_filter.h"
#include "engine/mesh/mesh_format.h"

namespace clearance {

namespace {

int result_fd_of_handler = -1;

[[noreturn]] void report_forbidden_call(int call) {
  char text[160];
  std::snprintf(text, sizeof text,
                "reading it was stopped: the mesh loader made system call %d, which no mesh file needs; is the "
                "file hostile?",
                call);
  const bool written = write_mesh_error(result_fd_of_handler, MeshState::kError, text);
  ::_exit(written ? 0 : 4);
}

}  // namespace

std::string confine_loader(int result_fd) {
  result_fd_of_handler = result_fd;
  CallFilter filter("the mesh loader");
  // Reading files and their properties. The loader itself opens only files of one folder.
  constexpr unsigned kWrites = O_WRONLY | O_RDWR | O_CREAT | O_TRUNC | O_APPEND | (O_TMPFILE & ~O_DIRECTORY);
  filter.allow(SCMP_SYS(openat), SCMP_A2(SCMP_CMP_MASKED_EQ, kWrites, 0));
  filter.allow(SCMP_SYS(open), SCMP_A1(SCMP_CMP_MASKED_EQ, kWrites, 0));
  filter.allow_each({SCMP_SYS(read),       SCMP_SYS(readv),      SCMP_SYS(pread64),  SCMP_SYS(lseek),
                     SCMP_SYS(_llseek),    SCMP_SYS(close),      SCMP_SYS(stat),     SCMP_SYS(stat64),
                     SCMP_SYS(lstat),      SCMP_SYS(lstat64),    SCMP_SYS(fstat),    SCMP_SYS(fstat64),
                     SCMP_SYS(newfstatat), SCMP_SYS(fstatat64),  SCMP_SYS(statx),    SCMP_SYS(access),
                     SCMP_SYS(faccessat),  SCMP_SYS(faccessat2), SCMP_SYS(readlink), SCMP_SYS(readlinkat),
                     SCMP_SYS(getcwd)});
  // Writing the result. Descriptors of files are read-only.
  filter.allow_each({SCMP_SYS(write), SCMP_SYS(pwrite64), SCMP_SYS(ftruncate)});
  return filter.enforce(report_forbidden_call);
}

}  // namespace clearance
