// Socket files of the daemon: a dead daemon's is replaced, a living one's refused, ours removed at the end.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <string>

namespace clearance {

/// Holds the folder of a socket file locked, so that of two daemons that start at once one sees the other's socket.
class FolderLock {
 public:
  explicit FolderLock(const std::string& socket_path);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_ = -1;
};

/// Makes way for a socket at `path`: removes the file that a dead daemon left. Throws std::runtime_error if somebody
/// listens there, or if the file is no socket. \param url for the message. \param type of the socket to come.
void clear_stale_socket(const std::string& path, const std::string& url, int type = SOCK_STREAM);

/// A socket file that we made: removed with this object, unless another has taken its place meanwhile.
class SocketFile {
 public:
  SocketFile() = default;
  explicit SocketFile(const std::string& path);
  ~SocketFile() { remove(); }
  SocketFile(const SocketFile&) = delete;
  SocketFile& operator=(SocketFile&& other) noexcept;
  void remove();

 private:
  std::string path_;
  ino_t inode_ = 0;
  dev_t device_ = 0;
};

}  // namespace clearance
