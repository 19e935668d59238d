#include "engine/mesh/readers/assimp_file.h"

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
#include <utility>

#include "engine/mesh/mesh_faces.h"
#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

constexpr double kUnderflow = 1.2e-38;  // underflow in float32

// Opens the mesh file from memory and other plain files of its folder from disk, for reading only.
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

// Finds the messages of assimp's log that leave a mesh with wrong geometry although assimp reports success.
class GeometryLog final : public Assimp::LogStream {
 public:
  explicit GeometryLog(bool is_dae) : is_dae_(is_dae) {}

  void write(const char* message) override {
    const std::string text = lower(message);
    const auto has_one_of = [&](std::initializer_list<const char*> words) {
      return std::any_of(words.begin(), words.end(), [&](const char* w) { return text.find(w) != std::string::npos; });
    };
    if (!first_.empty() ||
        has_one_of({"material", "texture", "normal", "uv", "color", "joint", "bone", "camera", "light"}))
      return;
    if (!is_dae_ && has_one_of({"map", "shader", "skin", "tangent", "video", "channel", "clip", "weight", "cluster",
                                "key", "animation", "format version", "file version", "ignored file of"}))
      return;
    if (has_one_of({"out of range", "invalid face", "invalid index", "zero indices", "incorrect",
                    "unable to find geometry", "unable to resolve reference"}) ||
        (!is_dae_ && has_one_of({"overflow", "skipping", "ignoring", "will be ignored", "not currently", "unsupported",
                                 "not supported", "unexpected", "bad triangle", "out of bounds", "invalid vertex",
                                 "outside the allowed range", "failed to resolve block"})))
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
  const bool is_dae_;
  std::string first_;
};

std::string label(const aiMesh& mesh, unsigned index) {
  const std::string name = mesh.mName.C_Str();
  return name.empty() ? "mesh " + std::to_string(index) : "mesh \"" + name.substr(0, 60) + '"';
}

MeshTransform transform_of(const aiMatrix4x4& t) {
  return {{{t.a1, t.a2, t.a3, t.a4}, {t.b1, t.b2, t.b3, t.b4}, {t.c1, t.c2, t.c3, t.c4}}, {}};
}

// Condition number of the linear part in the maximum norm; 1 if it has no inverse, since assimp then has none either.
double condition(const MeshTransform& X) {
  const double det = X.determinant();
  if (det == 0 || !std::isfinite(det)) return 1;
  double norm = 0, inverse = 0;
  for (int r = 0; r < 3; ++r) {
    double row = 0, inverse_row = 0;
    for (int c = 0; c < 3; ++c) {
      const int r1 = (c + 1) % 3, r2 = (c + 2) % 3, c1 = (r + 1) % 3, c2 = (r + 2) % 3;
      row += std::abs(X.m[r][c]);
      inverse_row += std::abs((X.m[r1][c1] * X.m[r2][c2] - X.m[r1][c2] * X.m[r2][c1]) / det);
    }
    norm = std::max(norm, row);
    inverse = std::max(inverse, inverse_row);
  }
  return norm * inverse;
}

// Leaves only the importers of one format, so that assimp does not guess among the others by a file's first bytes.
void keep_importer(Assimp::Importer* importer, const std::string& extension) {
  for (std::size_t i = importer->GetImporterCount(); i-- > 0;) {
    const std::string list = ' ' + std::string(importer->GetImporterInfo(i)->mFileExtensions) + ' ';
    if (list.find(' ' + extension + ' ') == std::string::npos) importer->UnregisterLoader(importer->GetImporter(i));
  }
  if (importer->GetImporterCount() == 0) throw LoadError("the installed assimp does not read ." + extension);
}

// assimp's error for a file that it cannot read, in fewer words.
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

AssimpFile::AssimpFile(std::unique_ptr<Assimp::Importer>* kept, const fs::path& path, std::string_view content,
                       const MeshFolder& folder, AssimpSettings settings)
    : settings_(std::move(settings)) {
  Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
  auto* log = new GeometryLog(settings_.extension == "dae");  // the logger owns it
  Assimp::DefaultLogger::get()->attachStream(log, Assimp::Logger::Err | Assimp::Logger::Warn);
  *kept = std::make_unique<Assimp::Importer>();
  Assimp::Importer* importer = kept->get();
  importer->SetIOHandler(new FolderOnly(path, content, folder));  // the importer owns it
  keep_importer(importer, settings_.extension);
  // Robot meshes are drawn in the link's frame, whatever up_axis their DAE names.
  importer->SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);  // made up by assimp where a file has no mesh
  importer->SetPropertyBool(AI_CONFIG_IMPORT_MD3_HANDLE_MULTIPART, false);  // would read head.md3 and others
  scene_ = importer->ReadFile(path.string(), 0);
  if (!scene_) {
    const std::string text = importer->GetErrorString();
    if (text.find("bad_alloc") != std::string::npos || text.find("bad allocation") != std::string::npos)
      throw std::bad_alloc();
    throw LoadError(plainly(text));
  }
  if (!log->first().empty()) throw LoadError(log->first());
  if (!scene_->mRootNode || scene_->mNumMeshes == 0) throw LoadError("it holds no mesh");
}

