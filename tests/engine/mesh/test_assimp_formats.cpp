// Formats that assimp reads: geometry within the rounding that is charged, units, axes, and files that are damaged.
#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <minizip/zip.h>

#include <algorithm>
#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <fstream>
#include <iterator>
#include <random>

#include "engine/mesh/mesh.h"
#include "engine/mesh/mesh_formats.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using namespace mesh_files;

std::string content_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// A mesh as assimp's exporter writes it.
std::string exported(const TemporaryFolder& folder, const Source& source, const char* id) {
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(folder.write("exported.obj", obj(source)), 0);
  Assimp::Exporter exporter;
  const std::string path = folder / "exported.out";
  if (!scene || exporter.Export(scene, id, path) != aiReturn_SUCCESS)
    throw std::runtime_error(exporter.GetErrorString());
  return content_of(path);
}

// A 3MF file with this model, packed.
std::string packed_3mf(const TemporaryFolder& folder, const std::string& model) {
  const std::string path = folder / "packed.out";
  const zipFile zip = ::zipOpen64(path.c_str(), APPEND_STATUS_CREATE);
  const auto add = [zip](const char* name, const std::string& text) {
    if (::zipOpenNewFileInZip(zip, name, nullptr, nullptr, 0, nullptr, 0, nullptr, Z_DEFLATED, 6) != ZIP_OK ||
        ::zipWriteInFileInZip(zip, text.data(), static_cast<unsigned>(text.size())) != ZIP_OK ||
        ::zipCloseFileInZip(zip) != ZIP_OK)
      throw std::runtime_error("cannot pack a file");
  };
  add("_rels/.rels",
      "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\"><Relationship "
      "Target=\"/3D/3dmodel.model\" Id=\"r\" Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>"
      "</Relationships>");
  add("3D/3dmodel.model", model);
  ::zipClose(zip, nullptr);
  return content_of(path);
}

std::string model_3mf(const Source& m, const std::string& attributes, const std::string& transform = "") {
  std::string out =
      "<?xml version=\"1.0\"?><model xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"" + attributes +
      "><resources><object id=\"1\" type=\"model\"><mesh><vertices>";
  for (const Vec3d& v : m.vertices) out += print("<vertex x=\"%.9g\" y=\"%.9g\" z=\"%.9g\"/>", v.x, v.y, v.z);
  out += "</vertices><triangles>";
  for (const Triangle& t : m.triangles) out += print("<triangle v1=\"%u\" v2=\"%u\" v3=\"%u\"/>", t[0], t[1], t[2]);
  return out + "</triangles></mesh></object></resources><build><item objectid=\"1\"" + transform + "/></build></model>";
}

struct Format {
  std::string file, content;
  double metres = 1;  // of the file's unit
};

std::vector<Format> formats(const TemporaryFolder& folder, const Source& m) {
  return {{"a.3ds", exported(folder, m, "3ds")},
          {"a.fbx", exported(folder, m, "fbxa"), 0.01},
          {"metre.fbx", replaced(exported(folder, m, "fbxa"), "\"UnitScaleFactor\", \"double\", \"Number\", \"\", 1\n",
                                 "\"UnitScaleFactor\", \"double\", \"Number\", \"\", 100\n")},
          {"exported.3mf", exported(folder, m, "3mf"), 1e-3},
          {"a.3mf", packed_3mf(folder, model_3mf(m, " unit=\"inch\"")), 0.0254},
          {"a.x", exported(folder, m, "x")},
          {"exported.x3d", exported(folder, m, "x3d")},
          {"a.x3d", x3d(m)},
          {"unit.x3d", x3d(m, "<unit category=\"length\" name=\"mm\" conversionFactor=\"0.001\"/>"), 1e-3},
          {"a.ac", ac(m)},
          {"a.AMF", amf(m)},
          {"none.amf", amf(m, ""), 1e-3},
          {"foot.amf", amf(m, " unit=\"feet\""), 0.3048},
          {"a.ase", ase(m)},
          {"a.dxf", dxf(m)},
          {"mm.dxf", dxf(m, "4"), 1e-3},
          {"a.lwo", lwo(m)},
          {"a.raw", raw(m)},
          {"a.xgl", xgl(m)}};
}

