#include "mesh_precheck.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

namespace clearance {

namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

bool is_space(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r');
}

// Whitespace-separated words, front to back.
class Words {
 public:
  explicit Words(std::string_view text) : text_(text) {}
  /// Empty at the end.
  std::string_view next() {
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
    const std::size_t begin = at_;
    while (at_ < text_.size() && !is_space(text_[at_])) ++at_;
    return text_.substr(begin, at_ - begin);
  }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
};

bool parse(std::string_view text, std::uint64_t* out) {
  const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), *out);
  return error == std::errc() && rest == text.data() + text.size();
}

// A little-endian unsigned number of up to 8 bytes; big-endian on request.
std::uint64_t unsigned_at(std::string_view bytes, std::size_t at, std::size_t size, bool big_endian = false) {
  std::uint64_t x = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint64_t byte = static_cast<unsigned char>(bytes[at + i]);
    x |= byte << 8 * (big_endian ? size - 1 - i : i);
  }
  return x;
}

// --- PLY -------------------------------------------------------------------------------------------------------------

struct PlyProperty {
  bool is_list = false;
  std::size_t count_size = 0;  // bytes of a list's length
  std::size_t size = 0;        // bytes of a number
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
};

std::size_t ply_size(std::string_view type) {
  constexpr std::pair<std::string_view, std::size_t> kSizes[] = {
      {"char", 1},  {"uchar", 1},  {"short", 2},   {"ushort", 2}, {"int", 4},   {"uint", 4},
      {"float", 4}, {"double", 8}, {"int8", 1},    {"uint8", 1},  {"int16", 2}, {"uint16", 2},
      {"int32", 4}, {"uint32", 4}, {"float32", 4}, {"float64", 8}};
  for (const auto& [name, size] : kSizes)
    if (name == type) return size;
  return 0;
}

std::string ends_within(const PlyElement& element, std::uint64_t i) {
  return "the file ends within " + element.name + " " + std::to_string(i) + " of the " + std::to_string(element.count) +
         " that its header promises";
}

std::string check_ply_text(const std::vector<PlyElement>& elements, std::string_view body) {
  Words words(body);
  for (const PlyElement& element : elements)
    for (std::uint64_t i = 0; !element.properties.empty() && i < element.count; ++i)
      for (const PlyProperty& property : element.properties) {
        const std::string_view word = words.next();
        if (word.empty()) return ends_within(element, i);
        std::uint64_t length = 0;
        if (property.is_list && !parse(word, &length))
          return element.name + " " + std::to_string(i) + ": expected the length of a list, got \"" +
                 std::string(word.substr(0, 40)) + '"';
        for (std::uint64_t k = 0; k < length; ++k)
          if (words.next().empty()) return ends_within(element, i);
      }
  return "";
}

std::string check_ply_binary(const std::vector<PlyElement>& elements, std::string_view body, bool big_endian) {
  std::size_t at = 0;
  for (const PlyElement& element : elements) {
    const bool any_list =
        std::any_of(element.properties.begin(), element.properties.end(), [](const auto& p) { return p.is_list; });
    if (!any_list) {
      std::size_t row = 0;
      for (const PlyProperty& p : element.properties) row += p.size;
      if (row == 0) continue;
      const std::uint64_t fit = (body.size() - at) / row;
      if (element.count > fit) return ends_within(element, fit);
      at += element.count * row;
      continue;
    }
    for (std::uint64_t i = 0; i < element.count; ++i)
      for (const PlyProperty& p : element.properties) {
        std::uint64_t length = 1;
        if (p.is_list) {
          if (body.size() - at < p.count_size) return ends_within(element, i);
          length = unsigned_at(body, at, p.count_size, big_endian);
          at += p.count_size;
        }
        if ((body.size() - at) / p.size < length) return ends_within(element, i);
        at += length * p.size;
      }
  }
  return "";
}

