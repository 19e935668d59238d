// Data of a glTF 2.0 file: buffers, from the file itself, from its folder or in base64, and the accessors into them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/mesh/mesh_folder.h"
#include "engine/mesh/mesh_transform.h"
#include "engine/mesh/readers/gltf_document.h"

namespace clearance::gltf {

/// Each buffer is read once. Errors are LoadError.
class Accessors {
 public:
  /// \param chunk binary data behind the JSON, for a buffer without uri
  Accessors(const Document& document, std::optional<std::string_view> chunk, const MeshFolder& folder)
      : document_(document), chunk_(chunk), folder_(folder) {}

  /// Finite positions, exactly as stored.
  std::vector<Vec3d> positions(std::uint64_t index);
  /// Indices below `vertices`.
  std::vector<std::uint32_t> indices(std::uint64_t index, std::size_t vertices);
  /// One matrix for each joint of a skin; the identity if it has none.
  std::vector<MeshTransform> inverse_binds(const Json& skin, const std::string& where, std::size_t joints);

 private:
  struct Rows {  // of numbers in a buffer, checked to be complete
    std::string_view bytes;
    std::size_t stride = 0;
  };

  Rows rows(const Json& holder, const std::string& where, std::uint64_t count, std::size_t size);
  std::vector<std::uint32_t> index_rows(const Json& holder, const std::string& where, std::uint64_t count,
                                        std::uint64_t end);
  const std::string& buffer(std::uint64_t index);

  const Document& document_;
  std::optional<std::string_view> chunk_;
  const MeshFolder& folder_;
  std::map<std::uint64_t, std::string> buffers_;
  std::uint64_t buffer_bytes_ = 0, read_bytes_ = 0;
};

}  // namespace clearance::gltf
