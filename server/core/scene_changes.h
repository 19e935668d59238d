// What changes the scene while the daemon runs: loading it anew, adding and removing bodies. Each is made aside, while
// the old engine goes on answering; whoever asked for it is answered when the engine with the new scene has taken over.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/core/reloader.h"
#include "server/requests/pending_request.h"
#include "server/requests/reply_writer.h"

namespace clearance {

/// Owns the changes that are under way, who waits for them, and what the scene is made of.
class SceneChanges {
 public:
  struct Limits {
    std::uint32_t max_added_bodies = 64;         ///< more: kBadQuery
    std::uint64_t max_added_vertices = 20'000;   ///< of each; more: kTooLarge
    std::uint64_t max_added_triangles = 40'000;  ///< likewise
    std::uint64_t max_added_points = 80'000;     ///< likewise; set_points() may bring more
  };

  /// What is passed must outlive this. \param engine the one that serves, which turn() replaces.
  SceneChanges(std::shared_ptr<Engine>& engine, ReplyWriter& answers, Stats& stats, Quotas& quotas,
               const Limits& limits)
      : engine_(engine), answers_(answers), stats_(stats), quotas_(quotas), limits_(limits) {}

  /// As Loop::reload_by(). \param wake called on another thread when turn() has something to do.
  void allow(Reloader::Make make, Reloader::Build build, std::function<void()> wake);
  /// Has the scene loaded anew. Returns false where that is not allowed. From any thread, and from a signal handler.
  bool reload() noexcept;

  // Requests; they throw what they are refused for, and else take the sink, which is answered later.
  void ask_reload(const wire::FrameHeader& request, std::unique_ptr<ReplySink>& sink);
  void add_body(const wire::FrameHeader& request, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink);
  void remove_body(const wire::FrameHeader& request, std::span<const std::byte> payload,
                   std::unique_ptr<ReplySink>& sink);

  /// Lets the engine of a change that has ended take over, answers those who waited for it, and begins the next change.
  /// Returns whether another engine serves now.
  bool turn();
  /// Lets go of those who wait and whose clients are gone. Returns how many these were.
  std::size_t drop_gone();
  bool is_busy() const { return reloader_ && reloader_->is_busy(); }
  /// Requests that wait.
  std::size_t waiting() const { return waiters_.size(); }

 private:
  /// A request that is answered when the load or edit of that number has ended.
  struct Waiter {
    PendingRequest asked;
    std::uint64_t load = 0, edit = 0;  ///< one of them is 0
    std::string name;                  ///< of the body that is added or removed
    bool removes = false;
  };
  void check_size(const wire::NewBodyParts& parts) const;
  void begin_edit(const wire::FrameHeader& request, std::unique_ptr<ReplySink>& sink, const std::string& name,
                  bool removes, Reloader::Edit edit);
  void let_wait(const wire::FrameHeader& request, std::unique_ptr<ReplySink>& sink, Waiter waiter);
  std::vector<Waiter> take_waiters(const Reloader::Outcome& outcome);
  std::string why_not(const Waiter& waiter) const;
  bool end(Reloader::Outcome& outcome);
  bool install(Reloader::Outcome& outcome);
  void answer(Waiter& waiter, const Reloader::Outcome& outcome);

  std::shared_ptr<Engine>& engine_;
  ReplyWriter& answers_;
  Stats& stats_;
  Quotas& quotas_;
  Limits limits_;
  SceneParts parts_;  // of the engine's scene
  std::vector<Waiter> waiters_;
  std::unique_ptr<Reloader> reloader_;  // last: its thread may still be at work
};

}  // namespace clearance
