// The process that reads one mesh file: limits first, then the file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace clearance {

/// Makes meshes of a file's content, or says what is wrong with it, and writes that to the descriptor. Whether the
/// result is whole. \param path of the file: its name says the format, and its folder holds other files that it may
/// name.
/// \param as_heights an array of numbers (NPY) is a grid of heights, not rows of points.
using ImportFile = bool (*)(const std::string& path, std::string_view content, std::uint64_t memory_bytes,
                            int result_fd, bool as_heights);

/// main() of a loader, as mesh.cpp starts it: FILE MEMORY_BYTES CPU_SECONDS AS_HEIGHTS (0 or 1), descriptors as in
/// mesh_format.h. Takes limits of memory, time and system calls (loader_sandbox.h) upon itself, then has the file
/// imported. Ends the process.
int loader_main(int argc, char** argv, ImportFile import);

}  // namespace clearance
