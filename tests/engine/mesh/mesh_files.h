// Small mesh files of every format, as text or bytes, for tests that write, damage and read them.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/hull/shapes.h"

namespace clearance::mesh_files {

struct Source {
  std::vector<Vec3d> vertices;  ///< binary files and DAE hold float32
  std::vector<Triangle> triangles;
};

/// Open3D's sphere of resolution 5, off the origin; every coordinate rounded to float32, which formats can hold
/// exactly.
inline Source ball() {
  Shape shape = make_uv_sphere(0.75, 5);
  for (Vec3d& v : shape.vertices) v = cast<double>(cast<float>(v + Vec3d{0.1, -0.2, 0.3}));
  return {shape.vertices, shape.triangles};
}

inline Source tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};
}

template <class... T>
std::string print(const char* format, T... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

/// A text with one of its places changed. Throws std::invalid_argument if it has no such place.
inline std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const std::size_t at = text.find(what);
  if (at == std::string::npos) throw std::invalid_argument("there is no " + what);
  return text.replace(at, what.size(), with);
}

/// The bytes of a number as they lie in a little-endian file.
template <class T>
std::string bytes(T value, bool big_endian = false) {
  std::string out(sizeof value, '\0');
  std::memcpy(out.data(), &value, sizeof value);
  return big_endian ? std::string(out.rbegin(), out.rend()) : out;
}

