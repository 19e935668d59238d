// Clients of the shared-memory transport: the listener, each client's state, and the replies to its requests.
#pragma once

#include <sys/socket.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "server/access/access.h"
#include "server/base/unix_socket.h"
#include "server/limits/places.h"
#include "server/requests/transport.h"
#include "server/shm/shm_segment.h"
#include "wire/shm_os.h"

namespace clearance {

/// Throws std::runtime_error.
/// @param error an errno, or 0
[[noreturn]] void fail_shm(const std::string& path, const std::string& what, int error = 0);

/// One connected client.
struct ShmSession {
  std::uint64_t id = 0;
  Rights rights = 0;
  Places::Share place;
  shm::UniqueFd socket;  ///< the client's, or its proxy's (fd_filter_proxy.h)
  shm::UniqueFd wake;    ///< eventfd that the client writes to when the daemon sleeps
  std::vector<std::shared_ptr<Segment>> segments;
  std::uint32_t next_segment = 0;
  std::chrono::steady_clock::time_point connected;
  bool gone = false;
};

/// A reply in the slot of its request.
class ShmSink final : public ReplySink {
 public:
  ShmSink(std::shared_ptr<ShmSession> session, std::shared_ptr<Segment> segment, std::uint32_t slot,
          std::uint32_t generation)
      : session_(std::move(session)), segment_(std::move(segment)), slot_(slot), generation_(generation) {}
  ~ShmSink() override {
    if (!published_) segment_->post_reply(slot_, generation_, 0);
  }

  std::byte* reserve(std::uint64_t frame_bytes) override;
  void publish(std::uint64_t frame_bytes) override;
  void written_by_device() override { segment_->pin(); }
  bool alive() const override { return !session_->gone; }
  std::uint64_t client() const override { return session_->id; }
  std::function<bool()> watch() const override {
    return [session = std::weak_ptr(session_)] {
      const std::shared_ptr<ShmSession> known = session.lock();
      return known && !known->gone;
    };
  }
  bool sees_end() const override { return true; }
  Rights rights() const override { return session_->rights; }

 private:
  std::shared_ptr<ShmSession> session_;
  std::shared_ptr<Segment> segment_;  ///< keeps the mapping while the reply is written, even if the client goes
  std::uint32_t slot_, generation_;
  std::uint64_t reserved_ = 0;
  bool published_ = false;
};

/// The listening socket, for this user or for a group. Replaces that of a dead daemon, and rejects that of a live one.
class ShmListener {
 public:
  /// Throws std::runtime_error with cause and place.
  ShmListener(const std::string& path, const Access& access);
  int get() const { return socket_.get(); }

 private:
  shm::UniqueFd socket_;
  SocketFile file_;
};

}  // namespace clearance
