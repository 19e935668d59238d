// The daemon's event loop: polls the transports, routes requests to their handlers, and sleeps when idle.
//
// The loop serves transports, and RequestRouter (request_router.h) handles requests. Between two polls the loop does a
// bounded number of units of work (engine/narrow/work_meter.h; a KiB of payload counts as one): it begins small queries
// and gives each one slice. Workers do the rest.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/core/request_router.h"
#include "server/core/workers.h"
#include "server/requests/transport.h"
#include "wire/shm_os.h"
#include "wire/spin_gate.h"

struct pollfd;

namespace clearance {

class Loop final : public RequestHandler {
 public:
  using Clock = std::chrono::steady_clock;

  struct Options : RequestRouter::Limits, Workers::Options {
    std::chrono::nanoseconds spin = std::chrono::microseconds(50);  ///< longest busy poll before a sleep
    std::chrono::nanoseconds tick = std::chrono::milliseconds(100);
    std::function<void()> on_tick = {};  ///< called once per tick, for example to feed a watchdog
  };

  explicit Loop(engine::Engine& engine) : Loop(engine, Options()) {}
  Loop(engine::Engine& engine, const Options& options);  ///< the engine must outlive the loop
  Loop(std::shared_ptr<engine::Engine> engine, const Options& options);
  ~Loop() override {  // both free memory on the workers
    close_transports();
    router_.plans.clear();
  }

  /// Random nonzero number of this run of the daemon, which every reply carries.
  std::uint64_t epoch() const { return router_.context.answers.epoch(); }
  void add(std::unique_ptr<Transport> transport);
  const std::vector<std::unique_ptr<Transport>>& transports() const { return transports_; }
  /// Closes all transports and removes their sockets.
  void close_transports() { transports_.clear(); }

  /// Serves until stop().
  void run();
  /// Takes what arrived and works for about a slice, without sleeping. Returns whether there was anything to do.
  bool turn();
  /// Makes run() return soon. From any thread, and from a signal handler.
  void stop() noexcept;
  /// Sets how reload() makes another engine, and how an engine is made of a scene after a body was added or removed
  /// (null if that is rejected). Before run().
  void reload_by(Reloader::Make make, Reloader::Build build = nullptr);
  /// Loads the scene again in the background. The new engine takes over the poses and later queries, while the old one
  /// answers those under way; if loading fails, the old one stays. Does nothing without reload_by(). From any thread,
  /// and from a signal handler.
  void reload() noexcept;
  /// Returns the metrics as of the loop's next turn, or nothing after `patience`. From any other thread.
  std::optional<Stats::MetricsSnapshot> read_metrics(std::chrono::nanoseconds patience);
  bool is_reloading() const { return router_.scenes.is_busy(); }
  /// Queries under way.
  std::size_t waiting() const { return router_.waiting(); }
  /// Whether workers have queries.
  bool is_working() const { return workers_.size() > 0; }
  /// Queries that wait for poses.
  std::size_t held() const { return router_.queries.deferred().size(); }

  void on_frame(const wire::FrameHeader& header, std::span<const std::byte> payload,
                std::unique_ptr<ReplySink> sink) override {
    router_.route({header, payload, nullptr, payload.size(), std::move(sink), turn_began_});
  }
  void on_large_frame(const wire::FrameHeader& header, std::uint64_t payload_bytes, std::function<OwnPayload()> fetch,
                      std::unique_ptr<ReplySink> sink) override {
    router_.route({header, {}, std::move(fetch), payload_bytes, std::move(sink), turn_began_});
  }
  PoseUpdateResult on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence = 0,
                            std::uint64_t publisher = 0) override {
    return router_.updates.count(engine().set_poses(poses, stamp_ns, sequence, publisher));
  }
  PoseUpdateResult on_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns, std::int64_t sequence = 0,
                             std::uint64_t publisher = 0) override {
    return router_.updates.count(engine().set_joints(positions, stamp_ns, sequence, publisher));
  }
  bool has_enough() const override { return Clock::now() - section_began_ >= kEnough; }
  void drop(std::shared_ptr<void> thing) override { workers_.drop(std::move(thing)); }
  std::uint64_t& counter(const std::string& name) override { return stats()[name]; }
  engine::Engine& engine() override { return *router_.context.engine; }

 private:
  /// Time of one turn's requests, after which others wait for the next turn: a request of higher priority may come.
  static constexpr auto kEnough = std::chrono::microseconds(50);

  Stats& stats() { return router_.context.stats; }
  void take_new_scene();
  bool poll_in_memory();
  bool poll_by_system_call();
  int poll_transport(std::size_t i);
  bool work_for_a_slice();
  void note_section();
  void warn_of_contradictions();
  void tick();
  bool spin_pays();
  bool spin();
  void sleep();
  void wait_for(std::span<pollfd> fds);
  void wake() noexcept;

  Options options_;
  shm::UniqueFd wake_fd_;  // first: a reload that is still under way may use it to the end
  std::vector<std::unique_ptr<Transport>> transports_;
  std::vector<std::uint64_t*> transport_frames_;  // counters, one per transport
  RequestRouter router_;
  bool contradiction_logged_ = false;
  Clock::time_point turn_began_, section_began_, next_tick_, next_warning_;
  Clock::time_point next_poll_;             // poll of transports that need system calls
  bool polled_all_ = false;                 // in the last turn
  Clock::time_point last_frame_in_memory_;  // from a transport that needs none
  SpinGate spins_;
  int wakes_for_nothing_ = 0;
  std::uint64_t units_before_ = 0;  // of the current section
  std::atomic<bool> stopping_{false};
  Workers workers_;  // last: their queries use the other members
};

}  // namespace clearance
