// Geomview's OFF in text: positions with optional further columns, and polygons with optional colours.
#include <cmath>
#include <limits>

#include "engine/mesh/mesh_faces.h"
#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

struct OffHeader {
  bool weights = false;  // a fourth coordinate that divides the others
  std::uint64_t vertices = 0, faces = 0;
};

// [ST][C][N][4][n]OFF, then the counts; the word itself may be left out.
OffHeader read_header(MeshText* text) {
  OffHeader header;
  std::string_view word = text->word(), kind = word;
  const auto skip = [&kind](std::string_view prefix) {
    const bool there = kind.starts_with(prefix);
    if (there) kind.remove_prefix(prefix.size());
    return there;
  };
  skip("ST");
  skip("C");
  skip("N");
  header.weights = skip("4");
  const bool dimension = skip("n");
  if (kind == "OFF") {
    word = text->word();
    if (word == "BINARY") text->fail("OFF: BINARY is not read; expected text");
    if (dimension) {
      if (text->integer(word, "a dimension") != 3) text->fail("a dimension of " + in_quotes(word) + "; expected 3");
      word = text->word();
    }
  } else if (word.empty() || word[0] < '0' || word[0] > '9') {
    text->fail("not an OFF file: it begins with " + in_quotes(word));
  } else {
    header.weights = false;
  }
  for (std::uint64_t* count : {&header.vertices, &header.faces}) {
    const std::int64_t n = text->integer(word, "a count");
    if (n < 0) text->fail("expected a count, got " + in_quotes(word));
    *count = static_cast<std::uint64_t>(n);
    if (count == &header.vertices) word = text->word();
  }
  text->skip_line();  // the number of edges
  return header;
}

void fail_early(const MeshText& text, const char* what, std::uint64_t i, std::uint64_t count) {
  text.fail(std::string("the file ends before ") + what + ' ' + std::to_string(i) + " of the " + std::to_string(count) +
            " that its header promises");
}

}  // namespace

void read_off(std::string_view content, const PartSink& sink) {
  MeshText text(content, MeshText::Comments::kHash);
  const OffHeader header = read_header(&text);
  MeshPart part;
  for (std::uint64_t i = 0; i < header.vertices; ++i) {
    std::string_view word = text.word();
    if (word.empty()) fail_early(text, "vertex", i, header.vertices);
    Vec3d p{0, 0, 0};
    for (int k = 0; k < 3; ++k, word = text.word_in_line()) p[k] = text.number(word, "a coordinate");
    if (header.weights) {
      const double w = text.number(word, "a weight");
      p = {p.x / w, p.y / w, p.z / w};
      if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
        text.fail("a vertex is not finite by its weight");
      if (w != 1) part.rounding = std::max(part.rounding, 0x1p-51 * norm(p) + std::numeric_limits<double>::min());
    }
    part.positions.push_back(p);
    text.skip_line();
  }
  std::vector<std::uint32_t> corners;
  FaceList faces;
  for (std::uint64_t i = 0; i < header.faces; ++i) {
    const std::string_view word = text.word();
    if (word.empty()) fail_early(text, "face", i, header.faces);
    const std::int64_t n = text.integer(word, "the number of a face's corners");
    corners.clear();
    for (std::int64_t k = 0; k < n; ++k) {
      const std::int64_t index = text.integer(text.word_in_line(), "the index of a vertex");
      if (index < 0 || static_cast<std::uint64_t>(index) >= header.vertices)
        text.fail("a face names vertex " + std::to_string(index) + ", and there are " +
                  std::to_string(header.vertices) + ", from 0");
      corners.push_back(static_cast<std::uint32_t>(index));
    }
    faces.add(corners, text.place());
    text.skip_line();
  }
  part.triangles = faces.take_triangles(part.positions, &part.rounding,
                                        [&](std::size_t place, const std::string& what) { text.fail_at(place, what); });
  sink(std::move(part));
}

}  // namespace clearance