inline std::string obj(const Source& m) {
  std::string out = "# a comment\no thing\n";
  for (const Vec3d& v : m.vertices) out += print("v %.17g %.17g %.17g\n", v.x, v.y, v.z);
  for (const Triangle& t : m.triangles) out += print("f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return out;
}

inline std::string off(const Source& m) {
  std::string out = print("OFF\n%zu %zu 0\n", m.vertices.size(), m.triangles.size());
  for (const Vec3d& v : m.vertices) out += print("%.17g %.17g %.17g\n", v.x, v.y, v.z);
  for (const Triangle& t : m.triangles) out += print("3 %u %u %u\n", t[0], t[1], t[2]);
  return out;
}

inline std::string stl_text(const Source& m) {
  std::string out = "solid thing\n";
  for (const Triangle& t : m.triangles) {
    out += "  facet normal 0 0 0\n    outer loop\n";
    for (const std::uint32_t i : t)
      out += print("      vertex %.17g %.17g %.17g\n", m.vertices[i].x, m.vertices[i].y, m.vertices[i].z);
    out += "    endloop\n  endfacet\n";
  }
  return out + "endsolid thing\n";
}

inline std::string stl_binary(const Source& m, std::uint32_t promised = 0) {
  std::string out(80, '\0');
  out += bytes<std::uint32_t>(promised ? promised : static_cast<std::uint32_t>(m.triangles.size()));
  for (const Triangle& t : m.triangles) {
    out += std::string(12, '\0');
    for (const std::uint32_t i : t)
      for (int k = 0; k < 3; ++k) out += bytes(static_cast<float>(m.vertices[i][k]));
    out += std::string(2, '\0');
  }
  return out;
}

enum class Ply { kText, kLittle, kBig };

inline std::string ply(const Source& m, Ply kind) {
  const char* format = kind == Ply::kText     ? "ascii"
                       : kind == Ply::kLittle ? "binary_little_endian"
                                              : "binary_big_endian";
  std::string out = print("ply\nformat %s 1.0\ncomment for a test\nelement vertex %zu\n", format, m.vertices.size());
  out += "property float x\nproperty float y\nproperty float z\n";
  out += print("element face %zu\nproperty list uchar int vertex_indices\nend_header\n", m.triangles.size());
  const bool big = kind == Ply::kBig;
  for (const Vec3d& v : m.vertices)
    if (kind == Ply::kText)
      out += print("%.17g %.17g %.17g\n", v.x, v.y, v.z);
    else
      for (int k = 0; k < 3; ++k) out += bytes(static_cast<float>(v[k]), big);
  for (const Triangle& t : m.triangles)
    if (kind == Ply::kText) {
      out += print("3 %u %u %u\n", t[0], t[1], t[2]);
    } else {
      out += '\3';
      for (const std::uint32_t i : t) out += bytes(i, big);
    }
  return out;
}

/// What may differ from a plain DAE file.
struct DaeOptions {
  std::string up = "Z_UP", unit = "1", positions, indices;
  std::string scene = "<node id=\"n\"><instance_geometry url=\"#g\"/></node>";
};

inline std::string dae(const Source& m, const DaeOptions& options = {}) {
  std::string positions, indices;
  for (const Vec3d& v : m.vertices) positions += print("%.9g %.9g %.9g ", v.x, v.y, v.z);
  for (const Triangle& t : m.triangles) indices += print("%u %u %u ", t[0], t[1], t[2]);
  if (!options.positions.empty()) positions = options.positions;
  if (!options.indices.empty()) indices = options.indices;
  const std::string count = std::to_string(m.vertices.size());
  return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
         "<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">\n"
         "<asset><unit meter=\"" +
         options.unit + "\"/><up_axis>" + options.up +
         "</up_axis></asset>\n"
         "<library_geometries><geometry id=\"g\"><mesh>\n"
         "<source id=\"p\"><float_array id=\"pa\" count=\"" +
         std::to_string(3 * m.vertices.size()) + "\">" + positions +
         "</float_array>\n"
         "<technique_common><accessor source=\"#pa\" count=\"" +
         count +
         "\" stride=\"3\">"
         "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" "
         "type=\"float\"/></accessor></technique_common></source>\n"
         "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>\n"
         "<triangles count=\"" +
         std::to_string(m.triangles.size()) + "\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>" +
         indices +
         "</p></triangles>\n"
         "</mesh></geometry></library_geometries>\n"
         "<library_visual_scenes><visual_scene id=\"s\">" +
         options.scene +
         "</visual_scene></library_visual_scenes>\n"
         "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>\n";
}

inline std::string base64(const std::string& data) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < data.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = word << 8 | (i + k < data.size() ? static_cast<unsigned char>(data[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += i + k <= data.size() ? kDigits[word >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

/// Positions, then indices as uint32: the buffer of a glTF file.
inline std::string gltf_buffer(const Source& m) {
  std::string out;
  for (const Vec3d& v : m.vertices)
    for (int k = 0; k < 3; ++k) out += bytes(static_cast<float>(v[k]));
  for (const Triangle& t : m.triangles)
    for (const std::uint32_t i : t) out += bytes(i);
  return out;
}

/// \param nodes the JSON of the nodes; node 0 is the scene's. \param buffer_uri empty for GLB.
inline std::string gltf_json(const Source& m, const std::string& buffer_uri,
                             const std::string& nodes = "[{\"mesh\": 0}]", std::size_t promised_vertices = 0) {
  const std::size_t positions = 12 * m.vertices.size(), indices = 12 * m.triangles.size();
  const std::size_t vertices = promised_vertices ? promised_vertices : m.vertices.size();
  return "{\"asset\": {\"version\": \"2.0\"}, \"scene\": 0, \"scenes\": [{\"nodes\": [0]}], \"nodes\": " + nodes +
         ", \"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": 0}, \"indices\": 1}]}], \"accessors\": ["
         "{\"bufferView\": 0, \"componentType\": 5126, \"count\": " +
         std::to_string(vertices) +
         ", \"type\": \"VEC3\", \"min\": [-9, -9, -9], \"max\": [9, 9, 9]}, "
         "{\"bufferView\": 1, \"componentType\": 5125, \"count\": " +
         std::to_string(3 * m.triangles.size()) +
         ", \"type\": \"SCALAR\"}], \"bufferViews\": ["
         "{\"buffer\": 0, \"byteOffset\": 0, \"byteLength\": " +
         std::to_string(positions) +
         "}, "
         "{\"buffer\": 0, \"byteOffset\": " +
         std::to_string(positions) + ", \"byteLength\": " + std::to_string(indices) +
         "}], "
         "\"buffers\": [{\"byteLength\": " +
         std::to_string(positions + indices) + (buffer_uri.empty() ? "" : ", \"uri\": \"" + buffer_uri + "\"") + "}]}";
}

inline std::string gltf(const Source& m, const std::string& nodes = "[{\"mesh\": 0}]") {
  return gltf_json(m, "data:application/octet-stream;base64," + base64(gltf_buffer(m)), nodes);
}

inline std::string glb(const Source& m) {
  std::string json = gltf_json(m, ""), buffer = gltf_buffer(m);
  json.resize((json.size() + 3) / 4 * 4, ' ');
  buffer.resize((buffer.size() + 3) / 4 * 4, '\0');
  const auto u32 = [](std::size_t x) { return bytes(static_cast<std::uint32_t>(x)); };
  return "glTF" + u32(2) + u32(12 + 8 + json.size() + 8 + buffer.size()) + u32(json.size()) + "JSON" + json +
         u32(buffer.size()) + std::string("BIN\0", 4) + buffer;
}

}  // namespace clearance::mesh_files
