// PLY: a header with the layout of rows, then rows of numbers as text or bytes.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include "engine/mesh/mesh_bytes.h"
#include "engine/mesh/mesh_faces.h"
#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

enum class Kind : std::uint8_t { kSigned, kUnsigned, kReal };

struct Type {
  Kind kind = Kind::kReal;
  std::size_t size = 0;  // bytes; 0 if there is no such type
};

Type type_of(std::string_view name) {
  constexpr std::pair<std::string_view, Type> kTypes[] = {
      {"char", {Kind::kSigned, 1}},     {"int8", {Kind::kSigned, 1}},     {"uchar", {Kind::kUnsigned, 1}},
      {"uint8", {Kind::kUnsigned, 1}},  {"short", {Kind::kSigned, 2}},    {"int16", {Kind::kSigned, 2}},
      {"ushort", {Kind::kUnsigned, 2}}, {"uint16", {Kind::kUnsigned, 2}}, {"int", {Kind::kSigned, 4}},
      {"int32", {Kind::kSigned, 4}},    {"uint", {Kind::kUnsigned, 4}},   {"uint32", {Kind::kUnsigned, 4}},
      {"float", {Kind::kReal, 4}},      {"float32", {Kind::kReal, 4}},    {"double", {Kind::kReal, 8}},
      {"float64", {Kind::kReal, 8}}};
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  return {};
}

struct Property {
  std::string name;
  bool is_list = false;
  Type count, type;  // of a list's length; of a number
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;

  /// Index of the property, or their number if there is none.
  std::size_t find(std::string_view wanted, bool is_list) const {
    const auto same = [&](const Property& p) { return p.name == wanted && p.is_list == is_list; };
    return static_cast<std::size_t>(std::find_if(properties.begin(), properties.end(), same) - properties.begin());
  }
};

[[noreturn]] void fail_header(const std::string& what) {
  throw LoadError("its header: " + what);
}

struct Header {
  enum class Format { kText, kLittle, kBig } format = Format::kText;
  std::vector<Element> elements;
  std::size_t bytes = 0;  ///< of the header
};

Property read_property(MeshText* line, const Element& element) {
  Property property;
  std::string_view type = line->word_in_line();
  if ((property.is_list = type == "list")) {
    property.count = type_of(line->word_in_line());
    type = line->word_in_line();
  }
  property.type = type_of(type);
  property.name = line->word_in_line();
  if (property.type.size == 0 || (property.is_list && property.count.size == 0))
    fail_header("a property of element " + element.name + " has no known type");
  if (property.is_list && property.count.kind == Kind::kReal)
    fail_header("the length of a list of element " + element.name + " is not an integer");
  return property;
}

// Returns whether a line without a keyword is a comment, which some programs write without "comment". A misspelt
// property or element is not.
void check_note(std::string_view key, MeshText* line) {
  const std::string_view second = line->word_in_line(), third = line->word_in_line();
  const bool counts = !third.empty() && third.find_first_not_of("0123456789") == std::string_view::npos;
  const bool last = line->word_in_line().empty();
  if (type_of(second).size > 0 || second == "list" || (counts && last)) fail_header("unexpected " + in_quotes(key));
}

Header read_header(std::string_view file) {
  if (!file.starts_with("ply")) throw LoadError("not a PLY file: it does not begin with \"ply\"");
  Header header;
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
      const std::string_view format = line.word_in_line();
      format_known = true;
      if (format == "ascii")
        header.format = Header::Format::kText;
      else if (format == "binary_little_endian")
        header.format = Header::Format::kLittle;
      else if (format == "binary_big_endian")
        header.format = Header::Format::kBig;
      else
        fail_header("unknown format " + in_quotes(format) +
                    "; expected ascii, binary_little_endian or binary_big_endian");
    } else if (key == "element") {
      Element element;
      element.name = std::string(line.word_in_line().substr(0, 40));
      const std::string_view count = line.word_in_line();
      if (count.empty() || count.size() > 19 || count.find_first_not_of("0123456789") != std::string_view::npos)
        fail_header("element " + element.name + ": expected a count, got " + in_quotes(count));
      element.count = static_cast<std::uint64_t>(line.integer(count, "a count"));
      for (const Element& other : header.elements)
        if (other.name == element.name) fail_header("element " + element.name + " comes twice");
      header.elements.push_back(std::move(element));
    } else if (key == "property" && !header.elements.empty()) {
      header.elements.back().properties.push_back(read_property(&line, header.elements.back()));
    } else if (key == "property") {
      fail_header("a property comes before any element");
    } else {
      check_note(key, &line);
    }
  }
  if (!format_known) fail_header("no format");
  return header;
}

