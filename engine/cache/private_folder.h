// A folder that nobody but this user can have put anything into.
#pragma once

#include <string>

#include "engine/base/fd.h"

namespace clearance {

/// Opens the folder, which is made (mode 0700, and so are folders above it) if it is not there.
///
/// Refused: a folder that somebody else owns or may write to; a path that leads through a link or folder of somebody
/// else than this user and root, or through a folder that everybody may write to (except sticky ones, such as /tmp).
/// \param path absolute. Returns no descriptor and sets *why if it is refused or cannot be made.
Fd open_private_folder(const std::string& path, std::string* why);

}  // namespace clearance
