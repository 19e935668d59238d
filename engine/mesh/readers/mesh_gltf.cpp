#include "engine/mesh/readers/mesh_gltf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "engine/mesh/mesh_bytes.h"
#include "engine/mesh/mesh_faces.h"
#include "engine/mesh/mesh_text.h"
#include "engine/mesh/mesh_transform.h"
#include "engine/mesh/readers/gltf_extensions.h"

namespace clearance {

namespace {

using Json = nlohmann::json;

// Limit of counts and sizes in bytes; sums and products of two of them do not overflow.
constexpr std::uint64_t kMostOfAnything = std::uint64_t{1} << 31;

// Bytes read before repeated reading is limited, and how often each byte may be read on average.
constexpr std::uint64_t kMostReadBytes = std::uint64_t{64} << 20, kMostReadings = 16;

[[noreturn]] void fail(const std::string& what) {
  throw LoadError("glTF: " + what);
}

std::string place(const char* list, std::uint64_t i) {
  return std::string(list) + '[' + std::to_string(i) + ']';
}

const Json* find(const Json& object, const char* key) {
  if (!object.is_object()) return nullptr;
  const auto at = object.find(key);
  return at == object.end() ? nullptr : &*at;
}

std::uint64_t unsigned_in(const Json& object, const char* key, const std::string& where,
                          std::optional<std::uint64_t> otherwise = {}) {
  const Json* value = find(object, key);
  if (!value && otherwise) return *otherwise;
  if (!value) fail(where + " has no \"" + key + '"');
  if (value->is_number_unsigned() && value->get<std::uint64_t>() <= kMostOfAnything) return value->get<std::uint64_t>();
  // Some programs write 3.0.
  if (value->is_number_float() && value->get<double>() >= 0 && value->get<double>() <= double(kMostOfAnything) &&
      std::floor(value->get<double>()) == value->get<double>())
    return static_cast<std::uint64_t>(value->get<double>());
  fail(where + '.' + key + ": expected a count or index, got " + value->dump().substr(0, 40));
}

// Returns N finite numbers of a key; none without the key.
template <std::size_t N>
std::optional<std::array<double, N>> numbers_in(const Json& object, const char* key, const std::string& where) {
  const Json* value = find(object, key);
  if (!value) return {};
  std::array<double, N> out;
  bool good = value->is_array() && value->size() == N;
  for (std::size_t i = 0; good && i < N; ++i) {
    good = (*value)[i].is_number();
    if (good) out[i] = (*value)[i].get<double>();
    good = good && std::isfinite(out[i]);
  }
  if (!good) fail(where + '.' + key + ": expected " + std::to_string(N) + " finite numbers");
  return out;
}

std::string decoded_base64(std::string_view text, const std::string& where) {
  while (text.ends_with('=') && text.size() % 4 == 0 && text.size() > 0) {
    text.remove_suffix(text.ends_with("==") ? 2 : 1);
    break;
  }
  std::string out;
  out.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t word = 0;
  int bits = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    std::uint32_t digit = 0;
    if (c >= 'A' && c <= 'Z')
      digit = static_cast<std::uint32_t>(c - 'A');
    else if (c >= 'a' && c <= 'z')
      digit = static_cast<std::uint32_t>(c - 'a' + 26);
    else if (c >= '0' && c <= '9')
      digit = static_cast<std::uint32_t>(c - '0' + 52);
    else if (c == '+' || c == '-')
      digit = 62;
    else if (c == '/' || c == '_')
      digit = 63;
    else
      fail(where + ".uri: character " + std::to_string(i) + " is not base64");
    word = (word << 6 | digit) & 0xffffff;
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    out.push_back(static_cast<char>(word >> bits & 0xff));
  }
  if (bits == 6) fail(where + ".uri: its base64 ends within a byte");
  return out;
}

std::string without_percents(const std::string& uri) {
  std::string out;
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool escaped = uri[i] == '%' && i + 2 < uri.size() && digit(uri[i + 1]) >= 0 && digit(uri[i + 2]) >= 0;
    out += escaped ? static_cast<char>(16 * digit(uri[i + 1]) + digit(uri[i + 2])) : uri[i];
    if (escaped) i += 2;
  }
  return out;
}

// Rows of numbers in a buffer, checked to be complete.
struct Rows {
  std::string_view bytes;
  std::size_t stride = 0;
};

