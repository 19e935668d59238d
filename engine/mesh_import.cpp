#include "mesh_import.h"

#include <assimp/DefaultIOSystem.h>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/scene.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <assimp/LogStream.hpp>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <new>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "dedupe.h"
#include "mesh_format.h"
#include "mesh_precheck.h"
#include "shapes.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

struct LoadError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

std::string lower(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

// Opens plain files inside one folder, for reading, and nothing else.
class FolderOnly final : public Assimp::DefaultIOSystem {
 public:
  /// The folder that `file` is named in and, if it is a link, the one that it leads to.
  explicit FolderOnly(const fs::path& file)
      : folders_{fs::canonical(file.parent_path()), fs::canonical(file).parent_path()} {}

  bool Exists(const char* file) const override { return permitted(file); }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (std::strchr(mode, 'w') || std::strchr(mode, 'a') || std::strchr(mode, '+') || !permitted(file)) return nullptr;
    return DefaultIOSystem::Open(file, mode);
  }
  /// The first path that was asked for and lies outside; empty if there was none.
  const std::string& refused() const { return refused_; }

 private:
  bool permitted(const char* file) const {
    std::error_code error;
    const fs::path real = fs::weakly_canonical(fs::absolute(file), error);
    const bool inside = !error && std::any_of(folders_.begin(), folders_.end(), [&](const fs::path& folder) {
      return std::mismatch(folder.begin(), folder.end(), real.begin(), real.end()).first == folder.end();
    });
    if (!inside) {
      if (refused_.empty()) refused_ = file;
      return false;
    }
    struct stat info {};
    return ::stat(real.c_str(), &info) == 0 && S_ISREG(info.st_mode);
  }

  std::array<fs::path, 2> folders_;
  mutable std::string refused_;
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

struct Matrix {  // affine, row-major, float64
  double m[3][4];
  Vec3d apply(const Vec3d& v) const {
    Vec3d out{0, 0, 0};
    for (int r = 0; r < 3; ++r) out[r] = m[r][0] * v.x + m[r][1] * v.y + m[r][2] * v.z + m[r][3];
    return out;
  }
  Matrix times(const Matrix& b) const {
    Matrix out{};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 4; ++c)
        out.m[r][c] = m[r][0] * b.m[0][c] + m[r][1] * b.m[1][c] + m[r][2] * b.m[2][c] + (c == 3 ? m[r][3] : 0);
    return out;
  }
  double determinant() const {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  }
};

Matrix matrix_of(const aiMatrix4x4& t) {
  return {{{t.a1, t.a2, t.a3, t.a4}, {t.b1, t.b2, t.b3, t.b4}, {t.c1, t.c2, t.c3, t.c4}}};
}

// A mesh in its own frame: distinct positions, and triangles over them.
struct PlainMesh {
  std::vector<Vec3<float>> vertices;
  std::vector<Triangle> triangles;
  std::uint64_t loaded_vertices = 0;
};

std::string label(const aiMesh& mesh, unsigned index) {
  const std::string name = mesh.mName.C_Str();
  return name.empty() ? "mesh " + std::to_string(index) : "mesh \"" + name.substr(0, 60) + '"';
}

PlainMesh plain(const aiMesh& mesh, unsigned index) {
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const aiVector3D& v = mesh.mVertices[i];
    if (std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z)) continue;
    char text[128];
    std::snprintf(text, sizeof text, "(%g, %g, %g)", double(v.x), double(v.y), double(v.z));
    throw LoadError("vertex " + std::to_string(i) + " of " + label(mesh, index) + " is not finite: " + text);
  }
  UniquePositions<float> unique = unique_positions<float>(mesh.mNumVertices, [&](std::size_t i) {
    return Vec3<float>{mesh.mVertices[i].x, mesh.mVertices[i].y, mesh.mVertices[i].z};
  });
  PlainMesh out;
  out.loaded_vertices = mesh.mNumVertices;
  out.vertices = std::move(unique.positions);
  out.triangles.reserve(mesh.mNumFaces);
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    for (unsigned k = 0; k < face.mNumIndices; ++k)
      if (face.mIndices[k] >= mesh.mNumVertices)
        throw LoadError("face " + std::to_string(f) + " of " + label(mesh, index) + " points at vertex " +
                        std::to_string(face.mIndices[k]) + ", past the end of " + std::to_string(mesh.mNumVertices) +
                        " vertices");
    for (unsigned k = 1; k + 1 < face.mNumIndices; ++k) {
      const Triangle t = {unique.index[face.mIndices[0]], unique.index[face.mIndices[k]],
                          unique.index[face.mIndices[k + 1]]};
      if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) out.triangles.push_back(t);
    }
  }
  return out;
}

