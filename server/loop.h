// The daemon's one loop: poll the transports, advance one query by a slice, answer.
//
// Queries are taken in short slices, so that a small one never waits behind a large one: each new query gets its first
// slice before those that have had one already go on, the clients taking turns. A query that needs more slices goes
// behind the others of its kind, and is not forgotten however many new ones come.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "error_log.h"
#include "fair_queue.h"
#include "reloader.h"
#include "transport.h"
#include "wire/aligned_buffer.h"
#include "wire/spin_gate.h"
#include "wire/wire.h"

namespace clearance {

class Loop final : public Inbox {
 public:
  using Clock = std::chrono::steady_clock;

  struct Options {
    std::chrono::nanoseconds slice = std::chrono::microseconds(200);  ///< of one query, before the others get a turn
    std::chrono::nanoseconds spin =
        std::chrono::microseconds(50);  ///< the most to poll in memory before going to sleep
    std::chrono::nanoseconds tick = std::chrono::milliseconds(100);
    std::uint64_t batch_pairs =
        64;  ///< of small queries that wait at once and are answered as one batch; 0: each alone
    std::uint32_t max_waiting_per_client = 64;                 ///< queries of one client under way; more: kBusy
    std::uint64_t max_waiting_bytes = std::uint64_t{4} << 30;  ///< of requests and replies under way; more: kBusy
    std::uint64_t max_client_bytes = std::uint64_t{2} << 30;   ///< of one client's; one request may always be under way
    std::uint32_t max_added_bodies = 64;                       ///< kAddBody; more: kBadQuery
    std::uint64_t max_added_vertices = 20'000;                 ///< of each
    std::uint64_t max_pairs_per_query = 10'000'000'000;        ///< pairs times configurations; more: kTooLarge
  };

  explicit Loop(Engine& engine) : Loop(engine, Options()) {}
  Loop(Engine& engine, const Options& options);  ///< the engine must outlive the loop
  Loop(std::shared_ptr<Engine> engine, const Options& options);
  ~Loop() override;

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
  /// What the daemon counts, and what it refused.
  struct Figures {
    std::vector<std::pair<std::string, std::uint64_t>> counters;
    std::vector<ErrorLog::Entry> errors;
  };
  /// The figures as of the loop's next turn, which copies them; none if that takes longer than `patience`. From any
  /// thread but the loop's.
  std::optional<Figures> read_figures(std::chrono::nanoseconds patience);
  bool is_reloading() const { return reloader_ && reloader_->is_busy(); }
  /// Queries under way.
  std::size_t waiting() const { return fresh_.size() + long_.size(); }
  /// Queries that wait for poses.
  std::size_t held() const;

  void on_frame(const wire::FrameHeader& header, std::span<const std::byte> payload,
                std::unique_ptr<ReplySink> sink) override;
  PoseUpdateResult on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence = 0,
                            std::uint64_t publisher = 0) override;
  std::uint64_t& counter(const std::string& name) override { return counters_[name]; }
  Engine& engine() override { return *engine_; }

 private:
  struct Task;
  struct Held;
  struct Refusal;
  using TaskPtr = std::unique_ptr<Task>;

  void handle(const wire::FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink);
  void start_query(const wire::FrameHeader& header, std::span<const std::byte> payload,
                   std::unique_ptr<ReplySink>& sink);
  void begin_query(const wire::FrameHeader& header, const wire::QueryParts& parts, std::uint64_t payload_bytes,
                   std::unique_ptr<ReplySink>& sink, Clock::time_point received);
  // held_queries.cpp
  void hold_query(const wire::FrameHeader& header, const QueryOptions& query, std::span<const std::byte> payload,
                  std::unique_ptr<ReplySink>& sink);
  bool look_at_held();
  void drop_held_of_the_gone();
  void answer_pairs(const wire::FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink);
  void set_poses(const wire::FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink);
  void attach(const wire::FrameHeader& header, std::span<const std::byte> payload, ReplySink& sink);
  void ask_reload(const wire::FrameHeader& header, std::unique_ptr<ReplySink>& sink);
  // body_requests.cpp
  void add_body(const wire::FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink);
  void remove_body(const wire::FrameHeader& header, std::span<const std::byte> payload,
                   std::unique_ptr<ReplySink>& sink);
  void begin_edit(const wire::FrameHeader& header, std::unique_ptr<ReplySink>& sink, const std::string& name,
                  bool removes, Reloader::Edit edit);
  /// Throws a Refusal (kWrongScene) if the request's ids are of another scene, where they mean something else.
  void check_scene(const wire::FrameHeader& header, std::span<const std::uint32_t> ids,
                   bool with_parents = false) const;
  void check_wait_for(const wire::FrameHeader& header, const QueryOptions& query) const;
  /// The payload of a request of which no record is known. Throws WireError if one of them is required.
  std::span<const std::byte> without_records(const wire::FrameHeader& header, std::span<const std::byte> payload);
  std::vector<std::pair<std::string, std::uint64_t>> all_counters() const;
  std::vector<std::byte> stats_payload() const;
  void hand_out_figures();

