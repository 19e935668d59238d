// The header of a PLY file: elements, and the properties of their rows.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace clearance {

enum class PlyKind : std::uint8_t { kSigned, kUnsigned, kReal };

struct PlyType {
  PlyKind kind = PlyKind::kReal;
  std::size_t size = 0;  ///< bytes; 0 if there is no such type
};

struct PlyProperty {
  std::string name;
  bool is_list = false;
  PlyType count, type;  ///< of a list's length; of a number
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  /// Index of the property, or their number if there is none.
  std::size_t find(std::string_view wanted, bool is_list) const {
    const auto same = [&](const PlyProperty& p) { return p.name == wanted && p.is_list == is_list; };
    return static_cast<std::size_t>(std::find_if(properties.begin(), properties.end(), same) - properties.begin());
  }
};

struct PlyHeader {
  enum class Format { kText, kLittle, kBig } format = Format::kText;
  std::vector<PlyElement> elements;
  std::size_t bytes = 0;  ///< of the header
};

/// Throws LoadError naming the place.
PlyHeader read_ply_header(std::string_view file);
[[noreturn]] void fail_ply_header(const std::string& what);

}  // namespace clearance
