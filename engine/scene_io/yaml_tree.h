// The values of a YAML file with their lines, as parsed.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clearance {

enum class YamlKind : std::uint8_t { kNull, kScalar, kList, kMap };

struct YamlChild {
  std::uint32_t node;
  std::uint32_t line;
};

struct YamlNode {
  YamlKind kind = YamlKind::kNull;
  bool quoted = false;
  std::string scalar;
  std::vector<YamlChild> children;  ///< of a map: key, value, key, value, ...
};

struct YamlTree {
  std::string file;
  std::vector<YamlNode> nodes;      ///< the first is the root
  mutable std::uint64_t reads = 0;  ///< values read so far, aliases counted at each use
  mutable std::vector<std::string> warnings;
};

/// Reads and parses a file of one document, bounded in bytes, values and depth. Throws SceneError.
std::shared_ptr<const YamlTree> read_yaml_tree(const std::string& path);

/// Throws SceneError "file:line: message".
[[noreturn]] void fail_at(const std::string& file, int line, const std::string& message);

}  // namespace clearance
