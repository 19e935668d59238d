#include "engine/mesh/readers/mesh_dae.h"

#include <assimp/DefaultIOSystem.h>
#include <assimp/MemoryIOWrapper.h>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/scene.h>
#include <sys/stat.h>

#include <algorithm>
#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <initializer_list>
#include <new>
#include <string>
#include <vector>

#include "engine/mesh/mesh_faces.h"
#include "engine/mesh/mesh_text.h"
#include "engine/mesh/mesh_transform.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

// Opens the file, whose content is there already, and other plain files inside its folder, for reading, and nothing
// else.
class FolderOnly final : public Assimp::DefaultIOSystem {
 public:
  FolderOnly(const fs::path& file, std::string_view content, const MeshFolder& folder)
      : file_(file.string()), content_(content), folder_(folder) {}

  bool Exists(const char* file) const override { return file == file_ || permitted(file); }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (std::strchr(mode, 'w') || std::strchr(mode, 'a') || std::strchr(mode, '+')) return nullptr;
    if (file == file_)
      return new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(content_.data()), content_.size());
    return permitted(file) ? DefaultIOSystem::Open(file, mode) : nullptr;
  }

 private:
  bool permitted(const char* file) const {
    struct stat info{};
    return folder_.holds(file) && ::stat(file, &info) == 0 && S_ISREG(info.st_mode);
  }

  const std::string file_;
  const std::string_view content_;
  const MeshFolder& folder_;
};

// assimp logs some things that leave a mesh with wrong geometry, and then calls the load a success. Others that it
// logs, such as a missing material, do no harm.
class GeometryLog final : public Assimp::LogStream {
 public:
  void write(const char* message) override {
    const std::string text = lower(message);
    const auto speaks_of = [&](std::initializer_list<const char*> words) {
      return std::any_of(words.begin(), words.end(), [&](const char* w) { return text.find(w) != std::string::npos; });
    };
    if (!first_.empty() ||
        speaks_of({"material", "texture", "normal", "uv", "color", "joint", "bone", "camera", "light"}))
      return;
    if (speaks_of({"out of range", "invalid face", "invalid index", "zero indices", "incorrect",
                   "unable to find geometry", "unable to resolve reference"}))
      first_ = message;
  }
  /// The first of them; empty if there was none.
  std::string first() const {
    std::string text = first_.substr(0, first_.find('\n'));
    for (const char* level : {"Error,", "Warn, "})  // "Error, T0: ..."
      if (text.compare(0, 6, level) == 0) text.erase(0, std::min(text.size(), text.find(": ") + 2));
    return text;
  }

 private:
  std::string first_;
};

MeshTransform transform_of(const aiMatrix4x4& t) {
  return {{{t.a1, t.a2, t.a3, t.a4}, {t.b1, t.b2, t.b3, t.b4}, {t.c1, t.c2, t.c3, t.c4}}, {}};
}

std::string label(const aiMesh& mesh, unsigned index) {
  const std::string name = mesh.mName.C_Str();
  return name.empty() ? "mesh " + std::to_string(index) : "mesh \"" + name.substr(0, 60) + '"';
}

MeshPart part_of(const aiMesh& mesh, unsigned index, bool has_fans) {
  MeshPart part;
  FaceList faces;
  part.positions.reserve(mesh.mNumVertices);
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const aiVector3D& v = mesh.mVertices[i];
    part.positions.push_back({v.x, v.y, v.z});
    if (std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)) continue;
    char text[128];
    std::snprintf(text, sizeof text, "(%g, %g, %g)", double(v.x), double(v.y), double(v.z));
    throw LoadError("vertex " + std::to_string(i) + " of " + label(mesh, index) + " is not finite: " + text);
  }
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    for (unsigned k = 0; k < face.mNumIndices; ++k)
      if (face.mIndices[k] >= mesh.mNumVertices)
        throw LoadError("face " + std::to_string(f) + " of " + label(mesh, index) + " points at vertex " +
                        std::to_string(face.mIndices[k]) + ", past the end of " + std::to_string(mesh.mNumVertices) +
                        " vertices");
    const std::span corners(face.mIndices, face.mNumIndices);
    if (has_fans)
      add_fan(&part.triangles, corners);
    else
      faces.add(corners, f);
  }
  if (!has_fans)
    part.triangles =
        faces.take_triangles(part.positions, &part.rounding, [&](std::size_t place, const std::string& what) {
          throw LoadError("face " + std::to_string(place) + " of " + label(mesh, index) + ": " + what);
        });
  return part;
}

