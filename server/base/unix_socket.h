// Socket files of the daemon. Replaces the file of a dead daemon, rejects that of a live one, and removes its own.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <string>

namespace clearance {

/// Locks the folder of a socket file. If two daemons start at once, the second one then finds the first one's socket.
class FolderLock {
 public:
  explicit FolderLock(const std::string& socket_path);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_ = -1;
};

/// Removes the socket file that a dead daemon left at `path`. Throws std::runtime_error if a process listens there, or
/// if the file is no socket.
/// @param url for the message
/// @param type of the socket that will be made
void clear_stale_socket(const std::string& path, const std::string& url, int type = SOCK_STREAM);

/// A socket file made by this process, removed with this object unless another file has replaced it.
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
