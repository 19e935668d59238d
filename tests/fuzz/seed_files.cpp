// Seeds of the targets that read files.
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <assimp/Importer.hpp>
#include <fstream>
#include <map>
#include <memory>
#include <stdexcept>

#include "engine/geometry/mesh_geometry.h"
#include "engine/hull/hull.h"
#include "engine/mesh/readers/mesh_import.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/fuzz/mesh_extension.h"
#include "tests/fuzz/seeds.h"

namespace clearance::fuzz {
namespace {

void save_meshes() {
  using namespace mesh_files;
  const Source thing = tetrahedron();
  const std::pair<const char*, std::string> files[] = {{"obj", obj(thing)},
                                                       {"stl", stl_text(thing)},
                                                       {"stl", stl_binary(thing)},
                                                       {"ply", ply(thing, Ply::kText)},
                                                       {"ply", ply(thing, Ply::kLittle)},
                                                       {"ply", ply(thing, Ply::kBig)},
                                                       {"off", off(thing)},
                                                       {"dae", dae(thing)},
                                                       {"glb", glb(thing)},
                                                       {"gltf", gltf(thing)},
                                                       {"ac", ac(thing)},
                                                       {"amf", amf(thing)},
                                                       {"ase", ase(thing)},
                                                       {"dxf", dxf(thing, "4")},
                                                       {"lwo", lwo(thing)},
                                                       {"raw", raw(thing)},
                                                       {"x3d", x3d(thing)},
                                                       {"xgl", xgl(thing)}};
  std::map<std::string, int> count;
  for (const auto& [extension, text] : files) {
    Data input;
    std::uint8_t format = 0;
    while (std::string(kMeshExtensions[format]) != extension) ++format;
    add(input, format);
    wire::append_bytes(input, text.data(), text.size());
    const std::string name = "good_" + std::string(extension) + "_" + std::to_string(++count[extension]);
    for (const char* target : {"mesh_readers", "mesh_child", "mesh_import"}) save(target, name, input);
  }
  // A loader's result for one of them.
  const std::string path = (seeds_folder() / "thing.obj").string();
  const std::string content = obj(thing);
  std::ofstream(path) << content;
  const int fd = ::memfd_create("seeds", MFD_CLOEXEC);
  std::unique_ptr<Assimp::Importer> kept;
  if (!import_mesh(&kept, path, content, 1 << 20, fd)) throw std::runtime_error("no result for a mesh");
  fs::remove(path);
  Data result(1);
  result.resize(1 + static_cast<std::size_t>(::lseek(fd, 0, SEEK_END)));
  if (::pread(fd, result.data() + 1, result.size() - 1, 0) < 0) throw std::runtime_error("the result cannot be read");
  save("mesh_result", "good_tetrahedron", result);
}

void save_scenes() {
  const std::pair<const char*, const char*> scenes[] = {
      {"good_shapes",
       "bodies:\n"
       "  - {name: base, box: [1, 2, 0.1], static: true, pose: [0, 0, 0, 1, 0, 0, 0]}\n"
       "  - {name: cup, sphere: 0.1, parent: gripper}\n"
       "  - {name: gripper, capsule: [0.05, 0.2], pose: [1, 0, 0, 1, 0, 0, 0]}\n"
       "  - {name: can, cylinder: [0.04, 0.1]}\n"
       "  - {name: tip, points: [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0]], radius: 0.01}\n"
       "  - {name: ball, uv_sphere: {radius: 1, resolution: 5}}\n"
       "groups: {arm: [gripper, cup], \"rest\": [can]}\n"
       "ignore: [[base, can], [arm, arm]]\n"},
      {"good_random", "random: {count: 10, shape: {box: [1, 1, 1]}, box: 60, seed: 1}\n"},
      {"good_anchors", "bodies:\n  - &a {name: one, sphere: 1}\n  - {name: two, sphere: 1e0}\n"},
      {"bad_mesh_elsewhere", "bodies:\n  - {name: one, mesh: ../secret.obj}\n"},
      {"bad_mesh_missing", "bodies:\n  - {name: one, mesh: one.obj, scale: [1, 1, -1], mesh_as: parts}\n"},
      {"bad_solid_missing", "bodies:\n  - {name: one, mesh: one.obj, mesh_as: solid}\n"},
      {"bad_robot_of_surfaces", "robots:\n  - {name: r, urdf: r.urdf, mesh_as: {hand: surface, arm: solid}}\n"},
      {"bad_alias", "a: &a [*a, *a]\n"},
      {"bad_cycle", "bodies:\n  - {name: a, sphere: 1, parent: b}\n  - {name: b, sphere: 1, parent: a}\n"}};
  for (const auto& [name, text] : scenes) save("scene_file", name, data_of(text));
}

void save_robots() {
  const auto text_of = [](const char* name) {
    std::ifstream file(fs::path(CLEARANCE_SOURCE_DIR) / "tests" / "engine" / "robot" / name);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  const std::string urdf = text_of("every_joint.urdf");
  save("robot_files", "good_urdf", data_of(urdf));
  save("robot_files", "good_urdf_and_srdf", data_of(urdf + '\0' + text_of("every_joint.srdf")));
  save("robot_files", "bad_cycle",
       data_of("<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='fixed'><parent link='a'/><child "
               "link='b'/></joint><joint name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>"));
  save("robot_files", "bad_group_in_itself",
       data_of(urdf + '\0' + "<robot name='every_joint'><group name='g'><group name='g'/></group></robot>"));
}

void save_cache_entries() {
  const Shape ball = make_uv_sphere(1, 7);  // large enough for a direction table
  const auto save_record = [](const std::string& name, const Geometry& geometry) {
    const Data record = geometry_record(geometry);
    Data input;
    add(input, std::uint8_t{1});
    wire::append_bytes(input, record.data(), record.size());
    save("cache_entry", name, input);
  };
  Geometry round;
  round.parts = {make_hull_part(ball.vertices, ball.triangles, 0.1)};
  save_record("good_ball", round);
  save_record("good_two_pieces", [] {
    Geometry two = geometry_of_shape(make_box({1, 2, 3}), 0, "box");
    two.parts.push_back(make_convex_part({{0, 0, 5}}, 1));
    two.model_error = 0.25;
    return two;
  }());
  for (const MeshAs how : {MeshAs::kSurface, MeshAs::kSolid})
    save_record("good_" + std::string(word_of(how)),
                geometry_of_triangles(std::span(ball.vertices), ball.triangles, how, 0.25));
  Data raw(65);
  save("cache_entry", "bad_zeros", raw);
}

}  // namespace

void save(const std::string& target, const std::string& name, const Data& data) {
  fs::create_directories(seeds_folder() / target);
  std::ofstream file(seeds_folder() / target / name, std::ios::binary);
  file.write(reinterpret_cast<const char*>(data.data()), static_cast<std::streamsize>(data.size()));
  if (!file.flush()) throw std::runtime_error("cannot write " + (seeds_folder() / target / name).string());
}

void save_files() {
  save_meshes();
  save_robots();
  save_scenes();
  save_cache_entries();
}

}  // namespace clearance::fuzz
