#include "engine/mesh/mesh.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/base/fd.h"
#include "engine/base/helper_program.h"
#include "engine/mesh/mesh_format.h"
#include "engine/mesh/mesh_formats.h"
#include "engine/mesh/mesh_result.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

constexpr const char* kLoaderName = "clearance-mesh-loader";

std::atomic<bool> some_loader_unfiltered{false};

std::string reason(int error) {
  return std::generic_category().message(error);
}

// Exit status of a loader process; none if it was reaped elsewhere.
using Ending = std::optional<int>;

struct Loader {
  pid_t pid = -1;
  Fd result, lifetime;
};

Fd memory_file(const char* name, unsigned flags) {
  Fd fd(::memfd_create(name, MFD_CLOEXEC | flags));
  if (!fd) throw MeshError("cannot start the mesh loader: " + reason(errno));
  return fd;
}

// \param content of the file
Loader start_loader(const std::string& path, const Fd& content, const MeshLimits& limits, bool as_heights) {
  const std::string program = mesh_loader_program();
  Loader loader;
  loader.result = memory_file("clearance-mesh", 0);
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) throw MeshError("cannot start the mesh loader: " + reason(errno));
  loader.lifetime = Fd(ends[0]);
  const Fd write_end(ends[1]);
  static_assert(kMeshResultFd == 3 && kMeshLifetimeFd == 4 && kMeshFileFd == 5);
  const int descriptors[] = {loader.result.get(), write_end.get(), content.get()};
  const std::uint64_t seconds = static_cast<std::uint64_t>(limits.time.count() + 999) / 1000 + 1;
  try {
    loader.pid = start_helper(
        program, {path, std::to_string(limits.memory_bytes), std::to_string(seconds), as_heights ? "1" : "0"},
        descriptors);
  } catch (const std::runtime_error& error) {
    throw MeshError(error.what());
  }
  return loader;
}

// Waits for the loader's end and kills it after the time limit. Returns whether it ended in time.
bool wait_for(const Loader& loader, std::chrono::milliseconds limit, Ending* ending) {
  using Clock = std::chrono::steady_clock;
  const auto deadline = Clock::now() + limit;
  bool in_time = false;
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
    pollfd pipe{loader.lifetime.get(), 0, 0};  // closes with the loader; data in it is ignored
    const int ready = ::poll(&pipe, 1, static_cast<int>(std::clamp<long long>(left, 0, 1'000'000)));
    if (ready < 0 && errno == EINTR) continue;
    in_time = ready > 0;
    if (ready != 0 || left <= 0) break;
  }
  int status = 0;
  const auto reap = [&](int options) {
    pid_t reaped;
    do reaped = ::waitpid(loader.pid, &status, options);
    while (reaped < 0 && errno == EINTR);
    return reaped;
  };
  // A loader that closes the pipe and goes on is killed. SIGKILL does not change the exit code of one that is ending.
  pid_t reaped = reap(WNOHANG);
  if (reaped == 0) {
    ::kill(loader.pid, SIGKILL);
    reaped = reap(0);
  }
  if (reaped == loader.pid) *ending = status;
  return in_time;
}

[[noreturn]] void fail_without_result(const Ending& ending) {
  if (!ending) throw MeshError("the mesh loader ended without a result");
  if (WIFSIGNALED(*ending)) {
    const int signal = WTERMSIG(*ending);
    if (signal == SIGXCPU) throw MeshError("reading it took too much processor time; is the file damaged?");
    if (signal == SIGKILL) throw MeshError("the mesh loader was killed while reading it (out of memory?)");
    throw MeshError(std::string("the mesh library crashed on it (") + ::strsignal(signal) + "); is the file damaged?");
  }
  throw MeshError("the mesh loader ended with code " + std::to_string(WEXITSTATUS(*ending)) +
                  " and no result; is the file damaged?");
}

const std::vector<std::string>& mesh_extensions() {
  static const std::vector<std::string> all = [] {
    std::vector<std::string> out;
    for (const std::string_view own : kOwnFormats) out.push_back('.' + std::string(own));
    for (const AssimpFormat& format : kAssimpFormats) out.push_back('.' + std::string(format.extension));
    return out;
  }();
  return all;
}
const std::vector<std::string> kPoints = {".ply", ".xyz", ".npy", ".pcd"};
const std::vector<std::string> kOctomaps = {".bt", ".ot"}, kHeights = {".npy"};

// Opens a mesh file and checks its type, size and extension.
// \param known extensions of its formats
Fd open_file(const std::string& path, const MeshLimits& limits,
             const std::vector<std::string>& known = mesh_extensions()) {
  struct stat info{};
  if (::stat(path.c_str(), &info) != 0) throw MeshError(reason(errno));
  if (S_ISDIR(info.st_mode)) throw MeshError("expected a mesh file, got a folder");
  if (!S_ISREG(info.st_mode)) throw MeshError("expected a mesh file, got a device, pipe or socket");
  if (info.st_size == 0) throw MeshError("the file is empty");
  if (static_cast<std::uint64_t>(info.st_size) > limits.file_bytes)
    throw MeshError(std::to_string(info.st_size) + " bytes; a mesh file may have at most " +
                    std::to_string(limits.file_bytes));
  Fd file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file) throw MeshError(reason(errno));
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  if (std::find(known.begin(), known.end(), extension) == known.end()) {
    std::string all;
    for (std::size_t i = 0; i < known.size(); ++i)
      all += (i == 0 ? "" : i + 1 < known.size() ? ", " : " or ") + known[i];
    throw MeshError("unknown format \"" + extension + "\"; expected " + all);
  }
  return file;
}

