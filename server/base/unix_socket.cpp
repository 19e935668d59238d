#include "server/base/unix_socket.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace clearance {
namespace {

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

}  // namespace

FolderLock::FolderLock(const std::string& socket_path)
    : fd_(open(folder_of(socket_path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  // Some file systems have no locks. Then bind() alone distinguishes two daemons that start at the same time.
  if (fd_ >= 0) flock(fd_, LOCK_EX);
}
FolderLock::~FolderLock() {
  if (fd_ >= 0) close(fd_);
}

void clear_stale_socket(const std::string& path, const std::string& url, int type) {
  const auto fail = [&url](const std::string& cause) { throw std::runtime_error(url + ": " + cause); };
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path)
    fail("a socket's path may have " + std::to_string(sizeof address.sun_path - 1) + " bytes, this one has " +
         std::to_string(path.size()));
  path.copy(address.sun_path, path.size());
  struct stat there{};
  if (lstat(path.c_str(), &there)) {
    if (errno == ENOENT && lstat(folder_of(path).c_str(), &there)) fail("there is no folder " + folder_of(path));
    return;
  }
  if (!S_ISSOCK(there.st_mode)) fail("the path is taken by something that is not a socket");
  const int probe = socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (probe < 0) fail(std::string("socket: ") + std::strerror(errno));
  const int error = connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address) ? errno : 0;
  close(probe);
  if (error == 0 || error == EAGAIN) fail("another process listens there; stop it, or choose another path");
  if (error == EPROTOTYPE) fail("the path is taken by a socket of another kind");
  if (error != ECONNREFUSED)
    fail(std::string("cannot determine whether a daemon listens there: ") + std::strerror(error));
  if (unlink(path.c_str())) fail(std::string("cannot remove the socket of a dead daemon: ") + std::strerror(errno));
}

SocketFile::SocketFile(const std::string& path) : path_(path) {
  struct stat made{};
  if (stat(path.c_str(), &made) == 0) {
    inode_ = made.st_ino;
    device_ = made.st_dev;
  }
}

SocketFile& SocketFile::operator=(SocketFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(inode_, other.inode_);
  std::swap(device_, other.device_);
  return *this;
}

void SocketFile::remove() {
  struct stat there{};
  if (inode_ && stat(path_.c_str(), &there) == 0 && there.st_ino == inode_ && there.st_dev == device_)
    unlink(path_.c_str());
  inode_ = 0;
}

}  // namespace clearance
