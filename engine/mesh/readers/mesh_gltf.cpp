#include "engine/mesh/readers/mesh_gltf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "engine/mesh/mesh_bytes.h"
#include "engine/mesh/mesh_faces.h"
#include "engine/mesh/mesh_text.h"
#include "engine/mesh/mesh_transform.h"
#include "engine/mesh/readers/gltf_accessors.h"
#include "engine/mesh/readers/gltf_document.h"

namespace clearance {

namespace gltf {

namespace {

class Reader {
 public:
  Reader(std::string_view json, std::optional<std::string_view> chunk, const MeshFolder& folder)
      : document_(json), accessors_(document_, chunk, folder) {}

  void read(std::uint64_t most_vertices, const PartSink& sink) {
    std::map<std::uint64_t, MeshTransform> nodes;
    std::vector<Shown> shown = walk(&nodes);
    for (Shown& s : shown) check_skin(nodes, &s);
    std::uint64_t vertices = 0, own = 0;
    std::map<std::uint64_t, std::uint64_t> seen;
    for (const Shown& s : shown) {
      const auto [at, fresh] = seen.try_emplace(s.mesh, 0);
      if (fresh) own += at->second = corners(s.mesh);
      vertices += at->second;
      if (vertices > own && vertices > most_vertices)
        fail("its nodes repeat meshes to more than " + std::to_string(most_vertices) + " vertices");
    }
    std::map<std::uint64_t, std::vector<MeshPart>> meshes;
    for (const Shown& s : shown) {
      const auto [at, fresh] = meshes.try_emplace(s.mesh);
      if (fresh) at->second = primitives(s.mesh);
      for (MeshPart part : at->second) {
        s.X.apply(&part);
        sink(std::move(part));
      }
    }
  }

 private:
  struct Shown {
    std::uint64_t node, mesh;
    MeshTransform X;
  };
  struct Positions {  // of an accessor
    std::vector<Vec3d> all;
    std::optional<UsedPositions> used;
  };

  // Returns every mesh of the scene's nodes with its transform. A node has one parent, so nodes cannot multiply.
  // \param nodes receives the transform of each node of the scene
  std::vector<Shown> walk(std::map<std::uint64_t, MeshTransform>* nodes) const {
    struct Visit {
      std::uint64_t node;
      MeshTransform X;
    };
    const Json& scene = document_.entry("scenes", unsigned_in(document_.root(), "scene", "the file", 0));
    std::vector<Visit> stack;
    std::vector<char> seen;
    const auto push_all = [&](const Json& holder, const char* key, const std::string& where, const MeshTransform& X) {
      const Json* list = find(holder, key);
      if (!list) return;
      if (!list->is_array()) fail(where + '.' + key + ": expected a list");
      for (std::size_t i = list->size(); i-- > 0;) {
        const Json index = {{"node", (*list)[i]}};
        const std::uint64_t node = unsigned_in(index, "node", where + '.' + key);
        document_.entry("nodes", node);
        if (node >= seen.size()) seen.resize(node + 1, 0);
        if (seen[node]++) fail(place("nodes", node) + " has two parents, or is its own ancestor");
        stack.push_back({node, X});
      }
    };
    push_all(scene, "nodes", "the scene", {});
    std::vector<Shown> shown;
    while (!stack.empty()) {
      const Visit visit = stack.back();
      stack.pop_back();
      const Json& node = document_.entry("nodes", visit.node);
      const std::string where = place("nodes", visit.node);
      const MeshTransform X = visit.X.after(transform(node, where));
      nodes->emplace(visit.node, X);
      if (find(node, "mesh")) shown.push_back({visit.node, unsigned_in(node, "mesh", where), X});
      check_at_rest(node, where);
      push_all(node, "children", where, X);
    }
    return shown;
  }

  static MeshTransform transform(const Json& node, const std::string& where) {
    MeshTransform X;
    if (const auto m = numbers_in<16>(node, "matrix", where)) {
      if ((*m)[3] != 0 || (*m)[7] != 0 || (*m)[11] != 0 || (*m)[15] != 1) fail(where + ".matrix is not affine");
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 4; ++c) X.m[r][c] = (*m)[static_cast<std::size_t>(4 * c + r)];
      return X;
    }
    if (const auto q = numbers_in<4>(node, "rotation", where)) set_rotation(&X, *q, where);
    if (const auto s = numbers_in<3>(node, "scale", where))
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) {
          const double size = std::abs((*s)[static_cast<std::size_t>(c)]);
          X.error[r][c] = size * X.error[r][c] + (X.error[r][c] > 0 ? 0x1p-50 * size : 0);
          X.m[r][c] *= (*s)[static_cast<std::size_t>(c)];
        }
    if (const auto t = numbers_in<3>(node, "translation", where))
      for (int r = 0; r < 3; ++r) X.m[r][3] = (*t)[static_cast<std::size_t>(r)];
    return X;
  }