std::string check_ply(std::string_view file) {
  if (file.substr(0, 3) != "ply") return "not a PLY file: it does not begin with \"ply\"";
  std::vector<PlyElement> elements;
  std::string format;
  std::size_t at = 0;
  for (bool first = true;; first = false) {
    const std::size_t end = file.find('\n', at);
    if (end == std::string_view::npos) return "the file ends within its header: no \"end_header\"";
    Words words(file.substr(at, end - at));
    at = end + 1;
    const std::string_view key = words.next();
    if (first || key.empty() || key == "comment" || key == "obj_info") continue;
    if (key == "end_header") break;
    if (key == "format") {
      format = words.next();
    } else if (key == "element") {
      PlyElement element;
      element.name = std::string(words.next().substr(0, 40));
      if (const std::string_view count = words.next(); !parse(count, &element.count))
        return "its header: element " + element.name + ": expected a count, got \"" + std::string(count.substr(0, 40)) +
               '"';
      elements.push_back(std::move(element));
    } else if (key == "property" && !elements.empty()) {
      PlyProperty property;
      std::string_view type = words.next();
      if ((property.is_list = type == "list")) {
        property.count_size = ply_size(words.next());
        type = words.next();
      }
      property.size = ply_size(type);
      if (property.size == 0 || (property.is_list && property.count_size == 0))
        return "its header: a property of element " + elements.back().name + " has no known type";
      elements.back().properties.push_back(property);
    } else {
      return "its header: unexpected \"" + std::string(key.substr(0, 40)) + '"';
    }
  }
  const std::string_view body = file.substr(at);
  if (format == "ascii") return check_ply_text(elements, body);
  if (format == "binary_little_endian" || format == "binary_big_endian")
    return check_ply_binary(elements, body, format == "binary_big_endian");
  return "its header: unknown format \"" + format.substr(0, 40) +
         "\"; expected ascii, binary_little_endian or binary_big_endian";
}

// --- STL -------------------------------------------------------------------------------------------------------------

std::string check_stl(std::string_view file) {
  constexpr std::size_t kHeader = 84, kFacet = 50;
  const std::uint64_t facets = file.size() >= kHeader ? unsigned_at(file, 80, 4) : 0;
  if (file.size() >= kHeader && file.size() == kHeader + kFacet * facets) return "";
  std::size_t begin = 0;
  while (begin < file.size() && is_space(file[begin])) ++begin;
  const bool text = lower(file.substr(begin, 5)) == "solid" && file.find('\0') == std::string_view::npos;
  if (!text)
    return file.size() < kHeader
               ? "the file has " + std::to_string(file.size()) + " bytes, less than the header of a binary STL file"
               : "its header promises " + std::to_string(facets) + " facets (" +
                     std::to_string(kHeader + kFacet * facets) + " bytes), the file has " +
                     std::to_string(file.size()) + " bytes";
  const std::string tail = lower(file.substr(file.size() - std::min<std::size_t>(file.size(), 4096)));
  const std::size_t end = tail.rfind("endsolid"), facet = tail.rfind("vertex");
  if (end == std::string::npos || (facet != std::string::npos && facet > end))
    return "the file ends early: no \"endsolid\" at its end";
  return "";
}

// --- GLB -------------------------------------------------------------------------------------------------------------

std::string check_glb(std::string_view file) {
  if (file.substr(0, 4) != "glTF") return "not a GLB file: it does not begin with \"glTF\"";
  if (file.size() < 20) return "the file ends within its header";
  const std::uint64_t version = unsigned_at(file, 4, 4), length = unsigned_at(file, 8, 4);
  if (version != 2) return "version " + std::to_string(version) + " of GLB; expected 2";
  if (length > file.size())
    return "its header promises " + std::to_string(length) + " bytes, the file has " + std::to_string(file.size());
  for (std::size_t at = 12; at < length;) {
    if (length - at < 8) return "the file ends within a chunk's header";
    const std::uint64_t chunk = unsigned_at(file, at, 4);
    if (chunk > length - at - 8) return "a chunk of " + std::to_string(chunk) + " bytes goes past the end of the file";
    at += 8 + chunk;
  }
  return "";
}

// --- DAE -------------------------------------------------------------------------------------------------------------

// assimp reads a negative index as 0.
std::string check_dae(std::string_view file) {
  for (std::size_t at = 0; (at = file.find("<p", at)) != std::string_view::npos; at += 2) {
    const std::size_t begin = file.find('>', at);
    if (begin == std::string_view::npos || begin != at + 2) continue;  // <param, <polylist, ...
    const std::string_view indices = file.substr(begin, std::min(file.find('<', begin), file.size()) - begin);
    if (indices.find('-') != std::string_view::npos) return "a face has a negative index";
  }
  return "";
}

}  // namespace

std::string mesh_precheck(const std::string& extension, std::string_view content) {
  if (extension == "ply") return check_ply(content);
  if (extension == "stl") return check_stl(content);
  if (extension == "glb") return check_glb(content);
  if (extension == "dae") return check_dae(content);
  return "";
}

}  // namespace clearance