// The result file, written front to back; the header last.
class Result {
 public:
  explicit Result(int fd) : fd_(fd) {}
  void write(const void* data, std::uint64_t bytes) {
    for (const auto* p = static_cast<const char*>(data); bytes > 0;) {
      const ssize_t n = ::pwrite(fd_, p, bytes, static_cast<off_t>(at_));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) throw std::bad_alloc();  // a memfd has no other reason
      p += n;
      at_ += static_cast<std::uint64_t>(n);
      bytes -= static_cast<std::uint64_t>(n);
    }
  }
  /// Whether it is written.
  bool finish(MeshHeader header) {
    header.magic = kMeshMagic;
    header.total_bytes = std::max<std::uint64_t>(at_, sizeof header);
    return ::pwrite(fd_, &header, sizeof header, 0) == sizeof header;
  }

 private:
  int fd_;
  std::uint64_t at_ = sizeof(MeshHeader);
};

void write_submesh(Result* result, const PlainMesh& mesh, const Matrix& X) {
  const SubmeshHeader header{mesh.vertices.size(), mesh.triangles.size(), mesh.loaded_vertices};
  result->write(&header, sizeof header);
  std::vector<Vec3d> vertices;
  vertices.reserve(mesh.vertices.size());
  for (const Vec3<float>& v : mesh.vertices) {
    vertices.push_back(X.apply(cast<double>(v)));
    const Vec3d& p = vertices.back();
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw LoadError("the transform of a node is not finite");
  }
  result->write(vertices.data(), vertices.size() * sizeof(Vec3d));
  if (X.determinant() < 0) {  // mirrored: turn the faces outward again
    std::vector<Triangle> turned = mesh.triangles;
    for (Triangle& t : turned) std::swap(t[1], t[2]);
    result->write(turned.data(), turned.size() * sizeof(Triangle));
  } else {
    result->write(mesh.triangles.data(), mesh.triangles.size() * sizeof(Triangle));
  }
  const std::uint32_t padding = 0;
  if (mesh.triangles.size() % 2) result->write(&padding, sizeof padding);
}

// Every mesh at every node that shows it, front to back. Returns how many there are.
std::uint32_t write_scene(Result* result, const aiScene& scene, std::uint64_t memory_bytes) {
  std::map<unsigned, PlainMesh> meshes;
  struct Visit {
    const aiNode* node;
    Matrix X;
  };
  std::vector<Visit> stack = {{scene.mRootNode, matrix_of(scene.mRootNode->mTransformation)}};
  std::uint64_t triangles = 0, bytes = 0;
  std::uint32_t count = 0;
  while (!stack.empty()) {
    const Visit visit = stack.back();
    stack.pop_back();
    for (unsigned i = 0; i < visit.node->mNumMeshes; ++i) {
      const unsigned index = visit.node->mMeshes[i];
      if (index >= scene.mNumMeshes)
        throw LoadError("a node names mesh " + std::to_string(index) + ", which is not there");
      auto [at, fresh] = meshes.try_emplace(index);
      if (fresh) at->second = plain(*scene.mMeshes[index], index);
      const PlainMesh& mesh = at->second;
      if (mesh.vertices.empty()) continue;
      bytes += mesh.vertices.size() * sizeof(Vec3d) + mesh.triangles.size() * sizeof(Triangle);
      if (bytes > memory_bytes) throw std::bad_alloc();  // a small file whose nodes repeat a mesh without end
      write_submesh(result, mesh, visit.X);
      triangles += mesh.triangles.size();
      ++count;
    }
    for (unsigned i = visit.node->mNumChildren; i-- > 0;)
      stack.push_back({visit.node->mChildren[i], visit.X.times(matrix_of(visit.node->mChildren[i]->mTransformation))});
  }
  if (count == 0) throw LoadError("it holds no mesh");
  if (triangles == 0) throw LoadError("it holds points or lines only, no face with an area");
  return count;
}

