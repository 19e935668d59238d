// Mesh formats by file extension: the project's own readers, and those of assimp.
#pragma once

#include <string_view>

namespace clearance {

/// Formats with a reader of their own; DAE goes through assimp after a check of the file (mesh_dae.h).
inline constexpr std::string_view kOwnFormats[] = {"obj", "stl", "ply", "off", "dae", "gltf", "glb"};

/// A format that assimp alone reads (mesh_assimp.h).
struct AssimpFormat {
  std::string_view extension;
  bool is_turned = false;      ///< assimp turns (x, y, z) to (x, z, -y), which the reader undoes
  bool inverts_nodes = false;  ///< assimp multiplies positions by the inverse of their node's matrix
};

/// Left out of assimp's list: motions without a mesh (bvh, csm, vta, md5anim, md5camera, mot), curved solids that
/// assimp approximates (ifc, step, nff), subdivision cages and modifiers that it does not apply (blend, sib, ndo),
/// height maps (hmp, ter), scenes made of other files (irr, lws, bsp, pk3, uc, 3d, mesh), units that it drops (cob,
/// ogex), its own memory image (assbin), and formats that it reads badly or not at all (irrmesh, lxo, pmx, q3s, scn,
/// x3db).
inline constexpr AssimpFormat kAssimpFormats[] = {{"3ds", true, true},
                                                  {"3mf"},
                                                  {"ac"},
                                                  {"ac3d"},
                                                  {"acc"},
                                                  {"amf"},
                                                  {"ase", true, true},
                                                  {"b3d"},
                                                  {"dxf", true},
                                                  {"fbx"},
                                                  {"iqm", true},
                                                  {"lwo"},
                                                  {"md2", true},
                                                  {"md3", true},
                                                  {"md5mesh", true},
                                                  {"mdc", true},
                                                  {"mdl", true},
                                                  {"ms3d"},
                                                  {"q3o"},
                                                  {"raw"},
                                                  {"smd"},
                                                  {"x"},
                                                  {"x3d"},
                                                  {"xgl"},
                                                  {"zgl"}};

/// The format of an extension in lower case, or null.
constexpr const AssimpFormat* find_assimp_format(std::string_view extension) {
  for (const AssimpFormat& format : kAssimpFormats)
    if (format.extension == extension) return &format;
  return nullptr;
}

}  // namespace clearance
