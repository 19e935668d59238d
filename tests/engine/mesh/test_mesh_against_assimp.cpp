// The meshes of scenes/ as this project and as assimp read them: the same vertices to float32, faces and submeshes.
#include <assimp/config.h>
#include <assimp/scene.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <filesystem>
#include <functional>
#include <set>

#include "engine/base/dedupe.h"
#include "engine/mesh/mesh.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/source_file.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

// The meshes that assimp reads from a file: each mesh at each node, duplicates merged.
std::vector<Submesh> by_assimp(const std::string& path) {
  Assimp::Importer importer;
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  const aiScene* scene = importer.ReadFile(path, 0);
  std::vector<Submesh> out;
  if (!scene) return out;
  const std::function<void(const aiNode*, const aiMatrix4x4&)> walk = [&](const aiNode* node,
                                                                          const aiMatrix4x4& above) {
    const aiMatrix4x4 X = above * node->mTransformation;
    for (unsigned i = 0; i < node->mNumMeshes; ++i) {
      const aiMesh& mesh = *scene->mMeshes[node->mMeshes[i]];
      const auto unique = unique_positions<float>(mesh.mNumVertices, [&](std::size_t k) {
        return Vec3<float>{mesh.mVertices[k].x, mesh.mVertices[k].y, mesh.mVertices[k].z};
      });
      Submesh part;
      for (const Vec3<float>& v : unique.positions) {
        const aiVector3D p = X * aiVector3D(v.x, v.y, v.z);
        part.vertices.push_back({p.x, p.y, p.z});
      }
      for (unsigned f = 0; f < mesh.mNumFaces; ++f)
        for (unsigned k = 1; k + 1 < mesh.mFaces[f].mNumIndices; ++k) {
          const unsigned* corner = mesh.mFaces[f].mIndices;
          const Triangle t = {unique.index[corner[0]], unique.index[corner[k]], unique.index[corner[k + 1]]};
          if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) part.triangles.push_back(t);
        }
      out.push_back(std::move(part));
    }
    for (unsigned i = 0; i < node->mNumChildren; ++i) walk(node->mChildren[i], X);
  };
  walk(scene->mRootNode, aiMatrix4x4());
  return out;
}

void expect_the_same(const std::string& path, std::size_t submeshes = 0) {
  SCOPED_TRACE(path);
  const std::vector<Submesh> theirs = by_assimp(path), ours = load_mesh(path).submeshes;
  ASSERT_EQ(ours.size(), theirs.size());
  if (submeshes > 0) {
    EXPECT_EQ(ours.size(), submeshes);
  }
  for (std::size_t i = 0; i < ours.size(); ++i) {
    ASSERT_EQ(ours[i].vertices.size(), theirs[i].vertices.size()) << "submesh " << i;
    double size = 0, off = 0;
    for (std::size_t k = 0; k < ours[i].vertices.size(); ++k) {
      size = std::max(size, norm(ours[i].vertices[k]));
      off = std::max(off, norm(ours[i].vertices[k] - theirs[i].vertices[k]));
    }
    EXPECT_LE(off, 4e-7 * size) << "submesh " << i;
    EXPECT_EQ(ours[i].triangles, theirs[i].triangles) << "submesh " << i;
  }
}

TEST(MeshAgainstAssimp, EveryMeshOfTheScenes) {
  std::set<std::string> extensions;
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(source_file("scenes"))) {
    const std::string extension = entry.path().extension().string();
    if (entry.path().parent_path().filename() != "meshes") continue;
    extensions.insert(extension);
    ++files;
    expect_the_same(entry.path().string());
  }
  EXPECT_EQ(extensions, (std::set<std::string>{".dae", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl"}));
  EXPECT_GE(files, 25);
}

TEST(MeshAgainstAssimp, ObjectsGroupsAndMaterialsOfAnObjFile) {
  const TemporaryFolder folder;
  std::string vertices;
  for (int i = 0; i < 30; ++i)
    vertices += "v " + std::to_string(i % 5) + " " + std::to_string(i % 3) + " " + std::to_string(i) + "\n";
  const auto face = [](int i) {
    return "f " + std::to_string(i) + " " + std::to_string(i + 1) + " " + std::to_string(i + 2) + "\n";
  };
  const std::pair<std::string, std::size_t> files[] = {
      {face(1) + face(4), 1},
      {"o a\n" + face(1) + "o b\n" + face(4), 2},
      {"g a\n" + face(1) + "g a\n" + face(4) + "g b\n" + face(7) + "g a\n" + face(10), 3},
      {"usemtl red\n" + face(1) + "usemtl blue\n" + face(4) + "usemtl red\n" + face(7), 3},
      {"usemtl red\no a\n" + face(1) + "usemtl red\n" + face(4) + "usemtl blue\n" + face(7) + "o b\n" + face(10), 3},
      {face(1) + "usemtl red\n" + face(4) + "usemtl blue\n" + face(7), 2},
      {"o a\ng one\n" + face(1) + "g two\ns 1\n" + face(4), 2},
      {"o a\n" + face(1) + "l 20 21\n" + "f 1 2 3 4 5 6\nf -1 -2 -3\n", 1},
  };
  for (const auto& [text, count] : files) expect_the_same(folder.write("a.obj", vertices + text), count);
}

}  // namespace
}  // namespace clearance
