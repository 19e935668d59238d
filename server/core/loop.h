// The daemon's one loop: polls the transports, has each request answered, and sleeps where there is nothing to do.
//
// What happens between a request and its answer has owners of its own: whose turn it is (scheduler.h), who works on
// what is too dear for the loop (worker.h), what each client may have under way (quotas.h), queries that wait for poses
// (deferred_queries.h), changes of the scene (scene_changes.h), replies and errors (reply_writer.h), figures (stats.h). The loop
// hands requests to them; they know nothing of transports.
//
// Between two looks at the transports the loop does a bounded number of units of work (engine/narrow/work_meter.h;
// payloads count a unit for each KiB): a query is begun here if what it names is little, and gets one slice here; what
// is left then, and everything else, is the worker's.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "server/base/stats.h"
#include "server/core/scene_changes.h"
#include "server/limits/forecast.h"
#include "server/limits/quotas.h"
#include "server/requests/reply_writer.h"
#include "server/requests/transport.h"
#include "server/tasks/background_request.h"
#include "server/tasks/deferred_queries.h"
#include "server/tasks/device_plans.h"
#include "server/tasks/query_task.h"
#include "server/tasks/scheduler.h"
#include "server/tasks/worker.h"
#include "wire/shm_os.h"
#include "wire/spin_gate.h"
#include "wire/wire.h"

struct pollfd;

namespace clearance {

/// Points of point clouds that clients set, at about 60 bytes each with their part of the tree.
struct PointLimits {
  std::uint64_t max_points_of_body = 2'000'000;    ///< of one update, kTooLarge beyond it
  std::uint64_t max_points_of_client = 8'000'000;  ///< set or under way, kTooLarge beyond it
  std::uint64_t max_points = 16'000'000;           ///< of all clients, kBusy beyond it
};

class Loop final : public RequestHandler {
 public:
  using Clock = std::chrono::steady_clock;

  struct Options : Quotas::Limits, SceneChanges::Limits, QueryLimits, PointLimits, DevicePlans::Limits {
    std::chrono::nanoseconds slice = std::chrono::microseconds(200);  ///< of one query, before the others get a turn
    std::chrono::nanoseconds spin =
        std::chrono::microseconds(50);  ///< the most to poll in memory before going to sleep
    std::chrono::nanoseconds tick = std::chrono::milliseconds(100);
    std::function<void()> on_tick = {};  ///< called by the loop itself, once a tick: a watchdog's food
    bool require_epoch = false;          ///< requests that deal with poses and name no epoch are refused (kNewEpoch)
    bool worker_thread = true;  ///< false: the loop works on everything itself, so that a test can count slices
  };

  /// Which run of the daemon this is: a number drawn at random, never 0, which every reply carries.
  std::uint64_t epoch() const { return answers_.epoch(); }

  explicit Loop(Engine& engine) : Loop(engine, Options()) {}
  Loop(Engine& engine, const Options& options);  ///< the engine must outlive the loop
  Loop(std::shared_ptr<Engine> engine, const Options& options);
  ~Loop() override {  // they let go of memory by way of the workers
    close_transports();
    plans_.clear();
  }

  void add(std::unique_ptr<Transport> transport);
  const std::vector<std::unique_ptr<Transport>>& transports() const { return transports_; }
  /// Ends them all, and removes their sockets.
  void close_transports() { transports_.clear(); }

  /// Serves until stop().
  void run();
  /// One turn without sleeping: takes what arrived and works for about a slice. Returns whether there was anything to
  /// do.
  bool turn();
  /// Makes run() return soon. From any thread, and from a signal handler.
  void stop() noexcept;
  /// How reload() makes another engine, and how one is made of a scene with a body more or less (null: that is
  /// refused). Before run().
  void reload_by(Reloader::Make make, Reloader::Build build = nullptr);
  /// Has the scene loaded anew, aside; queries go on. The new engine takes over the poses and the queries that come
  /// from then on; those under way are answered by the old one. If it fails, the old one stays. Without reload_by():
  /// nothing happens. From any thread, and from a signal handler.
  void reload() noexcept;
  /// The figures as of the loop's next turn, which copies them; none if that takes longer than `patience`. From any
  /// thread but the loop's.
  std::optional<Stats::MetricsSnapshot> read_metrics(std::chrono::nanoseconds patience);
  bool is_reloading() const { return scenes_.is_busy(); }
  /// Queries under way.
  std::size_t waiting() const {
    return small_.size() + plan_worker_.size() + run_worker_.size() + control_worker_.size() + planning_worker_.size() +
           points_worker_.size();
  }
  /// Whether somebody still works on queries.
  bool is_working() const { return waiting() > small_.size(); }
  /// Queries that wait for poses.
  std::size_t held() const { return held_.size(); }

