// Makes a new engine on a thread of its own while the old one serves: from the scene file, or after a body was added or
// removed.
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

#include "engine/editor/scene_parts.h"
#include "engine/engine.h"
#include "engine/scene/mesh_warning.h"

namespace clearance {

class Reloader {
 public:
  /// Loads the scene and makes an engine. On the reloader's thread; may throw.
  using Make = std::function<std::unique_ptr<engine::Engine>()>;
  /// Makes an engine of a scene. On the reloader's thread.
  using Build = std::function<std::unique_ptr<engine::Engine>(engine::Scene)>;
  /// Changes the parts, in which `loaded` is set, on the reloader's thread. An exception is the outcome's error.
  using Edit = std::function<void(SceneParts& parts)>;

  struct Outcome {
    std::unique_ptr<engine::Engine> engine;  ///< null after a failure
    SceneParts parts;                        ///< of the engine
    std::string error;
    bool bad_input = false;  ///< whether the request was wrong
    double seconds = 0;
    std::uint64_t load = 0;             ///< number of a load, from 1, or 0
    std::uint64_t edit = 0;             ///< number of an edit, from 1, or 0
    std::vector<MeshWarning> warnings;  ///< of a load, or of the body that an edit added
    std::string left_out;               ///< of a load: changes that do not fit the file any more, and why
  };

  /// @param build null if edits are rejected
  /// @param done called on the reloader's thread when an outcome is ready
  Reloader(Make make, Build build, std::function<void()> done)
      : make_(std::move(make)), build_(std::move(build)), done_(std::move(done)) {}
  /// Waits for the current load or edit.
  ~Reloader();

  /// Requests a load. It follows one under way, which may have read the old files. From any thread, and from a signal
  /// handler.
  void request() noexcept { requested_ = true; }
  /// Number of the load that a request made now would get. This function and those below are for one thread.
  std::uint64_t next_load() const { return loads_ + 1; }

  bool can_edit() const { return build_ != nullptr; }
  /// Queues an edit and returns its number.
  std::uint64_t push(Edit edit);
  /// Takes the outcome of a finished load or edit.
  std::optional<Outcome> take();
  /// Begins the next load or edit, loads first, unless one is under way.
  /// @param current engine that serves, with its parts
  void begin(const std::shared_ptr<engine::Engine>& current, const SceneParts& parts);
  bool is_busy() const { return thread_.joinable(); }

 private:
  template <class Work>
  void start(Work work);
  void load(SceneParts parts);

  Make make_;
  Build build_;
  std::function<void()> done_;
  std::atomic<bool> requested_{false}, ended_{false};
  Outcome outcome_;
  std::deque<Edit> edits_;
  std::uint64_t loads_ = 0, edits_pushed_ = 0, edits_begun_ = 0;
  std::thread thread_;
};

}  // namespace clearance
