// Entry point of the process that reads one mesh file under limits.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace clearance {

/// Writes the meshes of a file, or an error, to the descriptor. Returns whether the result is complete.
/// \param path of the file; selects the format by its extension, and the folder of other files that it names
/// \param as_heights reads an array of numbers (NPY) as a grid of heights, not as rows of points
using ImportFile = bool (*)(const std::string& path, std::string_view content, std::uint64_t memory_bytes,
                            int result_fd, bool as_heights);

/// main() of a loader. Limits its own memory, time and system calls (loader_sandbox.h), imports the file and exits.
/// mesh.cpp passes FILE MEMORY_BYTES CPU_SECONDS AS_HEIGHTS (0 or 1) and the descriptors of mesh_format.h.
int loader_main(int argc, char** argv, ImportFile import);

}  // namespace clearance