  // Sets M(q) / |q|^2, whose entries are at most 1 and rounded a few times.
  static void set_rotation(MeshTransform* X, const std::array<double, 4>& q, const std::string& where) {
    const auto [x, y, z, w] = q;
    const double n = x * x + y * y + z * z + w * w;
    if (!(n > 0.98 && n < 1.02)) fail(where + ".rotation is not a unit quaternion");
    if (x == 0 && y == 0 && z == 0) return;
    const double rows[3][3] = {{x * x + w * w - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)},
                               {2 * (x * y + z * w), y * y + w * w - x * x - z * z, 2 * (y * z - x * w)},
                               {2 * (x * z - y * w), 2 * (y * z + x * w), z * z + w * w - x * x - y * y}};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        X->m[r][c] = rows[r][c] / n;
        X->error[r][c] = 0x1p-48;
      }
  }

  const Json& primitives_of(std::uint64_t mesh) const {
    static const Json none = Json::array();
    const Json* list = find(document_.entry("meshes", mesh), "primitives");
    if (list && !list->is_array()) fail(place("meshes", mesh) + ".primitives: expected a list");
    return list ? *list : none;
  }

  // The joints of a skin replace its node's transform. At rest they must agree with it up to float32 rounding, which is
  // added to the part's.
  void check_skin(const std::map<std::uint64_t, MeshTransform>& nodes, Shown* shown) {
    const Json& node = document_.entry("nodes", shown->node);
    if (!find(node, "skin")) return;
    const std::uint64_t index = unsigned_in(node, "skin", place("nodes", shown->node));
    const Json& skin = document_.entry("skins", index);
    const std::string where = place("skins", index);
    const Json* joints = find(skin, "joints");
    if (!joints || !joints->is_array() || joints->empty()) fail(where + ".joints: expected a list");
    const std::vector<MeshTransform> binds = accessors_.inverse_binds(skin, where, joints->size());
    const MeshTransform X = shown->X;
    for (std::size_t j = 0; j < joints->size(); ++j) {
      const Json named = {{"joint", (*joints)[j]}};
      const std::uint64_t joint = unsigned_in(named, "joint", where + ".joints");
      const auto at = nodes.find(joint);
      if (at == nodes.end()) fail(where + " has the joint " + place("nodes", joint) + ", which is not in the scene");
      const MeshTransform M = at->second.after(binds[j]);
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 4; ++c) {
          const double off = std::abs(M.m[r][c] - X.m[r][c]);
          double size = std::abs(X.m[r][c]);
          for (int k = 0; k < 3; ++k) size += std::abs(at->second.m[r][k] * binds[j].m[k][c]);
          if (c == 3) size += std::abs(at->second.m[r][3]);
          if (!(off <= 1e-5 * size))
            fail(place("nodes", shown->node) + " has a skin, and its joint " + place("nodes", joint) +
                 " moves the mesh away from where the node has it, which is not read");
          double& error = shown->X.error[r][c];
          error = std::max(error, off + M.error[r][c]);
        }
    }
  }

  // Rejects weights that apply morph targets by default.
  static void check_at_rest(const Json& holder, const std::string& where) {
    const Json* weights = find(holder, "weights");
    if (!weights) return;
    if (!weights->is_array()) fail(where + ".weights: expected a list");
    for (const Json& weight : *weights)
      if (!weight.is_number() || weight.get<double>() != 0)
        fail(where + ".weights: it applies morph targets, which are not read; expected zeros");
  }

  // Returns the number of corners of a mesh's faces, at least that of its parts' vertices.
  std::uint64_t corners(std::uint64_t mesh) const {
    std::uint64_t sum = 0;
    for (const Json& primitive : primitives_of(mesh)) {
      const std::string where = place("meshes", mesh);
      const Json* attributes = find(primitive, "attributes");
      if (!attributes || !find(*attributes, "POSITION")) continue;
      const std::uint64_t accessor = find(primitive, "indices") ? unsigned_in(primitive, "indices", where)
                                                                : unsigned_in(*attributes, "POSITION", where);
      sum += unsigned_in(document_.entry("accessors", accessor), "count", place("accessors", accessor));
    }
    return sum;
  }

  std::vector<MeshPart> primitives(std::uint64_t mesh) {
    std::vector<MeshPart> parts;
    check_at_rest(document_.entry("meshes", mesh), place("meshes", mesh));
    for (const Json& primitive : primitives_of(mesh)) {
      const std::string where = place("meshes", mesh);
      check_extensions(primitive, where + ".primitives[" + std::to_string(&primitive - &primitives_of(mesh)[0]) + ']');
      const Json* attributes = find(primitive, "attributes");
      if (!attributes || !find(*attributes, "POSITION")) continue;
      Positions& known = positions(unsigned_in(*attributes, "POSITION", where));
      std::vector<std::uint32_t> used;
      if (find(primitive, "indices"))
        used = accessors_.indices(unsigned_in(primitive, "indices", where), known.all.size());
      else
        for (std::uint32_t i = 0; i < known.all.size(); ++i) used.push_back(i);
      if (used.empty()) continue;
      const std::vector<Triangle> triangles = faces(used, unsigned_in(primitive, "mode", where, 4));
      std::sort(used.begin(), used.end());  // in the accessor's order
      parts.push_back(known.used->part(used, triangles));
    }
    return parts;
  }

  static std::vector<Triangle> faces(const std::vector<std::uint32_t>& v, std::uint64_t mode) {
    std::vector<Triangle> out;
    if (mode == 4)
      for (std::size_t i = 0; i + 2 < v.size(); i += 3) out.push_back({v[i], v[i + 1], v[i + 2]});
    else if (mode == 5)
      for (std::size_t i = 0; i + 2 < v.size(); ++i) out.push_back({v[i], v[i + 1 + i % 2], v[i + 2 - i % 2]});
    else if (mode == 6)
      add_fan(&out, v);
    else if (mode > 6)
      fail("a primitive of the mode " + std::to_string(mode) + "; expected 0 to 6");
    return out;
  }

  // Positions of an accessor, read once for all primitives.
  Positions& positions(std::uint64_t index) {
    Positions& known = positions_[index];
    if (known.used) return known;
    known.all = accessors_.positions(index);
    known.used.emplace(known.all);
    return known;
  }

  Document document_;
  Accessors accessors_;
  std::map<std::uint64_t, Positions> positions_;
};