double AssimpFile::worst_condition() const {
  double worst = 1;
  std::vector<const aiNode*> stack = {scene_->mRootNode};
  while (!stack.empty()) {
    const aiNode* node = stack.back();
    stack.pop_back();
    worst = std::max(worst, condition(transform_of(node->mTransformation)));
    stack.insert(stack.end(), node->mChildren, node->mChildren + node->mNumChildren);
  }
  return worst;
}

MeshPart AssimpFile::part(unsigned index) const {
  const aiMesh& mesh = *scene_->mMeshes[index];
  MeshPart part;
  FaceList faces;
  double size = 0;
  part.positions.reserve(mesh.mNumVertices);
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const aiVector3D& v = mesh.mVertices[i];
    part.positions.push_back({v.x, v.y, v.z});
    size = std::max({size, std::abs(double(v.x)), std::abs(double(v.y)), std::abs(double(v.z))});
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
    if (settings_.has_fans)
      add_fan(&part.triangles, corners);
    else
      faces.add(corners, f);
  }
  if (!settings_.has_fans)
    part.triangles =
        faces.take_triangles(part.positions, &part.rounding, [&](std::size_t place, const std::string& what) {
          throw LoadError("face " + std::to_string(place) + " of " + label(mesh, index) + ": " + what);
        });
  if (settings_.position_rounding > 0)
    part.rounding += std::sqrt(3.0) * (1 + 1e-9) * (settings_.position_rounding * size + kUnderflow);
  return part;
}

MeshTransform AssimpFile::transform_of_node(const aiNode& node) const {
  MeshTransform X = transform_of(node.mTransformation);
  if (settings_.node_rounding == 0) return X;
  // Float32 rounds only a matrix within half a last bit of the identity to the identity.
  const bool is_identity = X.is_identity();
  const double entry =
      (is_identity ? 0x1p-23 : settings_.node_rounding) * (settings_.inverts_nodes && !is_identity ? condition(X) : 1);
  double scale = 0, shift = 0;
  for (const auto& row : X.m) {
    scale = std::max(scale, std::abs(row[0]) + std::abs(row[1]) + std::abs(row[2]));
    shift = std::max(shift, std::abs(row[3]));
  }
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 4; ++c)
      if (!is_identity || r == c) X.error[r][c] = entry * (c == 3 ? shift : scale) + kUnderflow;
  return X;
}

std::vector<AssimpFile::Shown> AssimpFile::walk(const MeshTransform& root, std::uint64_t most_vertices) const {
  struct Visit {
    const aiNode* node;
    MeshTransform X;
  };
  std::vector<Shown> shown;
  std::vector<Visit> stack = {{scene_->mRootNode, root.after(transform_of_node(*scene_->mRootNode))}};
  std::vector<char> seen(scene_->mNumMeshes, 0);
  std::uint64_t vertices = 0, own = 0;
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    for (unsigned i = 0; i < visit.node->mNumMeshes; ++i) {
      const unsigned index = visit.node->mMeshes[i];
      if (index >= scene_->mNumMeshes)
        throw LoadError("a node names mesh " + std::to_string(index) + ", which is not there");
      const std::uint64_t count = scene_->mMeshes[index]->mNumVertices;
      own += seen[index]++ ? 0 : count;
      vertices += count;
      if (vertices > own && vertices > most_vertices)
        throw LoadError("its nodes repeat meshes to more than " + std::to_string(most_vertices) + " vertices");
      shown.push_back({index, visit.X});
    }
    for (unsigned i = visit.node->mNumChildren; i-- > 0;)
      stack.push_back({visit.node->mChildren[i], visit.X.after(transform_of_node(*visit.node->mChildren[i]))});
  }
  return shown;
}

void AssimpFile::read(const MeshTransform& root, std::uint64_t most_vertices, const PartSink& sink) const {
  for (const Shown& s : walk(root, most_vertices)) {
    MeshPart one = part(s.mesh);
    s.X.apply(&one);
    sink(std::move(one));
  }
}

}  // namespace clearance
