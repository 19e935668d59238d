// The process that reads one mesh file: limits first, then the file.
#pragma once

#include <cstdint>
#include <string>

namespace clearance {

/// Reads the file and writes its meshes, or what is wrong with it, to the descriptor. Whether the result is whole.
using ImportFile = bool (*)(const std::string& path, std::uint64_t memory_bytes, int result_fd);

/// main() of a loader, as mesh.cpp starts it: FILE MEMORY_BYTES CPU_SECONDS, descriptors as in mesh_format.h. Takes
/// limits of memory, time and system calls (loader_sandbox.h) upon itself, then has the file imported. Ends the
/// process.
int loader_main(int argc, char** argv, ImportFile import);

}  // namespace clearance