double volume(const std::vector<Vec3d>& vertices, const std::vector<Triangle>& triangles) {
  double sum = 0;
  for (const Triangle& t : triangles) sum += dot(vertices[t[0]], cross(vertices[t[1]], vertices[t[2]])) / 6;
  return sum;
}

TEST(AssimpFormats, GeometryIsTheFilesWithinTheRoundingThatIsCharged) {
  const TemporaryFolder folder;
  const Source source = coarse_ball();
  const double wanted = volume(source.vertices, source.triangles);
  for (const Format& format : formats(folder, source)) {
    SCOPED_TRACE(format.file);
    const Mesh mesh = load_mesh(folder.write(format.file, format.content));
    ASSERT_EQ(mesh.submeshes.size(), 1u);
    const Submesh& part = mesh.submeshes[0];
    EXPECT_EQ(part.vertices.size(), source.vertices.size());
    EXPECT_EQ(part.triangles.size(), source.triangles.size());
    EXPECT_GT(part.rounding, 0);
    EXPECT_LE(part.rounding, 1e-4 * format.metres);
    for (const Vec3d& v : part.vertices) {
      double nearest = HUGE_VAL;
      for (const Vec3d& w : source.vertices) nearest = std::min(nearest, norm(v - format.metres * w));
      EXPECT_LE(nearest, part.rounding);
    }
    const double cube = format.metres * format.metres * format.metres;  // outward faces, in right-handed axes
    EXPECT_NEAR(volume(part.vertices, part.triangles), wanted * cube, 1e-3 * wanted * cube);
  }
}

TEST(AssimpFormats, RoundingCoversCoordinatesThatFloat32CannotHold) {
  const TemporaryFolder folder;
  Source far = tetrahedron();
  for (Vec3d& v : far.vertices) v = v + Vec3d{4300000.125, 0, 0};
  for (const Format& format :
       {Format{"a.raw", raw(far)}, {"a.amf", amf(far)}, {"a.x3d", x3d(far)}, {"a.dxf", dxf(far)}}) {
    SCOPED_TRACE(format.file);
    const Submesh part =
        load_mesh(folder.write(format.file, replaced(format.content, "4300000.12", "4300000.1"))).submeshes[0];
    EXPECT_GE(part.rounding, 0.1);
    EXPECT_LE(part.rounding, 100);
  }
}

TEST(AssimpFormats, TransformsOf3mfItemsAreApplied) {
  const TemporaryFolder folder;
  const std::string turned = " transform=\"0 2 0 -2 0 0 0 0 2 10 0 5\"";  // rows of the transposed matrix
  const Submesh part =
      load_mesh(folder.write("a.3mf", packed_3mf(folder, model_3mf(tetrahedron(), " unit=\"meter\"", turned))))
          .submeshes[0];
  for (const Vec3d& wanted : {Vec3d{10, 0, 5}, {10, 2, 5}, {8, 0, 5}, {10, 0, 7}})
    EXPECT_TRUE(std::any_of(part.vertices.begin(), part.vertices.end(),
                            [&](const Vec3d& v) { return norm(v - wanted) <= part.rounding; }));
}

