// STL, text and binary. Text is read word by word; binary holds float32, which float64 holds exactly.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "engine/mesh/mesh_bytes.h"
#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

constexpr std::size_t kHeader = 84, kFacet = 50;

std::uint64_t promised(std::string_view file) {
  return file.size() >= kHeader ? unsigned_at(file, 80, 4) : 0;
}

// Returns whether the facets that a header promises are present; other bytes may follow.
bool holds_promised(std::string_view file) {
  return file.size() >= kHeader && (file.size() - kHeader) / kFacet >= promised(file);
}

std::string broken_promise(std::string_view file) {
  const std::uint64_t facets = promised(file);
  return "its header promises " + std::to_string(facets) + " facets (" + std::to_string(kHeader + kFacet * facets) +
         " bytes), the file has " + std::to_string(file.size()) + " bytes";
}

void read_facets(std::string_view file, std::uint64_t facets, double* reach, const PartSink& sink) {
  MeshPart part;
  part.positions.reserve(3 * facets);
  part.triangles.reserve(facets);
  for (std::uint64_t f = 0; f < facets; ++f) {
    const auto first = static_cast<std::uint32_t>(part.positions.size());
    for (int corner = 0; corner < 3; ++corner) {
      Vec3d p{0, 0, 0};
      for (int k = 0; k < 3; ++k)
        p[k] = real_at<float>(
            file, kHeader + kFacet * f + 12 + 12 * static_cast<std::size_t>(corner) + 4 * static_cast<std::size_t>(k));
      if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
        throw LoadError("facet " + std::to_string(f) + " has a corner that is not finite");
      for (int k = 0; k < 3; ++k) *reach = std::max(*reach, std::abs(p[k]));
      part.positions.push_back(p);
    }
    part.triangles.push_back({first, first + 1, first + 2});
  }
  if (facets == 0) throw LoadError("it holds no facet");
  sink(std::move(part));
}

constexpr std::uint64_t kLooked = 16;

// Returns whether bytes resemble a facet of a mesh as large as the first of `facets`.
bool holds_facet(std::string_view bytes, std::size_t at, std::uint64_t facets, double reach) {
  for (std::uint64_t f = 0; f < std::min(facets, kLooked) && at + kFacet <= bytes.size(); ++f, at += kFacet) {
    bool near = true, spread = false;
    for (std::size_t i = 0; i < 9; ++i) {
      const double x = real_at<float>(bytes, at + 12 + 4 * i);
      near = near && std::abs(x) <= 1e3 * reach;
      spread =
          spread || (i >= 3 && std::abs(x - real_at<float>(bytes, at + 12 * (i / 3) + 4 * (i % 3))) > 1e-6 * reach);
    }
    if (near && spread) return true;
  }
  return false;
}

// Returns whether a file begins like text. The header of a binary one may begin with "solid" as well, but holds a
// zero byte before any facet.
bool is_text(std::string_view file) {
  if (lower(MeshText(file).word()) != "solid") return false;
  constexpr std::string_view kWord = "facet";
  const std::string_view before = file.substr(0, file.find('\0'));
  const auto same = [](char a, char b) { return (a | 0x20) == b; };
  return before.size() == file.size() ||
         std::search(before.begin(), before.end(), kWord.begin(), kWord.end(), same) != before.end();
}

// Returns the text with lone CRs replaced by LF, or none if there are no lone CRs.
std::string_view with_line_feeds(std::string_view file, std::string* copy) {
  for (std::size_t at = file.find('\r'); at != std::string_view::npos; at = file.find('\r', at + 1)) {
    if (file.substr(at + 1, 1) == "\n") continue;
    if (copy->empty()) *copy = file;
    (*copy)[at] = '\n';
  }
  return copy->empty() ? file : *copy;
}

// Returns a word in lower case without trailing zero bytes, for comparison with keywords.
std::string keyword(std::string_view word) {
  return lower(word.substr(0, word.find('\0')));
}

double coordinate(MeshText* text) {
  const std::string_view word = text->word();
  if (word.find('\0') != std::string_view::npos) text->fail("a zero byte in a coordinate");
  return text->number(word, "a coordinate");
}

// solid NAME { facet normal X Y Z  outer loop { vertex X Y Z } x 3  endloop  endfacet } endsolid NAME, in any case and
// layout; "end solid" is the same as "endsolid".
// Returns the bytes behind it if they are a binary solid, else nothing.
std::string_view read_text(std::string_view file, const PartSink& sink) {
  std::string copy;
  MeshText text(with_line_feeds(file, &copy));
  MeshPart part;
  std::size_t corners = 0;
  bool in_solid = false;
  const auto finish = [&] {
    if (corners != 0) text.fail("a facet of " + std::to_string(corners) + " vertices; expected 3");
    if (!part.positions.empty()) sink(std::move(part));
    part = {};
  };
  for (std::string_view read = text.word(); !read.empty(); read = text.word()) {
    std::string word = keyword(read);
    if (word == "end") word += keyword(text.word_in_line());
    if (word == "vertex") {
      Vec3d p{0, 0, 0};
      for (int k = 0; k < 3; ++k) p[k] = coordinate(&text);
      part.positions.push_back(p);
      ++corners;
    } else if (word == "endfacet") {
      if (corners != 3) text.fail("a facet of " + std::to_string(corners) + " vertices; expected 3");
      const auto n = static_cast<std::uint32_t>(part.positions.size());
      part.triangles.push_back({n - 3, n - 2, n - 1});
      corners = 0;
    } else if (word == "solid" || word == "endsolid") {
      finish();
      in_solid = word == "solid";
      text.skip_line();  // its name
      const std::string_view rest = file.substr(file.size() - text.rest().size());
      if (!in_solid && promised(rest) > 0 && holds_promised(rest)) return rest;
    } else if (word == "normal") {
      for (int k = 0; k < 3; ++k) text.word();  // the corners define the normal
    } else if (word != "facet" && word != "outer" && word != "loop" && word != "endloop") {
      text.skip_line();  // added by some programs
    }
  }
  if (in_solid) throw LoadError("the file ends early: no \"endsolid\" at its end");
  if (!part.positions.empty()) throw LoadError("facets follow the last \"endsolid\"");
  return {};
}

// Returns the bytes behind it if they are another solid, else nothing; other bytes are ignored.
std::string_view read_binary(std::string_view file, const PartSink& sink) {
  const std::uint64_t facets = promised(file);
  const auto more = [&] {
    throw LoadError("its header promises " + std::to_string(facets) + " facets, and more follow them");
  };
  double reach = 0;
  read_facets(file, facets, &reach, sink);
  const std::string_view rest = file.substr(kHeader + kFacet * facets);
  if (holds_facet(rest, 0, 1, reach)) more();
  if (is_text(rest) || holds_facet(rest, kHeader, promised(rest), reach)) return rest;
  if (holds_facet(rest, 0, kLooked, reach)) more();
  return {};
}

}  // namespace

void read_stl(std::string_view file, const PartSink& sink) {
  std::string_view rest = file;
  do {
    const std::uint64_t facets = promised(rest);
    if (holds_promised(rest) && (facets > 0 || rest.size() == kHeader))
      rest = read_binary(rest, sink);
    else if (is_text(rest))
      rest = read_text(rest, sink);
    else if (rest.size() < kHeader)
      throw LoadError("the file has " + std::to_string(rest.size()) +
                      " bytes, less than the header of a binary STL file");
    else
      throw LoadError((rest.size() < file.size() ? "after its first solid: " : "") + broken_promise(rest));
  } while (!rest.empty());
}

}  // namespace clearance
