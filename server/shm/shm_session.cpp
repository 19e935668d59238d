#include "server/shm/shm_session.h"

#include <cassert>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "server/access/fd_filter_proxy.h"

namespace clearance {

void fail_shm(const std::string& path, const std::string& what, int error) {
  throw std::runtime_error("shm://" + path + ": " + what + (error ? std::string(": ") + std::strerror(error) : ""));
}

std::byte* ShmSink::reserve(std::uint64_t frame_bytes) {
  if (frame_bytes > segment_->reply_capacity()) return nullptr;
  reserved_ = frame_bytes;
  return segment_->reply_area(slot_);
}

void ShmSink::publish(std::uint64_t frame_bytes) {
  assert(!published_ && frame_bytes <= reserved_ && frame_bytes >= sizeof(wire::FrameHeader));
  published_ = true;
  segment_->post_reply(slot_, generation_, frame_bytes);
}

ShmListener::ShmListener(const std::string& path, const Access& access) {
  sockaddr_un address;
  if (!shm::socket_address(path.c_str(), address))
    fail_shm(path, "a socket's path has 1 to " + std::to_string(sizeof address.sun_path - 1) + " bytes");
  const FolderLock lock(path);
  clear_stale_socket(path, "shm://" + path, SOCK_SEQPACKET);
  socket_.reset(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket_) fail_shm(path, "socket", errno);
  reject_descriptors(socket_.get());
  if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    fail_shm(path, "cannot create the socket", errno);
  file_ = SocketFile(path);
  // Before listen(), so that no client connects with the wrong mode.
  set_socket_mode(path, "shm://" + path, access);
  if (::listen(socket_.get(), 64) != 0) fail_shm(path, "cannot listen", errno);
}

}  // namespace clearance