TEST(AssimpFormats, UnitsAndContentThatAreNotReadAreErrors) {
  const TemporaryFolder folder;
  const Source good = tetrahedron();
  const auto pack = [&](const std::string& attributes, const std::string& transform = "") {
    return packed_3mf(folder, model_3mf(good, attributes, transform));
  };
  struct Bad {
    const char* file;
    std::string content;
    const char* error;
  };
  const Bad all[] = {
      {"a.3mf", pack(" unit=\"parsec\""),
       "unknown unit \"parsec\"; expected micron, millimeter, centimeter, meter, inch or foot"},
      {"b.3mf", pack(" requiredextensions=\"p\""), "it needs the extension \"p\", which is not read"},
      {"c.3mf", pack("", " transform=\"1 0 0\""), "a transform that is not 12 numbers"},
      {"d.3mf", "no archive", "not a 3MF file: no zip archive with a model"},
      {"e.3mf", packed_3mf(folder, replaced(model_3mf(good, ""), "x=\"1\"", "x=\"one\"")),
       "expected a finite number, got \"one\""},
      {"a.amf", amf(good, " unit=\"mile\""),
       "unknown unit \"mile\"; expected micron, millimeter, centimeter, meter, inch or foot"},
      {"b.amf", replaced(amf(good), "</coordinates>", "</coordinates><normal/>"),
       "a curved triangle (<normal>) is not read"},
      {"a.x3d", replaced(x3d(good), "<Scene>", "<Scene><Shape><Sphere/></Shape>"),
       "a <Sphere> is not read; export triangles instead"},
      {"b.x3d", x3d(good, "<unit category=\"length\" conversionFactor=\"0\"/>"),
       "its unit of length is 0.000000 metres; expected a positive number"},
      {"a.dxf", dxf(good, "13"),
       "line 8: unknown unit $INSUNITS \"13\"; expected 0, 1 (inch), 2 (foot), 4 (mm), 5 (cm) or 6"},
      {"b.dxf", replaced(dxf(good), "0\n3DFACE", "0\n3DSOLID\n0\n3DFACE"),
       "line 6: a 3DSOLID is not read; export 3DFACEs or polyface meshes instead"},
      {"a.ac", replaced(ac(good), "numvert", "subdiv 2\nnumvert"),
       "line 7: a subdivided surface is not read; export its triangles instead"},
      {"a.ifc", "ISO-10303-21;",
       "unknown format \".ifc\"; expected .obj, .stl, .ply, .off, .dae, .gltf, .glb, .3ds, .3mf, "},
  };
  for (const Bad& bad : all) {
    const std::string got = error_text<MeshError>([&] { load_mesh(folder.write(bad.file, bad.content)); });
    EXPECT_EQ(got.substr(0, std::string(bad.error).size()), bad.error) << bad.file << ": " << got;
  }
}

TEST(AssimpFormats, EachOfThemIsInTheListOfAssimp) {
  Assimp::Importer importer;
  for (const AssimpFormat& format : kAssimpFormats)
    EXPECT_TRUE(importer.IsExtensionSupported('.' + std::string(format.extension))) << format.extension;
}

// A damaged file gives a mesh or an error, within the limits of the loader.
TEST(AssimpFormats, DamagedFilesAreMeshesOrErrors) {
  const TemporaryFolder folder;
  MeshLimits limits;
  limits.time = std::chrono::milliseconds(20000);
  limits.memory_bytes = std::uint64_t{1} << 30;
  std::mt19937 random(7);
  int errors = 0, meshes = 0;
  for (const Format& format : formats(folder, tetrahedron())) {
    SCOPED_TRACE(format.file);
    const auto load = [&](const std::string& content) {
      try {
        for (const Submesh& part : load_mesh(folder.write(format.file, content), limits).submeshes)
          for (const Vec3d& v : part.vertices) EXPECT_TRUE(std::isfinite(v.x + v.y + v.z));
        ++meshes;
      } catch (const MeshError& error) {
        EXPECT_STRNE(error.what(), "");
        ++errors;
      }
    };
    const std::size_t size = format.content.size();
    for (std::size_t k = 0; k < 8; ++k) load(format.content.substr(0, 1 + k * (size - 1) / 8));
    for (int k = 0; k < 24; ++k) {
      std::string flipped = format.content;
      for (int bits = 0; bits <= k / 8; ++bits) {
        char& byte = flipped[random() % size];
        byte = static_cast<char>(byte ^ (1 << random() % 8));
      }
      load(flipped);
    }
  }
  EXPECT_GE(errors, 150);
  EXPECT_GE(meshes, 50);
}

}  // namespace
}  // namespace clearance
