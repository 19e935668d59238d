// Clients of the shared-memory transport: connections, and the messages that hand out segments.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/limits/places.h"
#include "server/shm/segment_pinner.h"
#include "server/shm/shm_segment.h"
#include "server/shm/shm_session.h"
#include "server/shm/shm_transport.h"
#include "wire/shm_layout.h"

namespace clearance {

class ShmSessions {
 public:
  using Clock = std::chrono::steady_clock;

  /// Throws std::runtime_error with cause and place.
  ShmSessions(const std::string& path, const ShmLimits& limits, const Access& access);
  ~ShmSessions();

  /// Sets the loop, which is known from its first call on.
  void attach(RequestHandler& handler);
  const std::vector<std::shared_ptr<ShmSession>>& all() const { return sessions_; }
  /// Descriptor that is readable when serve_sockets() has work.
  int get() const { return epoll_.get(); }
  /// Serves the sockets now and then.
  /// @param polls of the loop so far
  void poll(std::uint64_t polls);
  /// Serves the sockets in the next poll.
  void poll_sockets_soon() { sockets_due_ = true; }
  void tick();
  /// Disconnects a client that breaks the protocol.
  void violate(ShmSession& session, const char* why);

 private:
  bool watch(int fd, std::uint32_t events, std::uint64_t tag);
  void serve_sockets();
  void accept_clients();
  void reject(int socket, const std::string& why);
  void serve_socket(ShmSession& session);
  void serve_message(ShmSession& session, const shm::Message& message, std::size_t received);
  void give_segment(ShmSession& session, const shm::Message& wanted, bool first);
  void drop(ShmSession& session);
  void remove_gone();

  struct CounterRefs {
    std::uint64_t *connections = nullptr, *clients = nullptr, *rejected = nullptr, *violations = nullptr,
                  *over_quota = nullptr, *segment_bytes = nullptr, *pinned_bytes = nullptr, *pin_rejections = nullptr;
  };

  ShmLimits limits_;
  Access access_;
  Places places_;
  std::shared_ptr<SegmentBudget> budget_;
  std::shared_ptr<SegmentPinner> pinner_;
  ShmListener listener_;
  shm::UniqueFd epoll_;
  std::vector<std::shared_ptr<ShmSession>> sessions_;
  CounterRefs counters_;
  std::uint64_t polls_ = 0;
  Clock::time_point next_poll_;
  bool sockets_due_ = true;
  bool any_gone_ = false;
};

}  // namespace clearance
