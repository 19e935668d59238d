// Errors for mesh files that are damaged or would grow without bound, and for files of other kinds.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>

#include "engine/base/sanitizers.h"
#include "engine/mesh/mesh.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using namespace mesh_files;

std::string without_end(std::string text, std::size_t n) {
  return text.substr(0, text.size() - n);
}

struct BadMesh {
  const char* file;
  std::string content;
  const char* error;
};

std::vector<BadMesh> bad_meshes() {
  const Source good = tetrahedron();
  Source nan = good, past = good, inf = good;
  nan.vertices[1].x = NAN;
  inf.vertices[2].y = INFINITY;
  past.triangles[3] = {0, 99, 2};
  const DaeOptions none;
  const auto dae_with = [&](auto change) {
    DaeOptions options;
    change(options);
    return dae(good, options);
  };
  const char* too_much_memory = "reading it takes more than 4096 MiB of memory; is the file damaged?";
  return {
      // What concerns every format.
      {"a.xyz", "1 2 3", "unknown format \".xyz\"; expected .obj, .stl, .ply, .off, .dae, .gltf, .glb, .3ds, .3mf, "},
      {"a", "1 2 3", "unknown format \"\"; expected .obj, .stl, .ply, .off, .dae, .gltf, .glb, .3ds, .3mf, "},
      {"empty.obj", "", "the file is empty"},
      {"empty.stl", "", "the file is empty"},
      {"empty.ply", "", "the file is empty"},
      {"empty.off", "", "the file is empty"},
      {"empty.dae", "", "the file is empty"},
      {"empty.gltf", "", "the file is empty"},
      {"empty.glb", "", "the file is empty"},
      // OBJ
      {"nan.obj", obj(nan), "line 4: expected a finite coordinate, got \"nan\""},
      {"inf.obj", obj(inf), "line 5: expected a finite coordinate, got \"inf\""},
      {"too_big.obj", replaced(obj(good), "v 1 0", "v 1e309 0"), "line 4: expected a finite coordinate, got \"1e309\""},
      {"short.obj", replaced(obj(good), "v 1 0 0", "v 1 0"),
       "line 4: expected a coordinate where the line or the file ends"},
      {"comma.obj", replaced(obj(good), "v 1 0 0", "v 1,5 0 0"), "line 4: expected a coordinate, got \"1,5\""},
      {"weight.obj", replaced(obj(good), "v 1 0 0", "v 1 0 0 0"), "line 4: a vertex has the weight 0"},
      {"past.obj", obj(past), "line 10: a face names vertex 100, and there are 4"},
      {"zero.obj", replaced(obj(good), "f 1 3 2", "f 0 3 2"), "line 7: a face names vertex 0, and there are 4"},
      {"before.obj", replaced(obj(good), "f 1 3 2", "f -9 3 2"), "line 7: a face names vertex -9, and there are 4"},
      {"words.obj", replaced(obj(good), "f 1 3 2", "f a b c"), "line 7: expected the number of a vertex, got \"a\""},
      {"lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n", "it holds points or lines only, no face with an area"},
      {"points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "it holds no mesh"},
      {"garbled.obj",
       "\x7f"
       "ELF\x02\x01\x01 nothing of ours at all, only words and \xff\xfe\xfd bytes",
       "it holds no mesh"},
      {"flat_faces.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2\nf 2 2 2\n",
       "it holds points or lines only, no face with an area"},
      // STL
      {"cut.stl", without_end(stl_binary(good), 30),
       "its header promises 4 facets (284 bytes), the file has 254 bytes"},
      {"few.stl", stl_binary(good, 3), "its header promises 3 facets, and more follow them"},
      {"few_and_more.stl", stl_binary(good, 2) + "more", "its header promises 2 facets, and more follow them"},
      {"zero.stl", stl_binary(good).replace(80, 4, 4, '\0'),
       "its header promises 0 facets (84 bytes), the file has 284 bytes"},
      {"solid_cut.stl", "solid" + without_end(stl_binary(good), 30).substr(5),
       "its header promises 4 facets (284 bytes), the file has 254 bytes"},
      {"second_cut.stl", stl_binary(good) + without_end(stl_binary(good), 30),
       "after its first solid: its header promises 4 facets (284 bytes), the file has 254 bytes"},
      {"no_end.stl", replaced(stl_text(good), "endsolid thing\n", ""),
       "the file ends early: no \"endsolid\" at its end"},
      {"zero_in_number.stl", replaced(stl_text(good), "vertex 0 1 0", std::string("vertex 0 1\0 0", 14)),
       "line 5: a zero byte in a coordinate"},
      {"outside.stl", stl_text(good) + replaced(replaced(stl_text(good), "solid thing\n", ""), "endsolid thing\n", ""),
       "facets follow the last \"endsolid\""},
      {"huge.stl", stl_binary(good, 4000000000u),
       "its header promises 4000000000 facets (200000000084 bytes), the file has 284 bytes"},
      {"short.stl", std::string(50, '\0'), "the file has 50 bytes, less than the header of a binary STL file"},
      {"none.stl", std::string(84, '\0'), "it holds no facet"},
      {"nan.stl", stl_binary(nan), "facet 0 has a corner that is not finite"},
      {"inf_text.stl", stl_text(inf), "line 5: expected a finite coordinate, got \"inf\""},
      {"cut_text.stl", without_end(stl_text(good), 60),
       "line 26: expected a coordinate where the line or the file ends"},
      {"half_text.stl", without_end(stl_text(good), 300), "the file ends early: no \"endsolid\" at its end"},
      {"none_text.stl", "solid x\nendsolid x\n", "it holds no mesh"},
      {"words.stl", replaced(stl_text(good), "vertex 0 1 0", "vertex a b c"),
       "line 5: expected a coordinate, got \"a\""},
      // PLY
      {"header.ply", ply(good, Ply::kText).substr(0, 60), "the file ends within its header: no \"end_header\""},
      {"cut.ply", without_end(ply(good, Ply::kText), 20),
       "the file ends within face 1 of the 4 that its header promises"},
      {"cut_vertices.ply", without_end(ply(good, Ply::kText), 40),
       "the file ends within vertex 2 of the 4 that its header promises"},
      {"cut_binary.ply", without_end(ply(good, Ply::kLittle), 20),
       "the file ends within face 2 of the 4 that its header promises"},
      {"cut_big.ply", without_end(ply(good, Ply::kBig), 60),
       "the file ends within vertex 3 of the 4 that its header promises"},
      {"huge.ply", replaced(ply(good, Ply::kLittle), "vertex 4", "vertex 4000000000"),
       "the file ends within vertex 8 of the 4000000000 that its header promises"},
      {"overflow.ply", replaced(ply(good, Ply::kLittle), "vertex 4", "vertex 99999999999999999999"),
       "its header: element vertex: expected a count, got \"99999999999999999999\""},
      {"negative.ply", replaced(ply(good, Ply::kText), "face 4", "face -4"),
       "its header: element face: expected a count, got \"-4\""},
      {"type.ply", replaced(ply(good, Ply::kText), "property float x", "property flaot x"),
       "its header: a property of element vertex has no known type"},
      {"format.ply", replaced(ply(good, Ply::kText), "ascii", "utf8"),
       "its header: unknown format \"utf8\"; expected ascii, binary_little_endian or binary_big_endian"},
      {"key.ply", replaced(ply(good, Ply::kText), "property float z", "propetry float z"),
       "its header: unexpected \"propetry\""},
      {"flat.ply", replaced(ply(good, Ply::kText), "property float z", "comment no z"),
       "its header: element vertex has no property \"z\""},
      {"flat_list.ply", replaced(ply(good, Ply::kText), "property float z", "property list uchar float z"),
       "its header: element vertex has no property \"z\""},
      {"no_vertex.ply", replaced(ply(good, Ply::kText), "element vertex", "element point"),
       "line 15: face 0: it names vertex 0, and there are 0, from 0"},
      {"no_list.ply", replaced(ply(good, Ply::kText), "vertex_indices", "corners"),
       "its header: element face has no list \"vertex_indices\" or \"vertex_index\""},
      {"float_list.ply", replaced(ply(good, Ply::kLittle), "list uchar", "list float"),
       "its header: the length of a list of element face is not an integer"},
      {"twice.ply", replaced(ply(good, Ply::kText), "element face", "element vertex"),
       "its header: element vertex comes twice"},
      {"minus.ply", replaced(ply(good, Ply::kText), "3 0 2 1", "3 0 -2 1"),
       "line 15: face 0: it names vertex -2, and there are 4, from 0"},
      {"magic.ply", replaced(ply(good, Ply::kText), "ply", "PLX"), "not a PLY file: it does not begin with \"ply\""},
      {"garbled.ply", replaced(ply(good, Ply::kText), "3 0 2 1", "x y z w"),
       "line 15: expected the length of a list, got \"x\""},
      {"nan.ply", ply(nan, Ply::kLittle), "vertex 1: a coordinate is not finite"},
      {"inf.ply", ply(inf, Ply::kText), "line 13: expected a finite number, got \"inf\""},
      {"past.ply", ply(past, Ply::kLittle), "face 3: it names vertex 99, and there are 4, from 0"},
      {"past_text.ply", ply(past, Ply::kText), "line 18: face 3: it names vertex 99, and there are 4, from 0"},
      {"points.ply", ply({good.vertices, {}}, Ply::kText), "it holds points or lines only, no face with an area"},
      // OFF
      {"cut.off", off(good).substr(0, 20), "line 4: expected a coordinate where the line or the file ends"},
      {"cut_faces.off", without_end(off(good), 8),
       "line 10: the file ends before face 3 of the 4 that its header promises"},
      {"past.off", off(past), "line 10: a face names vertex 99, and there are 4, from 0"},
      {"nan.off", off(nan), "line 4: expected a finite coordinate, got \"nan\""},
      {"words.off", replaced(off(good), "1 0 0", "x 0 0"), "line 4: expected a coordinate, got \"x\""},
      {"none.off", "OFF\n4 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n", "it holds points or lines only, no face with an area"},
      {"magic.off", replaced(off(good), "OFF", "FOO"), "line 1: not an OFF file: it begins with \"FOO\""},
      {"huge.off", replaced(off(good), "4 4 0", "4000000000 4 0"),
       "line 11: the file ends before vertex 8 of the 4000000000 that its header promises"},
      // DAE
      {"cut.dae", dae(good).substr(0, 700), "line 9: invalid XML: Start-end tags mismatch"},
      {"text.dae", "no xml at all", "line 1: invalid XML: No document element found"},
      {"nan.dae", dae_with([](auto& o) { o.positions = "nan 0 0 1 0 0 0 1 0 0 0 1"; }),
       "vertex 0 of mesh \"g\" is not finite: (nan, 0, 0)"},
      {"few.dae", dae_with([](auto& o) { o.positions = "0 0 0 1 0 0"; }),
       "Expected more values while reading float_array contents."},
      {"words.dae", dae_with([](auto& o) { o.positions = "a b c 1 0 0 0 1 0 0 0 1"; }), "expected a number, got \"a\""},
      {"entity.dae",
       replaced(dae_with([](auto& o) { o.positions = "&e; 0 0 1 0 0 0 1 0 0 0 1"; }), "<COLLADA",
                "<!DOCTYPE x [<!ENTITY e SYSTEM \"file:///etc/passwd\">]><COLLADA"),
       "expected a number, got \"&e;\""},
      {"past.dae", dae(past), "Invalid data index (99/4) in primitive specification"},
      {"negative.dae", dae_with([](auto& o) { o.indices = "0 2 1 0 1 3 1 2 3 0 -1 2"; }),
       "a face has a negative index"},
      {"few_indices.dae", dae_with([](auto& o) { o.indices = "0 2 1 0 1"; }),
       "Expected different index count in <p> element."},
      {"huge.dae",
       replaced(dae(good), "<float_array id=\"pa\" count=\"12\"", "<float_array id=\"pa\" count=\"3000000000\""),
       too_much_memory},
      {"nothing.dae", dae_with([](auto& o) { o.scene = "<node id=\"n\"/>"; }), "it holds no mesh"},
      {"who.dae", dae_with([](auto& o) { o.scene = "<node id=\"n\"><instance_geometry url=\"#who\"/></node>"; }),
       "Collada: Unable to find geometry for ID \"who\". Skipping."},
      {"nan_node.dae", dae_with([](auto& o) {
         o.scene = "<node id=\"n\"><translate>nan 0 0</translate><instance_geometry url=\"#g\"/></node>";
       }),
       "the transform of a node is not finite"},
      {"itself.dae", dae_with([](auto& o) { o.scene = "<node id=\"n\"><instance_node url=\"#n\"/></node>"; }),
       "its nodes repeat each other to more than 100000, or a node holds itself"},
      // glTF and GLB
      {"cut.gltf", gltf(good).substr(0, 300), "glTF: invalid JSON: "},
      {"nan.gltf", gltf(nan), "glTF: position 1 of accessors[0] is not finite"},
      {"no_mesh.gltf",
       replaced(gltf(good, "[{}]"),
                "\"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": 0}, \"indices\": 1}]}], ", ""),
       "it holds no mesh"},
      {"which.gltf", gltf(good, "[{\"mesh\": 7}]"), "glTF: meshes[7] is named, and there are 1"},
      {"circle.gltf", gltf(good, "[{\"mesh\": 0, \"children\": [0]}]"),
       "glTF: nodes[0] has two parents, or is its own ancestor"},
      {"large_node.gltf",
       gltf(good, "[{\"scale\": [1e308, 1, 1], \"children\": [1]}, {\"mesh\": 0, \"scale\": [1e308, 1, 1]}]"),
       "the transform of a node is not finite"},
      {"count.gltf",
       gltf_json(good, "data:application/octet-stream;base64," + base64(gltf_buffer(good)), "[{\"mesh\": 0}]",
                 4000000000u),
       "glTF: accessors[0].count: expected a count or index, got 4000000000"},
      {"lines.gltf", replaced(gltf(good), "\"indices\": 1", "\"indices\": 1, \"mode\": 1"),
       "it holds points or lines only, no face with an area"},
      {"base64.gltf", replaced(gltf(good), "base64,AAAA", "base64,AA*A"),
       "glTF: buffers[0].uri: character 2 is not base64"},
      {"short_base64.gltf", replaced(gltf(good), "base64,AAAA", "base64,"),
       "glTF: buffers[0].byteLength is 96, and there are 93 bytes"},
      {"short_view.gltf", replaced(gltf(good), "\"byteLength\": 48", "\"byteLength\": 44"),
       "glTF: accessors[0] has 4 rows, more than its bufferViews[0] holds"},
      {"long_view.gltf",
       replaced(gltf(good), "\"byteOffset\": 48, \"byteLength\": 48", "\"byteOffset\": 49, \"byteLength\": 48"),
       "glTF: bufferViews[1] ends at byte 97 of a buffer of 96"},
      {"past.gltf", gltf(past), "glTF: index 10 of accessors[1] names vertex 99, and there are 4, from 0"},
      {"quaternion.gltf", gltf(good, "[{\"mesh\": 0, \"rotation\": [0, 0, 0, 0]}]"),
       "glTF: nodes[0].rotation is not a unit quaternion"},
      {"draco.gltf",
       replaced(gltf(good), "\"scene\"", "\"extensionsRequired\": [\"KHR_draco_mesh_compression\"], \"scene\""),
       "glTF: it needs the extension KHR_draco_mesh_compression, which is not read"},
      {"quantized.gltf",
       replaced(gltf(good), "\"scene\"", "\"extensionsRequired\": [\"KHR_mesh_quantization\"], \"scene\""),
       "glTF: it needs the extension KHR_mesh_quantization, which is not read"},
      {"unknown.gltf",
       replaced(gltf(good), "\"scene\"",
                "\"extensionsRequired\": [\"KHR_materials_unlit\", \"ACME_folds\"], \"scene\""),
       "glTF: it needs the extension ACME_folds, which is not read"},
      {"required.gltf", replaced(gltf(good), "\"scene\"", "\"extensionsRequired\": \"ACME_folds\", \"scene\""),
       "glTF: extensionsRequired: expected a list"},
      {"instances.gltf", gltf(good, "[{\"mesh\": 0, \"extensions\": {\"EXT_mesh_gpu_instancing\": {}}}]"),
       "glTF: nodes[0] has the extension EXT_mesh_gpu_instancing, which is not read"},
      {"child.gltf",
       gltf(good, "[{\"mesh\": 0, \"children\": [1]}, {\"extensions\": {\"EXT_mesh_gpu_instancing\": {}}}]"),
       "glTF: nodes[1] has the extension EXT_mesh_gpu_instancing, which is not read"},
      {"primitive.gltf",
       replaced(gltf(good), "\"indices\": 1",
                "\"indices\": 1, \"extensions\": {\"KHR_draco_mesh_compression\": {\"bufferView\": 0}}"),
       "glTF: meshes[0].primitives[0] has the extension KHR_draco_mesh_compression, which is not read"},
      {"view.gltf",
       replaced(gltf(good), "\"bufferViews\": [{",
                "\"bufferViews\": [{\"extensions\": {\"EXT_meshopt_compression\": {}}, "),
       "glTF: bufferViews[0] has the extension EXT_meshopt_compression, which is not read"},
      {"accessor.gltf",
       replaced(gltf(good), "\"accessors\": [{", "\"accessors\": [{\"extensions\": {\"ACME_folds\": {}}, "),
       "glTF: accessors[0] has the extension ACME_folds, which is not read"},
      {"centre.gltf",
       replaced(gltf(good), "\"scene\"", "\"extensions\": {\"CESIUM_RTC\": {\"center\": [1, 2, 3]}}, \"scene\""),
       "glTF: the file has the extension CESIUM_RTC, which is not read"},
      {"skin.gltf", gltf(good, "[{\"mesh\": 0, \"skin\": 0}]"), "glTF: skins[0] is named, and there are 0"},
      {"morphed.gltf", gltf(good, "[{\"mesh\": 0, \"weights\": [0, 0.5]}]"),
       "glTF: nodes[0].weights: it applies morph targets, which are not read; expected zeros"},
      {"morphed_mesh.gltf", replaced(gltf(good), "\"primitives\"", "\"weights\": [1], \"primitives\""),
       "glTF: meshes[0].weights: it applies morph targets, which are not read; expected zeros"},
      {"negative.gltf", replaced(gltf(good), "\"count\": 4", "\"count\": -4"),
       "glTF: accessors[0].count: expected a count or index, got -4"},
      {"cut.glb", without_end(glb(good), 30), "its header promises "},
      {"stub.glb", glb(good).substr(0, 10), "the file ends within its header"},
      {"magic.glb", replaced(glb(good), "glTF", "XXXX"), "not a GLB file: it does not begin with \"glTF\""},
      {"version.glb", glb(good).substr(0, 4) + bytes(std::uint32_t{9}) + glb(good).substr(8),
       "version 9 of GLB; expected 2"},
      {"chunk.glb", glb(good).substr(0, 12) + bytes(std::uint32_t{0xfffffff0}) + glb(good).substr(16),
       "a chunk of 4294967280 bytes goes past the end of the file"},
  };
}

