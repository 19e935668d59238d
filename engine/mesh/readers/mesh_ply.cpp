// PLY: after the header, rows of numbers as text or bytes.
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
#include "engine/mesh/readers/ply_header.h"

namespace clearance {

namespace {

// Sequential numbers of the body, as text or bytes.
class Body {
 public:
  Body(std::string_view file, const PlyHeader& header)
      : format_(header.format), text_(file), bytes_(file), at_(header.bytes) {
    if (format_ == PlyHeader::Format::kText) text_.go_to(header.bytes);
  }

  void begin(const PlyElement& element, std::uint64_t row) {
    element_ = &element;
    row_ = row;
  }
  double real(PlyType type) {
    if (format_ == PlyHeader::Format::kText) return text_.number(word(), "a number");
    const std::size_t at = take(type.size);
    const bool big = format_ == PlyHeader::Format::kBig;
    if (type.kind == PlyKind::kReal)
      return type.size == 8 ? real_at<double>(bytes_, at, big) : real_at<float>(bytes_, at, big);
    return static_cast<double>(integer_at(type, at));
  }
  std::int64_t integer(PlyType type, const char* what) {
    if (format_ == PlyHeader::Format::kText) return text_.integer(word(), what);
    const std::size_t at = take(type.size);
    if (type.kind == PlyKind::kReal) fail(std::string("expected ") + what + ", got a float");
    return integer_at(type, at);
  }
  void skip(PlyType type, std::uint64_t count) {
    if (format_ != PlyHeader::Format::kText) {
      if (count > left() / type.size) fail_early();
      at_ += count * type.size;
      return;
    }
    for (std::uint64_t k = 0; k < count; ++k) word();
  }
  /// Returns the length of a list, checked against the size of the file.
  std::uint64_t length(const PlyProperty& p) {
    const std::int64_t n = integer(p.count, "the length of a list");
    if (n < 0) fail("a list of length " + std::to_string(n));
    if (static_cast<std::uint64_t>(n) > left()) fail_early();
    return static_cast<std::uint64_t>(n);
  }
  [[noreturn]] void fail(const std::string& what) const {
    const std::string place = element_->name + ' ' + std::to_string(row_) + ": ";
    if (format_ == PlyHeader::Format::kText) text_.fail(place + what);
    throw LoadError(place + what);
  }

  /// Place of the last face: its offset in a text file, else its row.
  std::size_t place_of_face(std::uint64_t row) const {
    return format_ == PlyHeader::Format::kText ? text_.place() : static_cast<std::size_t>(row);
  }
  [[noreturn]] void fail_face(std::size_t place, const std::string& what) const {
    if (format_ == PlyHeader::Format::kText) text_.fail_at(place, what);
    throw LoadError("face " + std::to_string(place) + ": " + what);
  }

 private:
  std::string_view word() {
    const std::string_view w = text_.word();
    if (w.empty()) fail_early();
    return w;
  }
  std::size_t left() const { return format_ == PlyHeader::Format::kText ? text_.rest().size() : bytes_.size() - at_; }
  std::size_t take(std::size_t size) {
    if (left() < size) fail_early();
    return std::exchange(at_, at_ + size);
  }
  std::int64_t integer_at(PlyType type, std::size_t at) const {
    const std::uint64_t bits = unsigned_at(bytes_, at, type.size, format_ == PlyHeader::Format::kBig);
    const int unused = 64 - 8 * static_cast<int>(type.size);
    if (type.kind == PlyKind::kUnsigned) return static_cast<std::int64_t>(bits);
    return static_cast<std::int64_t>(bits << unused) >> unused;
  }
  [[noreturn]] void fail_early() const {
    throw LoadError("the file ends within " + element_->name + ' ' + std::to_string(row_) + " of the " +
                    std::to_string(element_->count) + " that its header promises");
  }

  PlyHeader::Format format_;
  MeshText text_;
  std::string_view bytes_;
  std::size_t at_;
  const PlyElement* element_ = nullptr;
  std::uint64_t row_ = 0;
};

class PlyReader {
 public:
  explicit PlyReader(std::string_view file) : header_(read_ply_header(file)), body_(file, header_) {}

  MeshPart read() {
    for (const PlyElement& element : header_.elements) {
      if (element.properties.empty()) continue;  // rows are empty
      if (element.name == "vertex")
        read_vertices(element);
      else
        read_others(element);
    }
    if (!vertices_) fail_ply_header("no element \"vertex\"");
    // Triangles of strips come first; files with strips rarely have faces.
    const std::vector<Triangle> faces =
        faces_.take_triangles(part_.positions, &part_.rounding,
                              [this](std::size_t place, const std::string& what) { body_.fail_face(place, what); });
    part_.triangles.insert(part_.triangles.end(), faces.begin(), faces.end());
    return std::move(part_);
  }

 private:
  void read_vertices(const PlyElement& element) {
    vertices_ = &element;
    std::size_t column[3];
    for (int k = 0; k < 3; ++k) {
      const std::string name(1, static_cast<char>('x' + k));
      column[k] = element.find(name, false);
      if (column[k] == element.properties.size()) fail_ply_header("element vertex has no property \"" + name + '"');
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

  void skip(const PlyProperty& p) { body_.skip(p.type, p.is_list ? body_.length(p) : 1); }

  // Faces, strips of triangles, and elements without geometry.
  void read_others(const PlyElement& element) {
    const bool strips = element.name == "tristrips";
    std::size_t list = element.properties.size();
    if (strips || element.name == "face") {
      list = std::min(element.find("vertex_indices", true), element.find("vertex_index", true));
      if (list == element.properties.size())
        fail_ply_header("element " + element.name + " has no list \"vertex_indices\" or \"vertex_index\"");
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
        std::find_if(elements.begin(), elements.end(), [](const PlyElement& e) { return e.name == "vertex"; });
    const std::uint64_t count = vertex == elements.end() ? 0 : vertex->count;
    if (index < 0 || static_cast<std::uint64_t>(index) >= count || index >= std::numeric_limits<std::uint32_t>::max())
      body_.fail("it names vertex " + std::to_string(index) + ", and there are " + std::to_string(count) + ", from 0");
    return static_cast<std::uint32_t>(index);
  }

  void read_face(const PlyProperty& p, std::uint64_t row) {
    corners_.clear();
    for (std::uint64_t n = body_.length(p); n > 0; --n)
      corners_.push_back(corner(body_.integer(p.type, "the index of a vertex")));
    faces_.add(corners_, body_.place_of_face(row));
  }

  // A strip ends at -1.
  void read_strip(const PlyProperty& p) {
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

  PlyHeader header_;
  Body body_;
  const PlyElement* vertices_ = nullptr;
  MeshPart part_;
  FaceList faces_;
  std::vector<std::uint32_t> corners_;
};

}  // namespace

void read_ply(std::string_view content, const PartSink& sink) {
  sink(PlyReader(content).read());
}

}  // namespace clearance