// Reads a file to its end and returns its digest.
// \param copy receives the bytes unless null
Sha256Digest read_through(const Fd& file, const MeshLimits& limits, const Fd* copy) {
  static thread_local std::vector<char> chunk(std::size_t{1} << 18);
  Sha256 digest;
  for (std::uint64_t total = 0;;) {
    const ssize_t got = ::read(file.get(), chunk.data(), chunk.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw MeshError(reason(errno));
    if (got == 0 && total == 0) throw MeshError("the file is empty");
    if (got == 0) return digest.digest();
    total += static_cast<std::uint64_t>(got);
    if (total > limits.file_bytes) throw MeshError("it grows while it is read");
    digest.add(chunk.data(), static_cast<std::size_t>(got));
    if (copy && !may_write(total)) throw MeshError("no file may be as large as it here (RLIMIT_FSIZE)");
    for (ssize_t put = 0; copy && put < got;) {
      const ssize_t n = ::write(copy->get(), chunk.data() + put, static_cast<std::size_t>(got - put));
      if (n < 0 && errno != EINTR) throw MeshError("no memory to read it: " + reason(errno));
      put += std::max<ssize_t>(n, 0);
    }
  }
}

}  // namespace

std::string mesh_loader_program() try {
#ifdef CLEARANCE_MESH_LOADER_BUILT
  constexpr const char* kBuilt = CLEARANCE_MESH_LOADER_BUILT;
#else
  constexpr const char* kBuilt = nullptr;
#endif
  return helper_program(kLoaderName, "CLEARANCE_MESH_LOADER", kBuilt, ", which reads mesh files,");
} catch (const std::runtime_error& error) {
  throw MeshError(error.what());
}

std::string mesh_loader_warning() {
  if (!some_loader_unfiltered) return "";
  return "mesh files are read without a filter of system calls, since this kernel or container permits none: time and "
         "memory are limited";
}

Sha256Digest mesh_file_digest(const std::string& path, const MeshLimits& limits) {
  return read_through(open_file(path, limits), limits, nullptr);
}

Sha256Digest mesh_loader_digest() {
  const std::string program = mesh_loader_program();
  const Fd file(::open(program.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file) throw MeshError("cannot read " + program + ": " + reason(errno));
  return read_through(file, MeshLimits(), nullptr);
}

namespace {

// Passes the loader the very bytes of the digest, since the file may change meanwhile.
Mesh load(const std::string& path, const MeshLimits& limits, const std::vector<std::string>& known,
          bool as_heights = false) {
  const Fd content = memory_file("clearance-mesh-file", MFD_ALLOW_SEALING);
  const Sha256Digest digest = read_through(open_file(path, limits, known), limits, &content);
  if (::fcntl(content.get(), F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_GROW | F_SEAL_SHRINK | F_SEAL_SEAL) != 0)
    throw MeshError("cannot start the mesh loader: " + reason(errno));
  const Loader loader = start_loader(path, content, limits, as_heights);
  Ending ending;
  if (!wait_for(loader, limits.time, &ending))
    throw MeshError("reading it took longer than " + std::to_string(limits.time.count() / 1000.0).substr(0, 5) +
                    " s; is the file damaged?");
  LoaderLimits held = LoaderLimits::kAll;
  const auto note_limits = [&held] { some_loader_unfiltered = some_loader_unfiltered || held != LoaderLimits::kAll; };
  std::optional<Mesh> mesh;
  try {
    mesh = read_mesh_result(loader.result.get(), &held);
  } catch (const MeshError&) {
    note_limits();
    throw;
  }
  note_limits();
  if (!mesh) fail_without_result(ending);
  mesh->digest = digest;
  return std::move(*mesh);
}

}  // namespace

Mesh load_mesh(const std::string& path, const MeshLimits& limits) {
  Mesh mesh = load(path, limits, mesh_extensions());
  if (std::all_of(mesh.submeshes.begin(), mesh.submeshes.end(), [](const Submesh& s) { return s.triangles.empty(); }))
    throw MeshError("it holds points or lines only, no face with an area");
  return mesh;
}

std::vector<Vec3d> load_points(const std::string& path, const MeshLimits& limits) {
  std::vector<Vec3d> points;
  for (const Submesh& part : load(path, limits, kPoints).submeshes)
    points.insert(points.end(), part.vertices.begin(), part.vertices.end());
  return points;
}

std::vector<Vec3d> load_heights(const std::string& path, const MeshLimits& limits) {
  return std::move(load(path, limits, kHeights, true).submeshes.at(0).vertices);
}

Octomap load_octomap(const std::string& path, const MeshLimits& limits) {
  Mesh map = load(path, limits, kOctomaps);
  if (map.submeshes.size() > 2 || map.submeshes[0].vertices.size() != 1 || !(map.submeshes[0].vertices[0].x > 0))
    throw MeshError("the mesh loader handed back no octomap");
  Octomap out{map.submeshes[0].vertices[0].x, {}};
  if (map.submeshes.size() == 2) out.centres = std::move(map.submeshes[1].vertices);
  return out;
}

}  // namespace clearance
