// Extensions of glTF that a reader of geometry may pass over.
#pragma once

#include <string_view>

namespace clearance {

/// Whether the geometry of a file is the same without an extension: looks, sounds, lights and metadata.
bool keeps_geometry(std::string_view extension);

}  // namespace clearance
