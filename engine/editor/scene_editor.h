// An engine in this process whose scene can change.
//
// A change makes the next engine from the present one: a copy of its scene, which shares the geometry, with the change,
// and the state of its bodies. Running jobs finish on the engine that they started with. A first engine costs the
// self-test of the instruction sets, which the next ones of a process do not repeat. A device
// receives the new hulls, and copies the others from the scene before (HeldHulls).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "engine/base/query_error.h"
#include "engine/editor/scene_parts.h"
#include "engine/engine.h"

namespace clearance {

/// Thread-safe.
class SceneEditor {
 public:
  /// The scene after a change.
  struct Change {
    std::shared_ptr<engine::Engine> engine;
    std::uint32_t body = kNone;  ///< id of the body that was added or reshaped
    double seconds = 0;          ///< time that the change took
  };

  /// Throws as the constructor of Engine.
  SceneEditor(engine::Scene scene, const engine::Engine::Options& options)
      : options_(options), engine_(std::make_shared<engine::Engine>(std::move(scene), options)) {
    address_ = engine_.get();
  }

  /// The present engine. Use update() for changes of its state.
  std::shared_ptr<engine::Engine> engine() const;
  /// The present engine if it is the one that was seen, otherwise null. Takes no lock.
  std::shared_ptr<engine::Engine> same(const std::weak_ptr<engine::Engine>& seen) const {
    std::shared_ptr<engine::Engine> engine = seen.lock();
    if (engine.get() != address_.load(std::memory_order_acquire)) engine = nullptr;
    return engine;
  }
  /// Calls `change` with the present engine, and again with its successor if that was about to take over, so that the
  /// change is not lost.
  template <class F>
  auto update(F&& change) {
    while (true) {
      const std::shared_ptr<engine::Engine> now = engine();
      try {
        return change(*now);
      } catch (const UpdatesStopped&) {
        const std::lock_guard until_it_has_taken_over(takeover_);
      }
    }
  }

  // The changes. They throw QueryError for bad input, runtime_error for a device without memory, and change nothing
  // then. Bodies keep their ids, except for those that were added after a removed one.

  /// Adds a body behind the others.
  /// \param make called with the present engine, to resolve and check ids
  Change add(const std::function<AddedBody(const engine::Engine&)>& make);
  /// Removes an added body, which no other body may follow.
  Change remove(const std::string& name);
  /// Replaces the shape of a body, which keeps its id, pose, attachments and allowed pairs. Received points of a cloud
  /// are dropped. Throws for frames and links of robots.
  /// \param radius metres, added to the shape
  Change reshape(const std::string& name, const NewShape& shape, double radius);

 private:
  struct Edit {
    std::function<void(const engine::Engine&, SceneParts&)> apply;
    std::string removed = {}, reshaped = {};
  };
  Change change(const Edit& edit);
  void replace(std::shared_ptr<engine::Engine> next, const Edit& edit);

  const engine::Engine::Options options_;
  std::mutex edits_;  // one change at a time; guards `parts_`
  SceneParts parts_;
  std::mutex takeover_;         // held while updates are stopped
  mutable std::mutex current_;  // held only while the pointer is copied
  std::shared_ptr<engine::Engine> engine_;
  std::atomic<const engine::Engine*> address_;  // of engine_
};

}  // namespace clearance