TEST(Mesh, EveryDamagedFileIsRejectedWithItsCause) {
  const TemporaryFolder folder;
  int cases = 0;
  for (const BadMesh& bad : bad_meshes()) {
#if defined(CLEARANCE_ASAN)
    // The sanitizer ends the loader by itself where memory runs out or an allocation is absurd.
    if (std::string(bad.error).find("MiB of memory") != std::string::npos) continue;
#endif
    const std::string got = error_text<MeshError>([&] { load_mesh(folder.write(bad.file, bad.content)); });
    EXPECT_EQ(got.substr(0, std::string(bad.error).size()), bad.error) << bad.file << ": " << got;
    ++cases;
  }
  EXPECT_GE(cases, 60);
  EXPECT_EQ(load_mesh(folder.write("good.obj", obj(tetrahedron()))).submeshes.size(), 1u);  // and a good one after them
}

// Small files whose nodes multiply are rejected by counting alone, so that little memory suffices.
TEST(Mesh, NodesThatMultiplyAreRejectedBeforeTheyAreMade) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  MeshLimits limits;
  limits.memory_bytes = std::uint64_t{768} << 20;
  const auto error = [&](const char* file, const std::string& text) {
    return error_text<MeshError>([&] { load_mesh(folder.write(file, text), limits); });
  };
  constexpr int kDepth = 40;  // 2^40 nodes
  std::string nodes = "[", library, many = "[{\"children\": [1";
  for (int i = 0; i < kDepth; ++i) {
    nodes += print("{\"children\": [%d, %d]}, ", i + 1, i + 1);
    library +=
        print("<node id=\"n%d\"><instance_node url=\"#n%d\"/><instance_node url=\"#n%d\"/></node>", i, i + 1, i + 1);
  }
  EXPECT_EQ(error("a.gltf", gltf(source, nodes + "{\"mesh\": 0}]")),
            "glTF: nodes[1] has two parents, or is its own ancestor");
  DaeOptions options;
  options.scene =
      "<node id=\"r\">" + library + print("<node id=\"n%d\"><instance_geometry url=\"#g\"/></node></node>", kDepth);
  EXPECT_EQ(error("a.dae", dae(source, options)),
            "its nodes repeat each other to more than 100000, or a node holds itself");

  // Many nodes that show one large mesh: 300 x 19,802 vertices, and more corners of faces.
  const Shape ball = make_uv_sphere(1, 100);
  const Source large{ball.vertices, ball.triangles};
  std::string list;
  options.scene.clear();
  for (int i = 1; i <= 300; ++i) {
    many += i == 1 ? "" : print(", %d", i);
    list += ", {\"mesh\": 0}";
    options.scene +=
        print("<node id=\"n%d\"><translate>%d 0 0</translate><instance_geometry url=\"#g\"/></node>", i, i);
  }
  EXPECT_EQ(error("b.gltf", gltf(large, many + "]}" + list + "]")),
            "glTF: its nodes repeat meshes to more than 20000000 vertices");
  EXPECT_EQ(error("b.dae", dae(large, options)), "its nodes repeat meshes to more than 20000000 vertices");
  // Many accessors on the same bytes.
  std::string accessors, primitives;
  for (int i = 0; i < 400; ++i) {
    accessors += print("{\"bufferView\": 0, \"componentType\": 5126, \"count\": %zu, \"type\": \"VEC3\"}, ",
                       large.vertices.size());
    primitives += print("{\"attributes\": {\"POSITION\": %d}, \"indices\": 401}, ", i);
  }
  std::string text = replaced(gltf(large), "\"primitives\": [", "\"primitives\": [" + primitives);
  text = replaced(text, "\"accessors\": [", "\"accessors\": [" + accessors);
  text = replaced(text, "{\"attributes\": {\"POSITION\": 0}, \"indices\": 1}",
                  "{\"attributes\": {\"POSITION\": 400}, \"indices\": 401}");
  EXPECT_EQ(error("d.gltf", text), "glTF: its accessors read the same bytes too often");
  // A few are as they were.
  EXPECT_EQ(load_mesh(folder.write("c.gltf", gltf(source, "[{\"children\": [1, 2]}, {\"mesh\": 0}, {\"mesh\": 0}]")))
                .submeshes.size(),
            2u);
}

TEST(Mesh, ThingsThatAreNoMeshFile) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& path, const MeshLimits& limits = {}) {
    return error_text<MeshError>([&] { load_mesh(path, limits); });
  };
  EXPECT_EQ(error(folder / "none.obj"), "No such file or directory");
  std::filesystem::create_directory(folder / "folder.obj");
  EXPECT_EQ(error(folder / "folder.obj"), "expected a mesh file, got a folder");
  ASSERT_EQ(::mkfifo((folder / "pipe.obj").c_str(), 0600), 0);
  EXPECT_EQ(error(folder / "pipe.obj"), "expected a mesh file, got a device, pipe or socket");
  const std::string good = folder.write("good.obj", obj(tetrahedron()));
  MeshLimits limits;
  limits.file_bytes = 10;
  EXPECT_EQ(error(good, limits), std::to_string(obj(tetrahedron()).size()) + " bytes; a mesh file may have at most 10");
  if (::geteuid() != 0) {  // root may read everything
    ::chmod(good.c_str(), 0);
    EXPECT_EQ(error(good), "Permission denied");
  }
}

}  // namespace
}  // namespace clearance