// Sequential numbers of the body, as text or bytes.
class Body {
 public:
  Body(std::string_view file, const Header& header)
      : format_(header.format), text_(file), bytes_(file), at_(header.bytes) {
    if (format_ == Header::Format::kText) text_.go_to(header.bytes);
  }

  void begin(const Element& element, std::uint64_t row) {
    element_ = &element;
    row_ = row;
  }
  double real(Type type) {
    if (format_ == Header::Format::kText) return text_.number(word(), "a number");
    const std::size_t at = take(type.size);
    const bool big = format_ == Header::Format::kBig;
    if (type.kind == Kind::kReal)
      return type.size == 8 ? real_at<double>(bytes_, at, big) : real_at<float>(bytes_, at, big);
    return static_cast<double>(integer_at(type, at));
  }
  std::int64_t integer(Type type, const char* what) {
    if (format_ == Header::Format::kText) return text_.integer(word(), what);
    const std::size_t at = take(type.size);
    if (type.kind == Kind::kReal) fail(std::string("expected ") + what + ", got a float");
    return integer_at(type, at);
  }
  void skip(Type type, std::uint64_t count) {
    if (format_ != Header::Format::kText) {
      if (count > left() / type.size) fail_early();
      at_ += count * type.size;
      return;
    }
    for (std::uint64_t k = 0; k < count; ++k) word();
  }
  /// Returns the length of a list, checked against the size of the file.
  std::uint64_t length(const Property& p) {
    const std::int64_t n = integer(p.count, "the length of a list");
    if (n < 0) fail("a list of length " + std::to_string(n));
    if (static_cast<std::uint64_t>(n) > left()) fail_early();
    return static_cast<std::uint64_t>(n);
  }
  [[noreturn]] void fail(const std::string& what) const {
    const std::string place = element_->name + ' ' + std::to_string(row_) + ": ";
    if (format_ == Header::Format::kText) text_.fail(place + what);
    throw LoadError(place + what);
  }

  /// Place of the last face: its offset in a text file, else its row.
  std::size_t place_of_face(std::uint64_t row) const {
    return format_ == Header::Format::kText ? text_.place() : static_cast<std::size_t>(row);
  }
  [[noreturn]] void fail_face(std::size_t place, const std::string& what) const {
    if (format_ == Header::Format::kText) text_.fail_at(place, what);
    throw LoadError("face " + std::to_string(place) + ": " + what);
  }

 private:
  std::string_view word() {
    const std::string_view w = text_.word();
    if (w.empty()) fail_early();
    return w;
  }
  std::size_t left() const { return format_ == Header::Format::kText ? text_.rest().size() : bytes_.size() - at_; }
  std::size_t take(std::size_t size) {
    if (left() < size) fail_early();
    return std::exchange(at_, at_ + size);
  }
  std::int64_t integer_at(Type type, std::size_t at) const {
    const std::uint64_t bits = unsigned_at(bytes_, at, type.size, format_ == Header::Format::kBig);
    const int unused = 64 - 8 * static_cast<int>(type.size);
    if (type.kind == Kind::kUnsigned) return static_cast<std::int64_t>(bits);
    return static_cast<std::int64_t>(bits << unused) >> unused;
  }
  [[noreturn]] void fail_early() const {
    throw LoadError("the file ends within " + element_->name + ' ' + std::to_string(row_) + " of the " +
                    std::to_string(element_->count) + " that its header promises");
  }

  Header::Format format_;
  MeshText text_;
  std::string_view bytes_;
  std::size_t at_;
  const Element* element_ = nullptr;
  std::uint64_t row_ = 0;
};

class PlyReader {
 public:
  explicit PlyReader(std::string_view file) : header_(read_header(file)), body_(file, header_) {}

