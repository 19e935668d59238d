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

void read_binary(std::string_view file, std::uint64_t facets, const PartSink& sink) {
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
      part.positions.push_back(p);
    }
    part.triangles.push_back({first, first + 1, first + 2});
  }
  if (facets == 0) throw LoadError("it holds no facet");
  sink(std::move(part));
}

// solid NAME { facet normal X Y Z  outer loop { vertex X Y Z } x 3  endloop  endfacet } endsolid NAME, in any case and
// layout.
void read_text(std::string_view file, const PartSink& sink) {
  MeshText text(file);
  MeshPart part;
  std::size_t corners = 0;
  bool in_solid = false;
  const auto finish = [&] {
    if (corners != 0) text.fail("a facet of " + std::to_string(corners) + " vertices; expected 3");
    if (!part.positions.empty()) sink(std::move(part));
    part = {};
  };
  for (std::string word = lower(text.word()); !word.empty(); word = lower(text.word())) {
    if (word == "vertex") {
      Vec3d p{0, 0, 0};
      for (int k = 0; k < 3; ++k) p[k] = text.number(text.word(), "a coordinate");
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
    } else if (word == "normal") {
      for (int k = 0; k < 3; ++k) text.word();  // the corners say it
    } else if (word != "facet" && word != "outer" && word != "loop" && word != "endloop") {
      text.skip_line();  // what some program adds
    }
  }
  if (in_solid) throw LoadError("the file ends early: no \"endsolid\" at its end");
}

}  // namespace

void read_stl(std::string_view file, const PartSink& sink) {
  const std::uint64_t facets = file.size() >= kHeader ? unsigned_at(file, 80, 4) : 0;
  if (file.size() >= kHeader && file.size() == kHeader + kFacet * facets) return read_binary(file, facets, sink);
  if (lower(MeshText(file).word()) == "solid" && file.find('\0') == std::string_view::npos)
    return read_text(file, sink);
  throw LoadError(
      file.size() < kHeader
          ? "the file has " + std::to_string(file.size()) + " bytes, less than the header of a binary STL file"
          : "its header promises " + std::to_string(facets) + " facets (" + std::to_string(kHeader + kFacet * facets) +
                " bytes), the file has " + std::to_string(file.size()) + " bytes");
}

}  // namespace clearance
