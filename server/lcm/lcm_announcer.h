// Periodic LCM messages of the daemon: the scene, body states, status, nearest distances. It requests each from the
// loop as clients do, so that each number has one source.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "server/lcm/lcm_link.h"
#include "server/lcm/lcm_metrics.h"
#include "server/requests/transport.h"

namespace clearance {

class LcmAnnouncer {
 public:
  using Clock = std::chrono::steady_clock;

  /// References must outlive this.
  /// @param distances_hz highest rate, or 0 for no distances
  LcmAnnouncer(RequestHandler& handler, LcmMetrics& metrics, std::shared_ptr<LcmLink> link, double distances_hz)
      : handler_(handler), metrics_(metrics), link_(std::move(link)), distances_hz_(distances_hz) {}

  /// Requests all that is due, and returns the number of requests.
  int serve();
  /// Time at which delayed distances are due, or nothing.
  std::optional<Clock::time_point> due() const;

 private:
  using Take = std::function<void(LcmLink& link, std::span<const std::byte> frame)>;

  void hand_in(std::span<const std::byte> frame, Take take);
  void request(wire::FrameType type, Take take);
  LcmSink::Deliver guarded(Take take);
  void request_scene();
  void request_states();
  void request_status();
  void request_distances();
  bool distances_wanted() const;

  RequestHandler& handler_;
  LcmMetrics& metrics_;
  std::shared_ptr<LcmLink> link_;
  double distances_hz_;
  int handed_in_ = 0;
  std::uint64_t own_client_ = next_client_id();
  std::uint64_t scene_revision_ = 0, pose_revision_ = 0;
  bool distances_pending_ = false;
  std::int64_t states_sequence_ = 0, status_sequence_ = 0, distances_sequence_ = 0;
  std::string backend_;
  Clock::time_point opened_ = Clock::now();
  Clock::time_point next_period_{}, next_distances_{}, requested_at_{};
};

}  // namespace clearance
