// What can be seen to be wrong with a mesh file before assimp is asked: it hangs on, or silently loads a part of, files
// that end early.
#pragma once

#include <string>
#include <string_view>

namespace clearance {

/// What is wrong with the layout of a file; empty if nothing was noticed. Knows PLY, STL, GLB and DAE.
/// \param extension in lower case, without the dot. \param content the whole file.
std::string mesh_precheck(const std::string& extension, std::string_view content);

}  // namespace clearance
