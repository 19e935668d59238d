// Files in a zip archive, by minizip, which assimp uses as well.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace clearance {

/// The files of an archive whose names end in `suffix`, case aside; none if the bytes are no archive. Throws LoadError
/// for one that cannot be unpacked.
std::vector<std::string> zip_entries(std::string_view archive, std::string_view suffix);

}  // namespace clearance