  void on_frame(const wire::FrameHeader& header, std::span<const std::byte> payload,
                std::unique_ptr<ReplySink> sink) override;
  void on_large_frame(const wire::FrameHeader& header, std::uint64_t payload_bytes, std::function<OwnPayload()> fetch,
                      std::unique_ptr<ReplySink> sink) override;
  PoseUpdateResult on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence = 0,
                            std::uint64_t publisher = 0) override;
  PoseUpdateResult on_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns, std::int64_t sequence = 0,
                             std::uint64_t publisher = 0) override;
  bool has_enough() const override { return Clock::now() - section_began_ >= kEnough; }
  void drop(std::shared_ptr<void> thing) override { planning_worker_.drop(std::move(thing)); }
  std::uint64_t& counter(const std::string& name) override { return stats_[name]; }
  Engine& engine() override { return *engine_; }

 private:
  // Requests (loop_requests.cpp). Those that are answered later take the sink.
  static void check_right(const wire::FrameHeader& header, const ReplySink& sink);
  void handle(const wire::FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink);
  void start_query(const wire::FrameHeader& header, std::span<const std::byte> payload,
                   std::unique_ptr<ReplySink>& sink);
  void begin_query(const wire::FrameHeader& header, const wire::QueryParts& parts, std::span<const std::byte> payload,
                   std::unique_ptr<ReplySink>& sink, Clock::time_point received);
  void begin_held(DeferredQuery held);
  void begin_elsewhere(std::unique_ptr<QueryTask> query, std::function<OwnPayload()> fetch, std::uint64_t payload_bytes,
                       const QueryCost& extent, std::unique_ptr<ReplySink>& sink);
  std::unique_ptr<QueryTask> new_query(const wire::FrameHeader& header, const ReplySink& sink, ServiceClass service,
                                       Clock::time_point received, Clock::time_point due);
  ServiceClass class_for(const ReplySink& sink, const QueryOptions& asked) const;
  Worker& worker_of(ServiceClass service) {
    return service == ServiceClass::kControl ? control_worker_ : planning_worker_;
  }
  bool hold(const wire::FrameHeader& header, ServiceClass service, const QueryOptions& asked, const OwnPayload& payload,
            std::unique_ptr<ReplySink>& sink, Clock::time_point received);
  bool is_small(const QueryCost& extent) const;
  void reply_elsewhere(const wire::FrameHeader& header, std::uint64_t bytes, wire::FrameType type,
                       BackgroundRequest::Make make, std::unique_ptr<ReplySink>& sink,
                       BackgroundRequest::Done done = nullptr);
  BackgroundRequest::Done count_later(std::shared_ptr<const std::uint64_t> ignored);
  void echo_elsewhere(const wire::FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                      std::unique_ptr<ReplySink>& sink);
  void list_pairs(const wire::FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                  std::unique_ptr<ReplySink>& sink);
  void certify(const wire::FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
               std::unique_ptr<ReplySink>& sink);
  void set_poses_elsewhere(const wire::FrameHeader& header, std::function<OwnPayload()> fetch,
                           std::uint64_t payload_bytes, std::unique_ptr<ReplySink>& sink);
  void set_points_elsewhere(const wire::FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                            std::unique_ptr<ReplySink>& sink);
  // Plans in a device's memory (loop_plans.cpp).
  void open_plan(const wire::FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                 std::unique_ptr<ReplySink>& sink);
  void run_plan(const wire::FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink);
  wire::PlanResult close_plan(std::span<const std::byte> payload, std::uint64_t client);
  void count_closed(std::size_t plans) { stats_["plans.closed"] += plans; }
  wire::PosesResult set_poses(const wire::FrameHeader& header, std::span<const std::byte> payload,
                              std::uint64_t client);
  void count_poses(const PoseUpdateResult& done);
  wire::PosesResult allow(const wire::FrameHeader& header, std::span<const std::byte> payload);
  wire::PosesResult attach(const wire::FrameHeader& header, std::span<const std::byte> payload);
  Stats::Named all_counters() const;
  std::vector<std::byte> stats_payload() const;

  /// Of a turn's requests: what else has arrived waits for the next, so that one that should go first does not wait
  /// long.
  static constexpr auto kEnough = std::chrono::microseconds(50);
  bool poll_in_memory();
  bool poll_by_system_call();
  int poll_transport(std::size_t i);
  bool work_for_a_slice();
  bool settle_what_was_worked_on();
  void settle(Worker::QueryPtr query);
  void note_section();
  void warn_of_contradictions();
  void tick();
  void drop_gone();
  void count_dropped(std::size_t queries);
  bool spin_pays();
  bool spin();
  void sleep();
  void wait_for(std::span<pollfd> fds);
  void wake() noexcept;

  Options options_;
  shm::UniqueFd wake_fd_;  // first: a reload that is still under way may use it to the end
  std::vector<std::unique_ptr<Transport>> transports_;
  std::vector<std::uint64_t*> transport_frames_;  // counters, beside transports_

  std::shared_ptr<Engine> engine_;
  Stats stats_;
  ReplyWriter answers_{stats_, engine_, options_.require_epoch};
  Quotas quotas_{options_};
  Forecast forecast_;
  Scheduler small_{std::min<std::chrono::nanoseconds>(options_.slice, kEnough)};  // what the loop itself works on
  DeferredQueries held_;
  ResourceQuota points_;
  std::unordered_map<std::string, ResourceQuota::Share> points_of_body_;  // by name
  DevicePlans plans_{options_};
  SceneChanges scenes_{engine_, answers_, stats_, quotas_, options_};

  std::vector<std::uint64_t> aligned_;  // a query's payload, where it arrived unaligned
  struct PosesAway {
    std::uint32_t updates = 0;
    ServiceClass service;
  };
  std::unordered_map<std::uint64_t, PosesAway> poses_away_;  // of each client: pose updates that a worker has
  bool poses_changed_ = false;
  bool contradiction_logged_ = false;
  Clock::time_point started_, turn_began_, section_began_, next_tick_, next_warning_;
  Clock::time_point next_look_;             // at the transports that are polled by system calls
  bool looked_at_all_ = false;              // the last turn did
  Clock::time_point last_frame_in_memory_;  // of a transport that is polled without
  SpinGate spins_;
  int wakes_for_nothing_ = 0;
  std::uint64_t units_before_ = 0;  // the section that is under way
  std::atomic<bool> stopping_{false};
  QueryTask::Daemon daemon_{
      answers_,
      quotas_,
      stats_,
      options_,
      forecast_,
      [this](std::shared_ptr<void> thing) { drop(std::move(thing)); },
      [this](const wire::FrameHeader& header, ServiceClass service, const QueryOptions& asked,
             const OwnPayload& payload, std::unique_ptr<ReplySink>& sink,
             Clock::time_point received) { return hold(header, service, asked, payload, sink, received); }};
  std::array<Worker*, 5> workers() {
    return {&control_worker_, &planning_worker_, &points_worker_, &plan_worker_, &run_worker_};
  }
  // Last: what they work on uses the others. Each class has one, since not all work can be cut into slices, and trees
  // over points and plans of a device, which are made in one go, have one each, as has waiting for a device. The first
  // is the last to end: the others' queries may let go of plans, which it frees.
  Worker plan_worker_, control_worker_, planning_worker_, points_worker_, run_worker_;
};

}  // namespace clearance
