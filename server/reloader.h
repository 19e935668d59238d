// Makes a new engine on a thread of its own, while the old one goes on answering.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "engine/engine.h"

namespace clearance {

class Reloader {
 public:
  /// Loads the scene and makes an engine of it; throws what it throws. On the reloader's thread.
  using Make = std::function<std::unique_ptr<Engine>()>;

  struct Outcome {
    std::unique_ptr<Engine> engine;  ///< null: it failed
    std::string error;
    double seconds = 0;
    std::uint64_t number = 0;  ///< of the load, from 1
  };

  /// \param done called on the reloader's thread when an outcome is there.
  Reloader(Make make, std::function<void()> done) : make_(std::move(make)), done_(std::move(done)) {}
  /// Waits for a load that is under way.
  ~Reloader();

  /// Asks for a load. One that is under way may have read the old files: then another one follows it. From any thread, and
  /// from a signal handler.
  void ask() noexcept { asked_ = true; }
  /// Begins what was asked for, and hands out what has ended. From one thread.
  std::optional<Outcome> poll();
  bool is_loading() const { return thread_.joinable(); }
  /// The number of the load that answers an ask() of now. From poll()'s thread.
  std::uint64_t next() const { return begun_ + 1; }

 private:
  void load();

  Make make_;
  std::function<void()> done_;
  std::atomic<bool> asked_{false}, ended_{false};
  Outcome outcome_;
  std::uint64_t begun_ = 0;
  std::thread thread_;
};

}  // namespace clearance
