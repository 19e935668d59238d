#include "engine/mesh/mesh_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "engine/mesh/mesh_text.h"

namespace clearance {

namespace fs = std::filesystem;

MeshFolder::MeshFolder(const fs::path& file)
    : named_in_(file.parent_path()), folders_{fs::canonical(file.parent_path()), fs::canonical(file).parent_path()} {}

bool MeshFolder::holds(const fs::path& path) const {
  alone_ = false;
  std::error_code error;
  const fs::path real = fs::weakly_canonical(fs::absolute(path), error);
  return !error && std::any_of(folders_.begin(), folders_.end(), [&](const fs::path& folder) {
    return std::mismatch(folder.begin(), folder.end(), real.begin(), real.end()).first == folder.end();
  });
}

std::string MeshFolder::read(const std::string& name) const {
  const fs::path path = named_in_ / name;
  const auto fail = [&name](const std::string& why) { throw LoadError("it names " + in_quotes(name) + ": " + why); };
  if (!holds(path)) throw LoadError("it names \"" + path.string() + "\", which lies outside its folder");
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) fail(std::generic_category().message(errno));
  struct stat info{};
  std::string content;
  if (::fstat(fd, &info) == 0 && S_ISREG(info.st_mode)) {
    content.resize(static_cast<std::size_t>(info.st_size));
    std::size_t at = 0;
    while (at < content.size()) {
      const ssize_t n = ::read(fd, content.data() + at, content.size() - at);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) break;
      at += static_cast<std::size_t>(n);
    }
    content.resize(at);
  } else {
    ::close(fd);
    fail("not a plain file");
  }
  ::close(fd);
  return content;
}

}  // namespace clearance
