#include "inspect/coacd_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>

namespace clearance {

namespace {

constexpr int kNoCoacd = 3;
// Reads counts, vertices (float64) and triangles (uint32); writes the number of parts and each part alike.
constexpr const char* kScript = R"(
import sys
try:
    import coacd, numpy
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(3)
source, target, threshold, most = sys.argv[1:]
with open(source, "rb") as f:
    v, t = numpy.fromfile(f, numpy.uint64, 2)
    vertices = numpy.fromfile(f, numpy.float64, 3 * int(v)).reshape(-1, 3)
    triangles = numpy.fromfile(f, numpy.uint32, 3 * int(t)).reshape(-1, 3)
pieces = coacd.run_coacd(coacd.Mesh(vertices, triangles), threshold=float(threshold), max_convex_hull=int(most), seed=1)
with open(target, "wb") as f:
    numpy.array([len(pieces)], numpy.uint64).tofile(f)
    for corners, faces in pieces:
        corners, faces = numpy.asarray(corners, numpy.float64), numpy.asarray(faces, numpy.uint32)
        numpy.array([len(corners), len(faces)], numpy.uint64).tofile(f)
        corners.tofile(f)
        faces.tofile(f)
)";

// Temporary folder, removed by the destructor.
class Scratch {
 public:
  Scratch() {
    std::string pattern = (std::filesystem::temp_directory_path() / "clearance-decompose-XXXXXX").string();
    if (!mkdtemp(pattern.data()))
      throw std::runtime_error("no folder " + pattern + " can be made: " + std::strerror(errno));
    path_ = pattern;
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  std::string file(const char* name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

void write_mesh(const std::string& path, std::span<const Vec3d> vertices, std::span<const Triangle> triangles) {
  std::ofstream file(path, std::ios::binary);
  const std::uint64_t counts[] = {vertices.size(), triangles.size()};
  file.write(reinterpret_cast<const char*>(counts), sizeof counts);
  file.write(reinterpret_cast<const char*>(vertices.data()), static_cast<std::streamsize>(vertices.size_bytes()));
  file.write(reinterpret_cast<const char*>(triangles.data()), static_cast<std::streamsize>(triangles.size_bytes()));
  file.close();
  if (!file) throw std::runtime_error(path + " cannot be written");
}

std::vector<ProposedPart> read_parts(const std::string& path) {
  const auto damaged = [] { return std::runtime_error("CoACD ended without pieces that can be read"); };
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  std::ifstream file(path, std::ios::binary);
  if (error || !file) throw damaged();
  const auto read = [&](void* to, std::uint64_t bytes) {
    if (!file.read(static_cast<char*>(to), static_cast<std::streamsize>(bytes))) throw damaged();
  };
  std::uint64_t count = 0;
  read(&count, sizeof count);
  if (count > size / 16) throw damaged();
  std::vector<ProposedPart> parts(count);
  for (ProposedPart& part : parts) {
    std::uint64_t counts[2];
    read(counts, sizeof counts);
    if (counts[0] > size / sizeof(Vec3d) || counts[1] > size / sizeof(Triangle)) throw damaged();
    part.vertices.resize(counts[0]);
    part.triangles.resize(counts[1]);
    read(part.vertices.data(), counts[0] * sizeof(Vec3d));
    read(part.triangles.data(), counts[1] * sizeof(Triangle));
    for (const Triangle& t : part.triangles)
      for (const std::uint32_t corner : t)
        if (corner >= part.vertices.size()) throw damaged();
  }
  return parts;
}

// Waits for a process that leads its group. \returns its exit status; what ends it early is thrown once all of the
// group is ended.
int wait_for(pid_t child, double seconds, const std::atomic<bool>& stop) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  for (;;) {
    int status = 0;
    const pid_t done = waitpid(child, &status, WNOHANG);
    if (done == child) return status;
    if (done < 0 && errno != EINTR) throw std::runtime_error(std::string("waiting for CoACD: ") + std::strerror(errno));
    const bool is_late = Clock::now() > end;
    if (stop || is_late) {
      kill(-child, SIGKILL);
      while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      throw std::runtime_error(stop ? "stopped: no pieces were written"
                                    : "CoACD took longer than " + std::to_string(static_cast<long>(seconds)) +
                                          " s; give it more (--seconds) or a coarser --threshold");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace

std::vector<ProposedPart> propose_parts(std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                                        const DecomposeOptions& options, const std::atomic<bool>& stop) {
  const Scratch scratch;
  const std::string source = scratch.file("mesh"), target = scratch.file("pieces"),
                    threshold = std::to_string(options.threshold), most = std::to_string(options.most_pieces);
  write_mesh(source, vertices, triangles);
  const char* const arguments[] = {options.python.c_str(), "-c",         kScript, source.c_str(), target.c_str(),
                                   threshold.c_str(),      most.c_str(), nullptr};
  const pid_t parent = getpid(), child = fork();
  if (child < 0) throw std::runtime_error(std::string("no process can be started: ") + std::strerror(errno));
  if (child == 0) {  // only calls that are safe after a fork
    setpgid(0, 0);
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(1);
    const int nothing = open("/dev/null", O_RDWR);
    dup2(nothing, STDIN_FILENO);
    dup2(options.quiet ? nothing : STDERR_FILENO, STDOUT_FILENO);  // CoACD's progress
    execvp(arguments[0], const_cast<char* const*>(arguments));
    _exit(127);
  }
  setpgid(child, child);
  const int status = wait_for(child, options.seconds, stop);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127)
    throw std::runtime_error(options.python + " cannot be run; --python names a Python that has coacd");
  if (WIFEXITED(status) && WEXITSTATUS(status) == kNoCoacd)
    throw std::runtime_error(options.python +
                             " has no coacd: pip install coacd there, or name a Python that has it (--python)");
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    throw std::runtime_error("CoACD failed with " + (WIFEXITED(status)
                                                         ? "exit code " + std::to_string(WEXITSTATUS(status))
                                                         : "signal " + std::to_string(WTERMSIG(status))));
  std::vector<ProposedPart> parts = read_parts(target);
  if (parts.empty()) throw std::runtime_error("CoACD proposed no piece");
  return parts;
}

}  // namespace clearance
