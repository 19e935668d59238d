// Changes of the scene while the daemon runs: reloading it, adding, removing and replacing bodies. Each is made in the background
// while the old engine serves, and answered once the new engine has taken over.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/core/reloader.h"
#include "server/core/request.h"
#include "server/requests/pending_request.h"
#include "server/requests/reply_writer.h"

namespace clearance {

/// Holds the changes under way, the requests that wait for them, and the parts of the scene.
class SceneChanges {
 public:
  struct Limits {
    std::uint32_t max_added_bodies = 64;         ///< kBadQuery beyond it
    std::uint64_t max_added_vertices = 20'000;   ///< of each body, kTooLarge beyond it
    std::uint64_t max_added_triangles = 40'000;  ///< likewise
    std::uint64_t max_added_points = 80'000;     ///< likewise; set_points() may bring more
  };

  /// The arguments must outlive this.
  /// @param engine that serves, which turn() replaces
  SceneChanges(std::shared_ptr<engine::Engine>& engine, ReplyWriter& answers, Stats& stats, Quotas& quotas,
               const Limits& limits)
      : engine_(engine), answers_(answers), stats_(stats), quotas_(quotas), limits_(limits) {}

  /// As Loop::reload_by().
  /// @param wake called on another thread when turn() has work
  void allow(Reloader::Make make, Reloader::Build build, std::function<void()> wake);
  /// Requests a reload. Returns false if reloads are not allowed. From any thread, and from a signal handler.
  bool reload() noexcept;

  // Requests. They take the sink, which is answered later, unless they throw RejectedRequest.
  void request_reload(Request& request);
  void add_body(Request& request);  ///< or replaces the shape of one
  void remove_body(Request& request);

  /// Installs the engine of a finished change, answers its requests, and begins the next change. Returns whether the
  /// engine was replaced.
  bool turn();
  /// Drops requests whose clients are gone, and returns their number.
  std::size_t drop_gone();
  bool is_busy() const { return reloader_ && reloader_->is_busy(); }
  /// Requests that wait.
  std::size_t waiting() const { return waiters_.size(); }

 private:
  enum class Change : std::uint8_t { kAdd, kRemove, kReshape };
  /// A request answered when the load or edit of this number has ended.
  struct Waiter {
    PendingRequest pending;
    std::uint64_t load = 0, edit = 0;  ///< one of them is 0
    std::string name;                  ///< of the body
    Change change = Change::kAdd;      ///< of an edit
  };
  void check_size(const wire::NewBodyParts& parts) const;
  void begin_edit(Request& request, const std::string& name, Change change, Reloader::Edit edit);
  void let_wait(Request& request, Waiter waiter);
  std::vector<Waiter> take_waiters(const Reloader::Outcome& outcome);
  std::string why_not(const Waiter& waiter) const;
  bool end(Reloader::Outcome& outcome);
  bool install(Reloader::Outcome& outcome, std::string_view reshaped);
  void answer(Waiter& waiter, const Reloader::Outcome& outcome);

  std::shared_ptr<engine::Engine>& engine_;
  ReplyWriter& answers_;
  Stats& stats_;
  Quotas& quotas_;
  Limits limits_;
  SceneParts parts_;  // of the engine's scene
  std::vector<Waiter> waiters_;
  std::unique_ptr<Reloader> reloader_;  // last, as its thread may still run
};

}  // namespace clearance
