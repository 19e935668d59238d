// What the process that reads mesh files may still ask of the kernel.
#pragma once

#include <string>

namespace clearance {

/// From here on this process may read files, take memory, write to descriptors that it has and end: no network, no
/// other program, no process or thread of its own, no file created or opened for writing, no code made from data. The
/// first call beyond that ends it: its result says which call, and it exits. For good: nothing can take the filter
/// away.
///
/// Returns why the kernel refuses such filters (too old, or a container that forbids them), and an empty text if it is
/// in force. Throws std::runtime_error if it cannot be had for any other reason.
/// \param result_fd where the words of the end are written (mesh_format.h).
std::string confine_loader(int result_fd);

}  // namespace clearance
