// The format of an input that is a mesh file, selected by its first byte.
#pragma once

#include <iterator>

#include "tests/fuzz/fuzz_target.h"

namespace clearance::fuzz {

inline constexpr const char* kMeshExtensions[] = {"obj", "stl", "ply", "off", "dae", "gltf", "glb", "3ds", "3mf", "ac",
                                                  "amf", "ase", "dxf", "fbx", "lwo", "raw",  "x",   "x3d", "xgl"};

inline const char* next_mesh_extension(Input& in) {
  return kMeshExtensions[in.number<std::uint8_t>() % std::size(kMeshExtensions)];
}

}  // namespace clearance::fuzz