  MeshPart read() {
    for (const Element& element : header_.elements) {
      if (element.properties.empty()) continue;  // rows are empty
      if (element.name == "vertex")
        read_vertices(element);
      else
        read_others(element);
    }
    if (!vertices_) fail_header("no element \"vertex\"");
    // Triangles of strips come first; files with strips rarely have faces.
    const std::vector<Triangle> faces =
        faces_.take_triangles(part_.positions, &part_.rounding,
                              [this](std::size_t place, const std::string& what) { body_.fail_face(place, what); });
    part_.triangles.insert(part_.triangles.end(), faces.begin(), faces.end());
    return std::move(part_);
  }

 private:
  void read_vertices(const Element& element) {
    vertices_ = &element;
    std::size_t column[3];
    for (int k = 0; k < 3; ++k) {
      const std::string name(1, static_cast<char>('x' + k));
      column[k] = element.find(name, false);
      if (column[k] == element.properties.size()) fail_header("element vertex has no property \"" + name + '"');
    }
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body_.begin(element, i);
      Vec3d p{0, 0, 0};
      for (std::size_t c = 0; c < element.properties.size(); ++c) {
        const int axis = static_cast<int>(std::find(column, column + 3, c) - column);
        if (axis == 3)
          skip(element.properties[c]);
        else
          p[axis] = body_.real(element.properties[c].type);
      }
      if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) body_.fail("a coordinate is not finite");
      part_.positions.push_back(p);
    }
  }

  void skip(const Property& p) { body_.skip(p.type, p.is_list ? body_.length(p) : 1); }

  // Faces, strips of triangles, and elements without geometry.
  void read_others(const Element& element) {
    const bool strips = element.name == "tristrips";
    std::size_t list = element.properties.size();
    if (strips || element.name == "face") {
      list = std::min(element.find("vertex_indices", true), element.find("vertex_index", true));
      if (list == element.properties.size())
        fail_header("element " + element.name + " has no list \"vertex_indices\" or \"vertex_index\"");
    }
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body_.begin(element, i);
      for (std::size_t c = 0; c < element.properties.size(); ++c)
        if (c != list)
          skip(element.properties[c]);
        else if (strips)
          read_strip(element.properties[c]);
        else
          read_face(element.properties[c], i);
    }
  }

  std::uint32_t corner(std::int64_t index) const {
    const auto& elements = header_.elements;
    const auto vertex =
        std::find_if(elements.begin(), elements.end(), [](const Element& e) { return e.name == "vertex"; });
    const std::uint64_t count = vertex == elements.end() ? 0 : vertex->count;
    if (index < 0 || static_cast<std::uint64_t>(index) >= count || index >= std::numeric_limits<std::uint32_t>::max())
      body_.fail("it names vertex " + std::to_string(index) + ", and there are " + std::to_string(count) + ", from 0");
    return static_cast<std::uint32_t>(index);
  }

  void read_face(const Property& p, std::uint64_t row) {
    corners_.clear();
    for (std::uint64_t n = body_.length(p); n > 0; --n)
      corners_.push_back(corner(body_.integer(p.type, "the index of a vertex")));
    faces_.add(corners_, body_.place_of_face(row));
  }

  // A strip ends at -1.
  void read_strip(const Property& p) {
    corners_.clear();
    for (std::uint64_t n = body_.length(p); n > 0; --n) {
      const std::int64_t index = body_.integer(p.type, "the index of a vertex");
      if (index == -1) {
        corners_.clear();
        continue;
      }
      corners_.push_back(corner(index));
      const std::size_t k = corners_.size();
      if (k < 3) continue;
      const bool odd = k % 2 == 0;
      part_.triangles.push_back({corners_[odd ? k - 2 : k - 3], corners_[odd ? k - 3 : k - 2], corners_[k - 1]});
    }
  }

  Header header_;
  Body body_;
  const Element* vertices_ = nullptr;
  MeshPart part_;
  FaceList faces_;
  std::vector<std::uint32_t> corners_;
};

}  // namespace

void read_ply(std::string_view content, const PartSink& sink) {
  sink(PlyReader(content).read());
}

}  // namespace clearance