class GltfReader {
 public:
  GltfReader(std::string_view json, std::optional<std::string_view> chunk, const MeshFolder& folder)
      : chunk_(chunk), folder_(folder) {
    try {
      root_ = Json::parse(json.begin(), json.end());
    } catch (const Json::exception& e) {
      const std::string text = e.what();
      fail("invalid JSON: " + text.substr(text.find("] ") == std::string::npos ? 0 : text.find("] ") + 2, 200));
    }
    const Json* asset = find(root_, "asset");
    const Json* version = asset ? find(*asset, "version") : nullptr;
    if (!version || !version->is_string()) fail("no asset.version");
    if (const std::string v = version->get<std::string>(); !v.starts_with("2."))
      fail("version " + in_quotes(v) + "; expected 2.0");
    check_required();
    check_extensions(root_, "the file", {"CESIUM_RTC"});
  }

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

  // Returns an entry of a list that belongs to the geometry.
  const Json& entry(const char* list, std::uint64_t i) const {
    const Json* all = find(root_, list);
    const std::size_t count = all && all->is_array() ? all->size() : 0;
    if (i >= count) fail(place(list, i) + " is named, and there are " + std::to_string(count));
    check_extensions((*all)[i], place(list, i));
    return (*all)[i];
  }

  // glTF 2.0, 3.12: a reader that does not know a required extension must fail.
  void check_required() const {
    const Json* required = find(root_, "extensionsRequired");
    if (!required) return;
    if (!required->is_array()) fail("extensionsRequired: expected a list");
    for (const Json& name : *required) {
      if (!name.is_string()) fail("extensionsRequired: expected names");
      if (!keeps_geometry(name.get_ref<const std::string&>()))
        fail("it needs the extension " + name.get<std::string>().substr(0, 60) + ", which is not read");
    }
  }

  // Rejects extensions that change the geometry of an object, required or not.
  // \param changing lists those that do; if empty, all but those known to keep the geometry
  static void check_extensions(const Json& object, const std::string& where,
                               std::initializer_list<std::string_view> changing = {}) {
    const Json* extensions = find(object, "extensions");
    if (!extensions) return;
    if (!extensions->is_object()) fail(where + ".extensions: expected an object");
    for (const auto& [name, value] : extensions->items()) {
      const bool changes = changing.size() == 0 ? !keeps_geometry(name)
                                                : std::find(changing.begin(), changing.end(), name) != changing.end();
      if (changes) fail(where + " has the extension " + name.substr(0, 60) + ", which is not read");
    }
  }

