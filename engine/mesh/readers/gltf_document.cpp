#include "engine/mesh/readers/gltf_document.h"

#include <algorithm>
#include <iterator>

#include "engine/mesh/mesh_text.h"

namespace clearance::gltf {

namespace {

// Limit of counts and sizes in bytes; sums and products of two of them do not overflow.
constexpr std::uint64_t kMostOfAnything = std::uint64_t{1} << 31;

// Extensions that leave the geometry unchanged, as for materials, sounds, lights and metadata.
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

bool keeps_geometry(std::string_view extension) {
  return std::any_of(std::begin(kPrefixes), std::end(kPrefixes),
                     [&](std::string_view prefix) { return extension.starts_with(prefix); }) ||
         std::find(std::begin(kNames), std::end(kNames), extension) != std::end(kNames);
}

}  // namespace

[[noreturn]] void fail(const std::string& what) {
  throw LoadError("glTF: " + what);
}

std::string place(const char* list, std::uint64_t i) {
  return std::string(list) + '[' + std::to_string(i) + ']';
}

const Json* find(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto at = object.find(key);
  return at == object.end() ? nullptr : &*at;
}

std::uint64_t unsigned_in(const Json& object, const char* key, const std::string& where,
                          std::optional<std::uint64_t> otherwise) {
  const Json* value = find(object, key);
  if (!value && otherwise) return *otherwise;
  if (!value) fail(where + " has no \"" + key + '"');
  if (value->is_number_unsigned() && value->get<std::uint64_t>() <= kMostOfAnything) return value->get<std::uint64_t>();
  // Some programs write 3.0.
  if (value->is_number_float() && value->get<double>() >= 0 && value->get<double>() <= double(kMostOfAnything) &&
      std::floor(value->get<double>()) == value->get<double>())
    return static_cast<std::uint64_t>(value->get<double>());
  fail(where + '.' + key + ": expected a count or index, got " + value->dump().substr(0, 40));
}

void check_extensions(const Json& object, const std::string& where, std::initializer_list<std::string_view> changing) {
  const Json* extensions = find(object, "extensions");
  if (!extensions) return;
  if (!extensions->is_object()) fail(where + ".extensions: expected an object");
  for (const auto& [name, value] : extensions->items()) {
    const bool changes = changing.size() == 0 ? !keeps_geometry(name)
                                              : std::find(changing.begin(), changing.end(), name) != changing.end();
    if (changes) fail(where + " has the extension " + name.substr(0, 60) + ", which is not read");
  }
}

Document::Document(std::string_view json) {
  try {
    root_ = Json::parse(json.begin(), json.end());
  } catch (const Json::exception& e) {
    const std::string text = e.what();
    fail("invalid JSON: " + text.substr(text.find("] ") == std::string::npos ? 0 : text.find("] ") + 2, 200));
  }
  const Json* asset = find(root_, "asset");
  const Json* version = asset ? find(*asset, "version") : nullptr;
  if (!version || !version->is_string()) fail("no asset.version");
  if (const std::string v = version->get<std::string>(); !v.starts_with("2."))
    fail("version " + in_quotes(v) + "; expected 2.0");
  check_required();
  check_extensions(root_, "the file", {"CESIUM_RTC"});
}

const Json& Document::entry(const char* list, std::uint64_t i) const {
  const Json* all = find(root_, list);
  const std::size_t count = all && all->is_array() ? all->size() : 0;
  if (i >= count) fail(place(list, i) + " is named, and there are " + std::to_string(count));
  check_extensions((*all)[i], place(list, i));
  return (*all)[i];
}

// glTF 2.0, 3.12: a reader that does not know a required extension must fail.
void Document::check_required() const {
  const Json* required = find(root_, "extensionsRequired");
  if (!required) return;
  if (!required->is_array()) fail("extensionsRequired: expected a list");
  for (const Json& name : *required) {
    if (!name.is_string()) fail("extensionsRequired: expected names");
    if (!keeps_geometry(name.get_ref<const std::string&>()))
      fail("it needs the extension " + name.get<std::string>().substr(0, 60) + ", which is not read");
  }
}

}  // namespace clearance::gltf
