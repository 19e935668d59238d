// Makes a new engine on a thread of its own, while the old one goes on answering: of the scene file read anew, or of
// the scene with a body more or less.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "engine/engine.h"
#include "engine/scene/mesh_warning.h"

namespace clearance {

/// A body that came while the daemon ran.
struct AddedBody {
  Body body;           ///< its geometry and initial pose; no parent, whose id may change
  std::string parent;  ///< that it follows at first; empty: none
};

/// What a scene is made of: a file's bodies, and behind them those that were added, so that the file's keep their ids.
struct SceneParts {
  std::shared_ptr<const Scene> file;  ///< null where nothing was added: the engine's own scene is the file's
  std::vector<AddedBody> added;

  /// The whole. Throws SceneError for a name that is taken or a parent that is not there.
  Scene whole() const;
};

class Reloader {
 public:
  /// Loads the scene and makes an engine of it; throws what it throws. On the reloader's thread.
  using Make = std::function<std::unique_ptr<Engine>()>;
  /// Makes an engine of a scene. On the reloader's thread.
  using Build = std::function<std::unique_ptr<Engine>(Scene)>;
  /// Changes the parts, on the reloader's thread; `parts.file` is there. What it throws is the outcome's error.
  using Edit = std::function<void(SceneParts& parts)>;

  struct Outcome {
    std::unique_ptr<Engine> engine;  ///< null: it failed
    SceneParts parts;                ///< the engine's
    std::string error;
    bool bad_input = false;  ///< the error is that of what was asked for
    double seconds = 0;
    std::uint64_t load = 0;             ///< its number, from 1; 0: this was an edit
    std::uint64_t edit = 0;             ///< likewise
    std::vector<MeshWarning> warnings;  ///< of a load; of an edit: of the body that it added
    std::string left_out;               ///< of a load: added bodies that do not fit to the file any more, and why
  };

  /// \param done called on the reloader's thread when an outcome is there.
  /// \param build null: no edits.
  Reloader(Make make, Build build, std::function<void()> done)
      : make_(std::move(make)), build_(std::move(build)), done_(std::move(done)) {}
  /// Waits for what is under way.
  ~Reloader();

  /// Asks for a load. One that is under way may have read the old files: then another one follows it. From any thread,
  /// and from a signal handler.
  void ask() noexcept { asked_ = true; }
  /// The number of the load that answers an ask() of now. From the one thread that calls what follows.
  std::uint64_t next_load() const { return loads_ + 1; }

  bool can_edit() const { return build_ != nullptr; }
  /// Queues an edit and returns its number.
  std::uint64_t push(Edit edit);
  /// What has ended.
  std::optional<Outcome> take();
  /// Begins what was asked for, a load first, unless something is under way. \param current what serves now, with its
  /// parts.
  void begin(const std::shared_ptr<Engine>& current, const SceneParts& parts);
  bool is_busy() const { return thread_.joinable(); }

 private:
  template <class Work>
  void start(Work work);
  void load(SceneParts parts);

  Make make_;
  Build build_;
  std::function<void()> done_;
  std::atomic<bool> asked_{false}, ended_{false};
  Outcome outcome_;
  std::deque<Edit> edits_;
  std::uint64_t loads_ = 0, edits_pushed_ = 0, edits_begun_ = 0;
  std::thread thread_;
};

}  // namespace clearance
