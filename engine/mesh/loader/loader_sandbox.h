// System calls that the mesh loader may use.
#pragma once

#include <string>

namespace clearance {

/// Restricts this process for good to reading files, allocating memory, writing to open descriptors and exiting. Any
/// other system call (network, programs, processes, threads, files opened for writing, executable memory) ends the
/// process with an error that names the call.
///
/// Returns the reason why the kernel rejects such filters (too old, or forbidden in a container), or an empty text.
/// Throws std::runtime_error for any other failure.
/// \param result_fd receives the error (mesh_format.h)
std::string confine_loader(int result_fd);

}  // namespace clearance
