// Octomaps: maps of occupied space as octrees, in the binary form (.bt: occupied, free or unknown) and the full one
// (.ot: how likely each node is occupied).
//
// A. Hornung, K. M. Wurm, M. Bennewitz, C. Stachniss, W. Burgard, "OctoMap: an efficient probabilistic 3D mapping
// framework based on octrees", Autonomous Robots 34(3), 2013. Their library trusts its input, so the sandboxed loader
// reads the files by itself.
#include <array>
#include <cmath>
#include <cstring>

#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace {

constexpr int kDepth = 16;  // of a tree: a leaf there is one voxel
constexpr std::int64_t kMiddle = std::int64_t{1} << (kDepth - 1);
constexpr std::size_t kMostVoxels = 20'000'000;

struct OctomapHeader {
  bool is_binary = false;
  std::size_t bytes_after_value = 0;  // of a node of the full form, before its children
  double resolution = 0;
  std::int64_t nodes = -1;  // -1 if not counted
  std::string_view data;
};

OctomapHeader read_octomap_header(std::string_view content) {
  OctomapHeader header;
  header.is_binary = content.starts_with("# Octomap OcTree binary file");
  if (!header.is_binary && !content.starts_with("# Octomap OcTree file"))
    throw LoadError("it does not begin as an octomap (\"# Octomap OcTree binary file\" or \"# Octomap OcTree file\")");
  MeshText text(content, MeshText::Comments::kHash);
  std::string id;
  for (std::string key; key != "data"; text.skip_line()) {
    key = text.word();
    if (key.empty()) throw LoadError("it ends within its header");
    if (key == "id") id = text.word_in_line();
    if (key == "size") header.nodes = text.integer(text.word_in_line(), "a number of nodes");
    if (key == "res") header.resolution = text.number(text.word_in_line(), "the edge of a voxel, in metres");
  }
  if (id != "OcTree" && (header.is_binary || id != "ColorOcTree"))
    throw LoadError("the tree " + in_quotes(id) + " is not read; expected OcTree" +
                    (header.is_binary ? "" : " or ColorOcTree"));
  header.bytes_after_value = id == "ColorOcTree" ? 3 : 0;
  if (!(header.resolution > 0 && header.resolution <= 1e4))
    throw LoadError("res: expected metres above 0 and up to 10000");
  header.data = text.rest();
  return header;
}

class OctomapReader {
 public:
  explicit OctomapReader(const OctomapHeader& header) : header_(header), rest_(header.data) {}

  std::vector<Vec3d> read() {
    const Place root{{0, 0, 0}, 0};
    if (rest_.empty() && header_.nodes != 0) take(1);  // the file is truncated
    if (!rest_.empty()) header_.is_binary ? read_binary(root) : read_full(root);
    return std::move(centres_);
  }

 private:
  struct Place {
    std::array<std::int64_t, 3> key;  // of the voxel in its lowest corner
    int depth;

    Place child(unsigned i) const {
      Place at{key, depth + 1};
      for (std::size_t k = 0; k < 3; ++k)
        if (i >> k & 1) at.key[k] += std::int64_t{1} << (kDepth - at.depth);
      return at;
    }
  };

  const char* take(std::size_t bytes) {
    if (rest_.size() < bytes) throw LoadError("it ends before its tree does");
    const char* const at = rest_.data();
    rest_.remove_prefix(bytes);
    return at;
  }
  static void check_depth(const Place& parent) {
    if (parent.depth == kDepth) throw LoadError("its tree is deeper than " + std::to_string(kDepth) + " levels");
  }

  // Two bits for each child: unknown, occupied, free, or a node of its own, which follows.
  void read_binary(const Place& at) {
    check_depth(at);
    const char* const bits = take(2);
    std::array<unsigned, 8> kinds;
    for (unsigned i = 0; i < 8; ++i) kinds[i] = static_cast<unsigned char>(bits[i / 4]) >> (2 * (i % 4)) & 3;
    for (unsigned i = 0; i < 8; ++i) {
      if (kinds[i] == 2) add(at.child(i));
      if (kinds[i] == 3) read_binary(at.child(i));
    }
  }

  // Log odds of occupancy, then the mask of children.
  void read_full(const Place& at) {
    float log_odds = 0;
    std::memcpy(&log_odds, take(sizeof log_odds), sizeof log_odds);
    take(header_.bytes_after_value);
    const unsigned children = static_cast<unsigned char>(*take(1));
    if (std::isnan(log_odds)) throw LoadError("a node's value is not a number");
    if (children == 0 && log_odds >= 0) add(at);
    for (unsigned i = 0; i < 8; ++i) {
      if (!(children >> i & 1)) continue;
      check_depth(at);
      read_full(at.child(i));
    }
  }

  // Adds the voxels of a leaf, which are many above the last level.
  void add(const Place& leaf) {
    const std::int64_t edge = std::int64_t{1} << (kDepth - leaf.depth);
    if (edge > 1024 || static_cast<std::size_t>(edge * edge * edge) > kMostVoxels - centres_.size())
      throw LoadError("its occupied leaves are more than " + std::to_string(kMostVoxels) + " voxels");
    const auto centre = [&](std::int64_t key) {
      return (static_cast<double>(key - kMiddle) + 0.5) * header_.resolution;  // rounded once
    };
    for (std::int64_t x = 0; x < edge; ++x)
      for (std::int64_t y = 0; y < edge; ++y)
        for (std::int64_t z = 0; z < edge; ++z)
          centres_.push_back({centre(leaf.key[0] + x), centre(leaf.key[1] + y), centre(leaf.key[2] + z)});
  }

  const OctomapHeader& header_;
  std::string_view rest_;
  std::vector<Vec3d> centres_;
};

}  // namespace

void read_octomap(std::string_view content, const PartSink& sink) {
  const OctomapHeader header = read_octomap_header(content);
  MeshPart edge, voxels;
  edge.positions = {{header.resolution, 0, 0}};
  voxels.positions = OctomapReader(header).read();
  sink(std::move(edge));
  if (!voxels.positions.empty()) sink(std::move(voxels));
}

}  // namespace clearance
