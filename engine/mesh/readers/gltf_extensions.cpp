#include "engine/mesh/readers/gltf_extensions.h"

#include <algorithm>
#include <iterator>

namespace clearance {

namespace {

constexpr std::string_view kPrefixes[] = {
    "KHR_materials_", "ADOBE_materials_", "NV_materials_", "KHR_texture_", "EXT_texture_",
    "MSFT_texture_",  "KHR_lights_",      "EXT_lights_",   "KHR_audio",    "MSFT_audio",
    "KHR_xmp",        "KHR_physics_",     "OMI_",          "AGI_",         "VRM",
    "MOZ_",           "GOOGLE_"};
constexpr std::string_view kNames[] = {
    "KHR_animation_pointer",  // animations are not read
    "KHR_implicit_shapes",    // of colliders
    "KHR_interactivity",     "KHR_node_hoverability",   "KHR_node_selectability",
    "EXT_feature_metadata",  "EXT_instance_features",   "EXT_mesh_features",
    "EXT_mesh_manifold",     "EXT_structural_metadata", "CESIUM_primitive_outline",
    "FB_ngon_encoding",      "GODOT_single_root",       "MSFT_lod"};  // the node itself is the finest level

}  // namespace

bool keeps_geometry(std::string_view extension) {
  return std::any_of(std::begin(kPrefixes), std::end(kPrefixes),
                     [&](std::string_view prefix) { return extension.starts_with(prefix); }) ||
         std::find(std::begin(kNames), std::end(kNames), extension) != std::end(kNames);
}

}  // namespace clearance