// Returns the JSON of a GLB file and its binary chunk, if there is one.
std::pair<std::string_view, std::optional<std::string_view>> chunks(std::string_view file) {
  if (file.substr(0, 4) != "glTF") throw LoadError("not a GLB file: it does not begin with \"glTF\"");
  if (file.size() < 20) throw LoadError("the file ends within its header");
  const std::uint64_t version = unsigned_at(file, 4, 4), length = unsigned_at(file, 8, 4);
  if (version != 2) throw LoadError("version " + std::to_string(version) + " of GLB; expected 2");
  if (length > file.size())
    throw LoadError("its header promises " + std::to_string(length) + " bytes, the file has " +
                    std::to_string(file.size()));
  std::string_view json;
  std::optional<std::string_view> binary;
  for (std::size_t at = 12; at < length;) {
    if (length - at < 8) throw LoadError("the file ends within a chunk's header");
    const std::uint64_t bytes = unsigned_at(file, at, 4);
    if (bytes > length - at - 8)
      throw LoadError("a chunk of " + std::to_string(bytes) + " bytes goes past the end of the file");
    const std::string_view kind = file.substr(at + 4, 4), chunk = file.substr(at + 8, bytes);
    if (kind == "JSON" && at == 12)
      json = chunk;
    else if (kind == std::string_view("BIN\0", 4) && !binary)
      binary = chunk;
    at += 8 + bytes;
  }
  if (json.empty()) throw LoadError("its first chunk is not JSON");
  return {json, binary};
}

}  // namespace

}  // namespace gltf

void read_gltf(std::string_view content, bool glb, const MeshFolder& folder, std::uint64_t most_vertices,
               const PartSink& sink) {
  const auto [json, binary] = glb ? gltf::chunks(content) : std::pair(content, std::optional<std::string_view>());
  gltf::Reader(json, binary, folder).read(most_vertices, sink);
}

}  // namespace clearance
