// Extensions of glTF that a reader of geometry may ignore.
#pragma once

#include <string_view>

namespace clearance {

/// Returns whether an extension leaves the geometry unchanged, as for materials, sounds, lights and metadata.
bool keeps_geometry(std::string_view extension);

}  // namespace clearance