struct Shown {
  unsigned mesh;
  MeshTransform X;
};

// Every mesh at every node that shows it, front to back.
std::vector<Shown> walk(const aiScene& scene, std::uint64_t most_vertices) {
  struct Visit {
    const aiNode* node;
    MeshTransform X;
  };
  std::vector<Shown> shown;
  std::vector<Visit> stack = {{scene.mRootNode, transform_of(scene.mRootNode->mTransformation)}};
  std::vector<char> seen(scene.mNumMeshes, 0);
  std::uint64_t vertices = 0, own = 0;
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    for (unsigned i = 0; i < visit.node->mNumMeshes; ++i) {
      const unsigned index = visit.node->mMeshes[i];
      if (index >= scene.mNumMeshes)
        throw LoadError("a node names mesh " + std::to_string(index) + ", which is not there");
      const std::uint64_t count = scene.mMeshes[index]->mNumVertices;
      own += seen[index]++ ? 0 : count;
      vertices += count;
      if (vertices > own && vertices > most_vertices)
        throw LoadError("its nodes repeat meshes to more than " + std::to_string(most_vertices) + " vertices");
      shown.push_back({index, visit.X});
    }
    for (unsigned i = visit.node->mNumChildren; i-- > 0;)
      stack.push_back(
          {visit.node->mChildren[i], visit.X.after(transform_of(visit.node->mChildren[i]->mTransformation))});
  }
  return shown;
}

// Leaves only the importer of the format: no guessing among the forty others from what a file begins with.
void keep_dae_importer(Assimp::Importer* importer) {
  for (std::size_t i = importer->GetImporterCount(); i-- > 0;) {
    const std::string list = ' ' + std::string(importer->GetImporterInfo(i)->mFileExtensions) + ' ';
    if (list.find(" dae ") == std::string::npos) importer->UnregisterLoader(importer->GetImporter(i));
  }
}

// What assimp says about a file that it cannot read, in fewer words.
std::string plainly(const std::string& text) {
  constexpr const char* kNoNumber = "Cannot parse string \"";
  if (text.compare(0, 24, "No suitable reader found") == 0) return "not a file of this format";
  if (text.compare(0, std::strlen(kNoNumber), kNoNumber) == 0) {
    const std::string rest = text.substr(std::strlen(kNoNumber));
    const std::string word = rest.substr(0, rest.find_first_of(" \t\r\n\""));
    return word.empty() ? "expected a number where the file ends or a line is short"
                        : "expected a number, got " + in_quotes(word);
  }
  return text.empty() ? "not a file of this format" : text.substr(0, 300);
}

}  // namespace

void read_dae(std::unique_ptr<Assimp::Importer>* kept, const fs::path& path, std::string_view content,
              const MeshFolder& folder, std::uint64_t most_vertices, const PartSink& sink) {
  const DaeFacts facts = check_dae(content);
  const double rounding = std::sqrt(3.0) * (1 + 1e-9) * facts.rounding;  // a length, of a bound on each coordinate
  Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
  auto* log = new GeometryLog;  // the logger owns it
  Assimp::DefaultLogger::get()->attachStream(log, Assimp::Logger::Err | Assimp::Logger::Warn);
  *kept = std::make_unique<Assimp::Importer>();
  Assimp::Importer* importer = kept->get();
  importer->SetIOHandler(new FolderOnly(path, content, folder));  // the importer owns it
  keep_dae_importer(importer);
  // Robot meshes are drawn in the link's frame, whatever up_axis their DAE names.
  importer->SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);  // made up by assimp where a file has no mesh
  const aiScene* scene = importer->ReadFile(path.string(), 0);
  if (!scene) {
    const std::string text = importer->GetErrorString();
    if (text.find("bad_alloc") != std::string::npos || text.find("bad allocation") != std::string::npos)
      throw std::bad_alloc();
    throw LoadError(plainly(text));
  }
  if (!log->first().empty()) throw LoadError(log->first());
  if (!scene->mRootNode || scene->mNumMeshes == 0) throw LoadError("it holds no mesh");
  for (const Shown& s : walk(*scene, most_vertices)) {
    MeshPart part = part_of(*scene->mMeshes[s.mesh], s.mesh, facts.has_fans);
    s.X.apply(&part);
    part.rounding += rounding;
    sink(std::move(part));
  }
}

}  // namespace clearance
