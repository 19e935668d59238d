// A folder whose contents can only come from this user.
#pragma once

#include <string>

#include "engine/base/fd.h"

namespace clearance {

/// Opens the folder, and creates it and its parents if necessary (mode 0700).
///
/// Rejects a folder that another user owns or can write to, and a path through a link or folder of a user other than
/// this one and root, or through a world-writable folder (except sticky ones, such as /tmp). Returns no descriptor and
/// sets *why if the folder is rejected or cannot be created.
/// \param path absolute path
Fd open_private_folder(const std::string& path, std::string* why);

}  // namespace clearance
