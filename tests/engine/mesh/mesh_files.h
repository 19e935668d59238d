// Small mesh files of every format, as text or bytes, for tests that write, damage and read them.
#pragma once

#include <array>
#include <cmath>
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

/// Coordinates are multiples of 1/64 metre, which six decimals hold.
inline Source coarse_ball() {
  Source out = ball();
  for (Vec3d& v : out.vertices)
    for (int k = 0; k < 3; ++k) v[k] = std::round(64 * v[k]) / 64;
  return out;
}

inline std::string raw(const Source& m) {
  std::string out = "thing\n";
  for (const Triangle& t : m.triangles) {
    for (const std::uint32_t i : t) out += print("%.9g %.9g %.9g ", m.vertices[i].x, m.vertices[i].y, m.vertices[i].z);
    out += "\n";
  }
  return out;
}

inline std::string ac(const Source& m) {
  std::string out =
      "AC3Db\nMATERIAL \"m\" rgb 1 1 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0\nOBJECT world\nkids 1\n";
  out += print("OBJECT poly\nname \"thing\"\nnumvert %zu\n", m.vertices.size());
  for (const Vec3d& v : m.vertices) out += print("%.9g %.9g %.9g\n", v.x, v.y, v.z);
  out += print("numsurf %zu\n", m.triangles.size());
  for (const Triangle& t : m.triangles)
    out += print("SURF 0x0\nmat 0\nrefs 3\n%u 0 0\n%u 0 0\n%u 0 0\n", t[0], t[1], t[2]);
  return out + "kids 0\n";
}

/// \param unit of the root element, with its name, or nothing.
inline std::string amf(const Source& m, const std::string& unit = " unit=\"meter\"") {
  std::string out = "<?xml version=\"1.0\"?>\n<amf" + unit + " version=\"1.1\"><object id=\"0\"><mesh><vertices>\n";
  for (const Vec3d& v : m.vertices)
    out += print("<vertex><coordinates><x>%.9g</x><y>%.9g</y><z>%.9g</z></coordinates></vertex>\n", v.x, v.y, v.z);
  out += "</vertices><volume>\n";
  for (const Triangle& t : m.triangles)
    out += print("<triangle><v1>%u</v1><v2>%u</v2><v3>%u</v3></triangle>\n", t[0], t[1], t[2]);
  return out + "</volume></mesh></object></amf>\n";
}

inline std::string xgl(const Source& m) {
  std::string out = "<WORLD>\n<MESH ID=\"0\">\n<MAT ID=\"0\"><AMB>0,1,0</AMB><DIFF>0,1,0</DIFF></MAT>\n";
  for (std::size_t i = 0; i < m.vertices.size(); ++i)
    out += print("<P ID=\"%zu\">%.9g,%.9g,%.9g</P>\n", i, m.vertices[i].x, m.vertices[i].y, m.vertices[i].z);
  for (const Triangle& t : m.triangles) {
    out += "<F><MATREF>0</MATREF>";
    for (int k = 0; k < 3; ++k)
      out += print("<FV%d><PREF>%u</PREF></FV%d>", k + 1, t[static_cast<std::size_t>(k)], k + 1);
    out += "</F>\n";
  }
  return out + "</MESH>\n<OBJECT><MESHREF>0</MESHREF></OBJECT>\n</WORLD>\n";
}

/// \param insunits the unit's number in the header, or nothing.
inline std::string dxf(const Source& m, const std::string& insunits = "") {
  std::string out;
  if (!insunits.empty()) out += "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n" + insunits + "\n0\nENDSEC\n";
  out += "0\nSECTION\n2\nENTITIES\n";
  for (const Triangle& t : m.triangles) {
    out += "0\n3DFACE\n8\nlayer\n";
    for (int k = 0; k < 4; ++k) {
      const Vec3d& v = m.vertices[t[static_cast<std::size_t>(k < 3 ? k : 2)]];
      out += print("1%d\n%.9g\n2%d\n%.9g\n3%d\n%.9g\n", k, v.x, k, v.y, k, v.z);
    }
  }
  return out + "0\nENDSEC\n0\nEOF\n";
}

inline std::string ase(const Source& m) {
  std::string out = "*3DSMAX_ASCIIEXPORT 200\n*GEOMOBJECT {\n*NODE_NAME \"thing\"\n*NODE_TM {\n*NODE_NAME \"thing\"\n";
  out += "*TM_ROW0 1 0 0\n*TM_ROW1 0 1 0\n*TM_ROW2 0 0 1\n*TM_ROW3 0 0 0\n}\n*MESH {\n";
  out += print("*MESH_NUMVERTEX %zu\n*MESH_NUMFACES %zu\n*MESH_VERTEX_LIST {\n", m.vertices.size(), m.triangles.size());
  for (std::size_t i = 0; i < m.vertices.size(); ++i)
    out += print("*MESH_VERTEX %zu %.9g %.9g %.9g\n", i, m.vertices[i].x, m.vertices[i].y, m.vertices[i].z);
  out += "}\n*MESH_FACE_LIST {\n";
  for (std::size_t i = 0; i < m.triangles.size(); ++i) {
    const Triangle& t = m.triangles[i];
    out += print("*MESH_FACE %zu: A: %u B: %u C: %u AB: 1 BC: 1 CA: 1 *MESH_SMOOTHING 1 *MESH_MTLID 0\n", i, t[0], t[1],
                 t[2]);
  }
  return out + "}\n}\n}\n";
}

/// \param head content of the <head> element.
inline std::string x3d(const Source& m, const std::string& head = "") {
  std::string out = "<?xml version=\"1.0\"?>\n<X3D profile=\"Interchange\" version=\"3.3\"><head>" + head + "</head>";
  out += "<Scene><Shape><IndexedFaceSet coordIndex=\"";
  for (const Triangle& t : m.triangles) out += print("%u %u %u -1 ", t[0], t[1], t[2]);
  out += "\"><Coordinate point=\"";
  for (const Vec3d& v : m.vertices) out += print("%.9g %.9g %.9g ", v.x, v.y, v.z);
  return out + "\"/></IndexedFaceSet></Shape></Scene></X3D>\n";
}

/// LightWave is left-handed, and its faces are clockwise seen from outside.
inline std::string lwo(const Source& m) {
  std::string points, faces;
  for (const Vec3d& v : m.vertices)
    for (int k = 0; k < 3; ++k) points += bytes(static_cast<float>(k == 2 ? -v[k] : v[k]), true);
  for (const Triangle& t : m.triangles) {
    faces += bytes<std::uint16_t>(3, true);
    for (const int k : {0, 2, 1}) faces += bytes(static_cast<std::uint16_t>(t[static_cast<std::size_t>(k)]), true);
  }
  const auto chunk = [](const char* name, std::string data) {
    return name + bytes(static_cast<std::uint32_t>(data.size()), true) + data +
           (data.size() % 2 ? std::string(1, '\0') : "");
  };
  std::string body = "LWO2" + chunk("TAGS", std::string("s\0", 2)) + chunk("LAYR", std::string(18, '\0')) +
                     chunk("PNTS", points) + chunk("POLS", "FACE" + faces);
  return "FORM" + bytes(static_cast<std::uint32_t>(body.size()), true) + body;
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

/// \param buffer_uri empty for GLB
/// \param nodes the JSON of the nodes; node 0 is the scene's
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