// Leaves only the importers of the file's own extension: no guessing among the forty others from what a file begins
// with.
void keep_importers_of(Assimp::Importer* importer, const std::string& extension) {
  for (std::size_t i = importer->GetImporterCount(); i-- > 0;) {
    const std::string list = ' ' + std::string(importer->GetImporterInfo(i)->mFileExtensions) + ' ';
    if (list.find(' ' + extension + ' ') == std::string::npos) importer->UnregisterLoader(importer->GetImporter(i));
  }
}

// The layout of the file, looked at through a mapping that is gone before assimp reads it.
void precheck(const fs::path& path, const std::string& extension) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat info {};
  if (fd < 0 || ::fstat(fd, &info) != 0) throw LoadError(std::generic_category().message(errno));
  const auto size = static_cast<std::size_t>(info.st_size);
  void* content = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, fd, 0);
  ::close(fd);
  if (content == MAP_FAILED) throw std::bad_alloc();
  const std::string wrong = mesh_precheck(extension, {static_cast<const char*>(content), size});
  ::munmap(content, size);
  if (!wrong.empty()) throw LoadError(wrong);
}

// What assimp says about a file that it cannot read, in fewer words.
std::string plainly(const std::string& text) {
  constexpr const char* kNoNumber = "Cannot parse string \"";
  if (text.compare(0, 24, "No suitable reader found") == 0) return "not a file of this format";
  if (text.compare(0, std::strlen(kNoNumber), kNoNumber) == 0) {
    const std::string rest = text.substr(std::strlen(kNoNumber));
    const std::string word = rest.substr(0, rest.find_first_of(" \t\r\n\""));
    return word.empty() ? "expected a number where the file ends or a line is short"
                        : "expected a number, got \"" + word.substr(0, 40) + '"';
  }
  return text.empty() ? "not a file of this format" : text.substr(0, 300);
}

bool load(std::unique_ptr<Assimp::Importer>* kept, Result* result, const fs::path& path, std::uint64_t memory_bytes) {
  const std::string extension = lower(path.extension().string().substr(1));
  precheck(path, extension);
  Assimp::DefaultLogger::create("", Assimp::Logger::NORMAL, 0);
  auto* log = new GeometryLog;  // the logger owns it
  Assimp::DefaultLogger::get()->attachStream(log, Assimp::Logger::Err | Assimp::Logger::Warn);
  *kept = std::make_unique<Assimp::Importer>();
  Assimp::Importer* importer = kept->get();
  auto* files = new FolderOnly(path);  // the importer owns it
  importer->SetIOHandler(files);
  keep_importers_of(importer, extension);
  // Robot meshes are drawn in the link's frame, whatever up_axis their DAE names.
  importer->SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);  // made up by assimp where a file has no mesh
  const aiScene* scene = importer->ReadFile(path.string(), 0);
  if (!scene) {
    const std::string text = importer->GetErrorString();
    if (text.find("bad_alloc") != std::string::npos || text.find("bad allocation") != std::string::npos)
      throw std::bad_alloc();
    if (!files->refused().empty())
      throw LoadError("it names \"" + files->refused() + "\", which lies outside its folder");
    throw LoadError(plainly(text));
  }
  if (!log->first().empty()) throw LoadError(log->first());
  if (!scene->mRootNode || scene->mNumMeshes == 0) throw LoadError("it holds no mesh");
  const std::uint32_t count = write_scene(result, *scene, memory_bytes);
  return result->finish({0, MeshState::kGood, count, 0, 0, LoaderLimits::kAll, 0});
}

}  // namespace

bool import_mesh(std::unique_ptr<Assimp::Importer>* kept, const std::string& path, std::uint64_t memory_bytes,
                 int result_fd) {
  Result result(result_fd);
  try {
    return load(kept, &result, fs::absolute(path), memory_bytes);
  } catch (const std::bad_alloc&) {
    const std::string text =
        "reading it takes more than " + std::to_string(memory_bytes >> 20) + " MiB of memory; is the file damaged?";
    return write_mesh_error(result_fd, MeshState::kOutOfMemory, text.c_str());
  } catch (const std::exception& e) {
    return write_mesh_error(result_fd, MeshState::kError, e.what());
  }
}

}  // namespace clearance
