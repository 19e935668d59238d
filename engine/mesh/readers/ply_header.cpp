#include "engine/mesh/readers/ply_header.h"

#include <utility>

#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

PlyType type_of(std::string_view name) {
  constexpr std::pair<std::string_view, PlyType> kTypes[] = {
      {"char", {PlyKind::kSigned, 1}},     {"int8", {PlyKind::kSigned, 1}},     {"uchar", {PlyKind::kUnsigned, 1}},
      {"uint8", {PlyKind::kUnsigned, 1}},  {"short", {PlyKind::kSigned, 2}},    {"int16", {PlyKind::kSigned, 2}},
      {"ushort", {PlyKind::kUnsigned, 2}}, {"uint16", {PlyKind::kUnsigned, 2}}, {"int", {PlyKind::kSigned, 4}},
      {"int32", {PlyKind::kSigned, 4}},    {"uint", {PlyKind::kUnsigned, 4}},   {"uint32", {PlyKind::kUnsigned, 4}},
      {"float", {PlyKind::kReal, 4}},      {"float32", {PlyKind::kReal, 4}},    {"double", {PlyKind::kReal, 8}},
      {"float64", {PlyKind::kReal, 8}}};
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  return {};
}

PlyProperty read_property(MeshText* line, const PlyElement& element) {
  PlyProperty property;
  std::string_view type = line->word_in_line();
  if ((property.is_list = type == "list")) {
    property.count = type_of(line->word_in_line());
    type = line->word_in_line();
  }
  property.type = type_of(type);
  property.name = line->word_in_line();
  if (property.type.size == 0 || (property.is_list && property.count.size == 0))
    fail_ply_header("a property of element " + element.name + " has no known type");
  if (property.is_list && property.count.kind == PlyKind::kReal)
    fail_ply_header("the length of a list of element " + element.name + " is not an integer");
  return property;
}

// Returns whether a line without a keyword is a comment, which some programs write without "comment". A misspelt
// property or element is not.
void check_note(std::string_view key, MeshText* line) {
  const std::string_view second = line->word_in_line(), third = line->word_in_line();
  const bool counts = !third.empty() && third.find_first_not_of("0123456789") == std::string_view::npos;
  const bool last = line->word_in_line().empty();
  if (type_of(second).size > 0 || second == "list" || (counts && last)) fail_ply_header("unexpected " + in_quotes(key));
}

PlyHeader::Format read_format(MeshText* line) {
  const std::string_view format = line->word_in_line();
  if (format == "ascii") return PlyHeader::Format::kText;
  if (format == "binary_little_endian") return PlyHeader::Format::kLittle;
  if (format == "binary_big_endian") return PlyHeader::Format::kBig;
  fail_ply_header("unknown format " + in_quotes(format) +
                  "; expected ascii, binary_little_endian or binary_big_endian");
}

PlyElement read_element(MeshText* line) {
  PlyElement element;
  element.name = std::string(line->word_in_line().substr(0, 40));
  const std::string_view count = line->word_in_line();
  if (count.empty() || count.size() > 19 || count.find_first_not_of("0123456789") != std::string_view::npos)
    fail_ply_header("element " + element.name + ": expected a count, got " + in_quotes(count));
  element.count = static_cast<std::uint64_t>(line->integer(count, "a count"));
  return element;
}

}  // namespace

[[noreturn]] void fail_ply_header(const std::string& what) {
  throw LoadError("its header: " + what);
}

PlyHeader read_ply_header(std::string_view file) {
  if (!file.starts_with("ply")) throw LoadError("not a PLY file: it does not begin with \"ply\"");
  PlyHeader header;
  bool format_known = false;
  for (bool first = true;; first = false) {
    const std::size_t end = file.find('\n', header.bytes);
    if (end == std::string_view::npos) throw LoadError("the file ends within its header: no \"end_header\"");
    MeshText line(file.substr(header.bytes, end - header.bytes));
    header.bytes = end + 1;
    const std::string_view key = line.word_in_line();
    if (first || key.empty() || key == "comment" || key == "obj_info") continue;
    if (key == "end_header") break;
    if (key == "format") {
      header.format = read_format(&line);
      format_known = true;
    } else if (key == "element") {
      PlyElement element = read_element(&line);
      for (const PlyElement& other : header.elements)
        if (other.name == element.name) fail_ply_header("element " + element.name + " comes twice");
      header.elements.push_back(std::move(element));
    } else if (key == "property" && !header.elements.empty()) {
      header.elements.back().properties.push_back(read_property(&line, header.elements.back()));
    } else if (key == "property") {
      fail_ply_header("a property comes before any element");
    } else {
      check_note(key, &line);
    }
  }
  if (!format_known) fail_ply_header("no format");
  return header;
}

}  // namespace clearance