  // Returns every mesh of the scene's nodes with its transform. A node has one parent, so nodes cannot multiply.
  // \param nodes receives the transform of each node of the scene
  std::vector<Shown> walk(std::map<std::uint64_t, MeshTransform>* nodes) const {
    struct Visit {
      std::uint64_t node;
      MeshTransform X;
    };
    const Json& scene = entry("scenes", unsigned_in(root_, "scene", "the file", 0));
    std::vector<Visit> stack;
    std::vector<char> seen;
    const auto push_all = [&](const Json& holder, const char* key, const std::string& where, const MeshTransform& X) {
      const Json* list = find(holder, key);
      if (!list) return;
      if (!list->is_array()) fail(where + '.' + key + ": expected a list");
      for (std::size_t i = list->size(); i-- > 0;) {
        const Json index = {{"node", (*list)[i]}};
        const std::uint64_t node = unsigned_in(index, "node", where + '.' + key);
        entry("nodes", node);
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
      const Json& node = entry("nodes", visit.node);
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
    const Json* list = find(entry("meshes", mesh), "primitives");
    if (list && !list->is_array()) fail(place("meshes", mesh) + ".primitives: expected a list");
    return list ? *list : none;
  }

  // The joints of a skin replace its node's transform. At rest they must agree with it up to float32 rounding, which is
  // added to the part's.
  void check_skin(const std::map<std::uint64_t, MeshTransform>& nodes, Shown* shown) {
    const Json& node = entry("nodes", shown->node);
    if (!find(node, "skin")) return;
    const std::uint64_t index = unsigned_in(node, "skin", place("nodes", shown->node));
    const Json& skin = entry("skins", index);
    const std::string where = place("skins", index);
    const Json* joints = find(skin, "joints");
    if (!joints || !joints->is_array() || joints->empty()) fail(where + ".joints: expected a list");
    const std::vector<MeshTransform> binds = inverse_binds(skin, where, joints->size());
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

  std::vector<MeshTransform> inverse_binds(const Json& skin, const std::string& where, std::size_t joints) {
    std::vector<MeshTransform> out(joints);
    if (!find(skin, "inverseBindMatrices")) return out;
    const std::uint64_t index = unsigned_in(skin, "inverseBindMatrices", where);
    const Json& accessor = entry("accessors", index);
    const std::string at = place("accessors", index);
    const Json* type = find(accessor, "type");
    if (!type || *type != "MAT4" || unsigned_in(accessor, "componentType", at) != 5126)
      fail(at + " holds inverseBindMatrices; expected MAT4 of float32 (5126)");
    if (unsigned_in(accessor, "count", at) < joints) fail(at + " has fewer matrices than " + where + " has joints");
    const Rows data = rows(accessor, at, joints, 64);
    for (std::size_t j = 0; j < joints; ++j)
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 4; ++c)
          out[j].m[r][c] = real_at<float>(data.bytes, data.stride * j + 16 * c + 4 * r);
    return out;
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
      sum += unsigned_in(entry("accessors", accessor), "count", place("accessors", accessor));
    }
    return sum;
  }

  std::vector<MeshPart> primitives(std::uint64_t mesh) {
    std::vector<MeshPart> parts;
    check_at_rest(entry("meshes", mesh), place("meshes", mesh));
    for (const Json& primitive : primitives_of(mesh)) {
      const std::string where = place("meshes", mesh);
      check_extensions(primitive, where + ".primitives[" + std::to_string(&primitive - &primitives_of(mesh)[0]) + ']');
      const Json* attributes = find(primitive, "attributes");
      if (!attributes || !find(*attributes, "POSITION")) continue;
      Positions& known = positions(unsigned_in(*attributes, "POSITION", where));
      std::vector<std::uint32_t> used;
      if (find(primitive, "indices"))
        used = indices(unsigned_in(primitive, "indices", where), known.all.size());
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

  // Returns the `count` rows of `size` bytes of an accessor, or of a part of a sparse one.
  Rows rows(const Json& holder, const std::string& where, std::uint64_t count, std::size_t size) {
    const std::uint64_t index = unsigned_in(holder, "bufferView", where);
    const Json& view = entry("bufferViews", index);
    const std::string view_place = place("bufferViews", index);
    const std::string& bytes = buffer(unsigned_in(view, "buffer", view_place));
    const std::uint64_t begin = unsigned_in(view, "byteOffset", view_place, 0);
    const std::uint64_t length = unsigned_in(view, "byteLength", view_place);
    if (begin + length > bytes.size())
      fail(view_place + " ends at byte " + std::to_string(begin + length) + " of a buffer of " +
           std::to_string(bytes.size()));
    const std::uint64_t stride = unsigned_in(view, "byteStride", view_place, size);
    const std::uint64_t offset = unsigned_in(holder, "byteOffset", where, 0);
    if (stride < size)
      fail(view_place + ".byteStride of " + std::to_string(stride) + "; its rows have " + std::to_string(size));
    if (count > 0 && (offset + size > length || (count - 1) > (length - offset - size) / stride))
      fail(where + " has " + std::to_string(count) + " rows, more than its " + view_place + " holds");
    read_bytes_ += count * size;
    if (read_bytes_ > kMostReadBytes && read_bytes_ / kMostReadings > buffer_bytes_)
      fail("its accessors read the same bytes too often");
    return {std::string_view(bytes).substr(begin + offset, count == 0 ? 0 : length - offset), stride};
  }

  // Positions of an accessor, read once for all primitives.
  Positions& positions(std::uint64_t index) {
    Positions& known = positions_[index];
    if (known.used) return known;
    known.all = read_positions(index);
    known.used.emplace(known.all);
    return known;
  }

  std::vector<Vec3d> read_positions(std::uint64_t index) {
    const Json& accessor = entry("accessors", index);
    const std::string where = place("accessors", index);
    const Json* type = find(accessor, "type");
    if (!type || *type != "VEC3" || unsigned_in(accessor, "componentType", where) != 5126)
      fail(where + " is a POSITION; expected VEC3 of float32 (5126); KHR_mesh_quantization is not read");
    const std::uint64_t count = unsigned_in(accessor, "count", where);
    const Json* sparse = find(accessor, "sparse");
    if (!sparse && !find(accessor, "bufferView")) fail(where + " has no data");
    std::vector<Vec3d> out;
    const auto row = [](const Rows& r, std::uint64_t i) {
      return Vec3d{real_at<float>(r.bytes, r.stride * i), real_at<float>(r.bytes, r.stride * i + 4),
                   real_at<float>(r.bytes, r.stride * i + 8)};
    };
    if (find(accessor, "bufferView")) {
      const Rows data = rows(accessor, where, count, 12);
      out.reserve(count);
      for (std::uint64_t i = 0; i < count; ++i) out.push_back(row(data, i));
    } else {
      out.resize(count, {0, 0, 0});
    }
    if (sparse) {
      const std::uint64_t n = unsigned_in(*sparse, "count", where + ".sparse");
      const Json *at = find(*sparse, "indices"), *values = find(*sparse, "values");
      if (!at || !values) fail(where + ".sparse has no indices or no values");
      const std::vector<std::uint32_t> replaced = index_rows(*at, where + ".sparse.indices", n, count);
      const Rows data = rows(*values, where + ".sparse.values", n, 12);
      for (std::uint64_t i = 0; i < n; ++i) out[replaced[i]] = row(data, i);
    }
    for (std::uint64_t i = 0; i < count; ++i)
      if (!std::isfinite(out[i].x) || !std::isfinite(out[i].y) || !std::isfinite(out[i].z))
        fail("position " + std::to_string(i) + " of " + where + " is not finite");
    return out;
  }

  std::vector<std::uint32_t> indices(std::uint64_t index, std::size_t vertices) {
    const Json& accessor = entry("accessors", index);
    const std::string where = place("accessors", index);
    const Json* type = find(accessor, "type");
    if (!type || *type != "SCALAR") fail(where + " holds indices; expected SCALAR");
    if (find(accessor, "sparse") || !find(accessor, "bufferView"))
      fail(where + " holds indices and is sparse or has no data");
    return index_rows(accessor, where, unsigned_in(accessor, "count", where), vertices);
  }

  std::vector<std::uint32_t> index_rows(const Json& holder, const std::string& where, std::uint64_t count,
                                        std::uint64_t end) {
    const std::uint64_t type = unsigned_in(holder, "componentType", where);
    const std::size_t size = type == 5121 ? 1 : type == 5123 ? 2 : type == 5125 ? 4 : 0;
    if (size == 0) fail(where + " holds indices; expected componentType 5121, 5123 or 5125");
    const Rows data = rows(holder, where, count, size);
    std::vector<std::uint32_t> out(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      out[i] = static_cast<std::uint32_t>(unsigned_at(data.bytes, data.stride * i, size));
      if (out[i] >= end)
        fail("index " + std::to_string(i) + " of " + where + " names vertex " + std::to_string(out[i]) +
             ", and there are " + std::to_string(end) + ", from 0");
    }
    return out;
  }

  const std::string& buffer(std::uint64_t index) {
    const auto [at, fresh] = buffers_.try_emplace(index);
    if (!fresh) return at->second;
    const Json& described = entry("buffers", index);
    const std::string where = place("buffers", index);
    const Json* uri = find(described, "uri");
    if (!uri) {
      if (index != 0 || !chunk_) fail(where + " has no \"uri\"");
      at->second = *chunk_;
    } else if (!uri->is_string()) {
      fail(where + ".uri: expected text");
    } else if (const std::string& text = uri->get_ref<const std::string&>(); text.starts_with("data:")) {
      const std::size_t comma = text.find(',');
      if (comma == std::string::npos || !std::string_view(text).substr(0, comma).ends_with(";base64"))
        fail(where + ".uri: data that is not base64");
      at->second = decoded_base64(std::string_view(text).substr(comma + 1), where);
    } else {
      at->second = folder_.read(without_percents(text));
    }
    const std::uint64_t length = unsigned_in(described, "byteLength", where);
    if (length > at->second.size())
      fail(where + ".byteLength is " + std::to_string(length) + ", and there are " + std::to_string(at->second.size()) +
           " bytes");
    buffer_bytes_ += at->second.size();
    return at->second;
  }

  Json root_;
  std::optional<std::string_view> chunk_;  // binary data behind the JSON
  const MeshFolder& folder_;
  std::map<std::uint64_t, std::string> buffers_;
  std::map<std::uint64_t, Positions> positions_;
  std::uint64_t buffer_bytes_ = 0, read_bytes_ = 0;
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

void read_gltf(std::string_view content, bool glb, const MeshFolder& folder, std::uint64_t most_vertices,
               const PartSink& sink) {
  const auto [json, binary] = glb ? chunks(content) : std::pair(content, std::optional<std::string_view>());
  GltfReader(json, binary, folder).read(most_vertices, sink);
}

}  // namespace clearance