  void answer(ReplySink& sink, const wire::FrameHeader& request, wire::FrameType type,
              std::span<const std::byte> payload);
  void refuse(ReplySink& sink, const wire::FrameHeader& request, const Refusal& refusal);
  /// Runs `work`; whatever it throws is answered with kError.
  template <class Work>
  void guarded(ReplySink& sink, const wire::FrameHeader& request, Work work);

  bool poll_in_memory();
  bool poll_by_system_call();
  int poll_transport(std::size_t i);
  bool spin_pays();
  bool work_for_a_slice();
  TaskPtr next_task();
  void take_slice(TaskPtr task, Clock::time_point& now);
  void gather(const Task& first);
  void answer_together(TaskPtr first, Clock::time_point& now);
  void finish(Task& task, Clock::time_point now);
  void forget(const Task& task);
  /// Throws a Refusal (kBusy) if as many requests of this client are under way as may be.
  void check_room_for(std::uint64_t client) const;
  /// The same for bytes, of this client and of all. \returns what its requests and replies take already.
  std::uint64_t check_room_for_bytes(const ReplySink& sink, std::uint64_t bytes) const;
  static void check_reply_size(std::uint64_t rows, std::uint64_t bytes, std::uint64_t most);
  void leave(std::uint64_t client, std::uint64_t held_bytes = 0);
  void tick();
  void take_new_engine();
  void sleep();
  void wake() noexcept;

  std::shared_ptr<Engine> engine_;
  Options options_;
  std::vector<std::unique_ptr<Transport>> transports_;
  std::vector<std::uint64_t*> transport_frames_;   // counters, beside transports_
  std::map<std::string, std::uint64_t> counters_;  // a map: references stay valid
  // frames = replies + errors + requests.dropped (their client is gone) + requests.waiting
  std::uint64_t &frames_ = counters_["frames"], &replies_ = counters_["replies"],
                &dropped_ = counters_["requests.dropped"], &queries_ = counters_["queries"],
                &answered_ = counters_["queries.answered"], &queries_joined_ = counters_["queries.joined"],
                &rows_ = counters_["rows"], &records_ignored_ = counters_["records.ignored"];
  // "latency_us.N": queries that took from arrival to reply more than N/2 and at most N microseconds;
  // "latency_us.more".
  static constexpr int kLatencyBuckets = 24;
  std::array<std::uint64_t*, kLatencyBuckets> latency_;

  /// A request that changes the scene, answered when the load or edit of that number has ended.
  struct SceneWaiter {
    std::unique_ptr<ReplySink> sink;
    wire::FrameHeader request;
    std::uint64_t load, edit;  ///< one of them is 0
    std::string name;          ///< of the body that is added or removed
    bool removes;
  };
  std::vector<SceneWaiter> scene_waiters_;
  std::string why_not(const SceneWaiter& waiter) const;
  void install(Reloader::Outcome& outcome);
  void answer_scene_waiter(const SceneWaiter& waiter, const Reloader::Outcome& outcome);
  SceneParts parts_;  // of the engine's scene

  struct DueFirst {
    bool operator()(const TaskPtr& a, const TaskPtr& b) const;
  };
  FairQueue<TaskPtr, DueFirst> fresh_, long_;
  int fresh_in_a_row_ = 0;
  std::vector<TaskPtr> joined_;  // queries that are answered as one batch
  std::vector<Job*> batch_;      // their jobs
  /// What one client has under way.
  struct Usage {
    std::uint32_t requests = 0;
    std::uint64_t bytes = 0;  ///< of its requests and of the replies to come
  };
  std::unordered_map<std::uint64_t, Usage> waiting_per_client_;
  std::uint64_t waiting_bytes_ = 0;

  std::vector<Held> held_;
  std::uint64_t held_until_revision_ = 0;  // of the poses when held_ was last looked at
  Clock::time_point held_deadline_;        // the first of theirs

  std::vector<std::uint64_t> aligned_;  // a query's payload, where it arrived unaligned
  std::vector<BodyPose> poses_;
  std::vector<std::uint32_t> ids_;  // theirs
  bool poses_changed_ = false;
  bool contradiction_logged_ = false;
  Clock::time_point started_, turn_began_, next_tick_, next_warning_;
  Clock::time_point next_look_;             // at the transports that are polled by system calls
  bool looked_at_all_ = false;              // the last turn did
  Clock::time_point last_frame_in_memory_;  // of a transport that is polled without
  SpinGate spins_;
  int wakes_for_nothing_ = 0;
  ErrorLog error_log_;
  std::atomic<bool> figures_wanted_{false};
  std::mutex figures_mutex_;
  std::condition_variable figures_there_;
  std::optional<Figures> figures_;  // with the mutex
  std::atomic<bool> stopping_{false};
  int wake_fd_ = -1;
  std::unique_ptr<Reloader> reloader_;  // last: its thread wakes this
};

}  // namespace clearance
