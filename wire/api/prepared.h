// Queries under way, and queries that are prepared once and run many times.
#pragma once

#include <clearance/device_query.h>
#include <clearance/result.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <utility>

namespace clearance {

/// Called once when the result of a query is there, so that get() does not wait: by a thread of the engine, or by the
/// call of a client's ready(), wait_for() or get() that receives it. It must not throw, nor destroy the engine.
using WhenDone = std::function<void()>;

/// A query under way. The destructor abandons it. Not thread-safe, also with respect to its client.
class Pending {
 public:
  /// Implemented by the engine and by the client.
  struct Request {
    virtual ~Request() = default;
    virtual bool wait_for(std::chrono::nanoseconds timeout) = 0;
    virtual Result get() = 0;
  };
  explicit Pending(std::unique_ptr<Request> request) : request_(std::move(request)) {}

  /// Whether the result, or its error, is there.
  bool ready() { return wait_for(std::chrono::nanoseconds(0)); }
  /// Waits for at most `timeout`, and returns ready().
  bool wait_for(std::chrono::nanoseconds timeout) { return request().wait_for(timeout); }
  /// Returns the result; throws as distances(). Of a client, waits up to its timeout. Call it once.
  Result get() {
    request();
    return std::exchange(request_, nullptr)->get();
  }

 private:
  Request& request() const {
    if (!request_) throw std::logic_error("this reply was fetched already");
    return *request_;
  }
  std::unique_ptr<Request> request_;
};

/// A query with copies of its ids, pairs and margins, for other configurations in each run. It keeps its engine or
/// connection open, and survives changes of the scene that keep the meaning of its ids. Not thread-safe, also with
/// respect to its client.
///
/// Throws std::invalid_argument for configurations that do not fit the query's bodies and joints, StaleQuery after a
/// change of the meaning of an id, and otherwise as distances().
class Prepared {
 public:
  /// Inputs of a run, as in Query.
  struct Inputs {
    std::span<const double> positions{};
    std::span<const Pose7> configurations{};
    std::span<const double> growths{};
    std::span<const double> velocities{}, twists{};
  };
  /// Implemented by the engine and by the client.
  struct Runner {
    virtual ~Runner() = default;
    virtual Result run(const Inputs& inputs) = 0;
    virtual Pending submit(const Inputs& inputs, WhenDone when_done) = 0;
    virtual DeviceQuery on_device(std::uint32_t configurations) = 0;
    virtual bool is_stale() = 0;
  };
  explicit Prepared(std::unique_ptr<Runner> runner) : runner_(std::move(runner)) {}

  /// Returns the result of the query. An engine reuses the memory of the last result unless a copy of it exists, so
  /// that repeated runs allocate nothing.
  Result run(const Inputs& inputs) { return runner().run(inputs); }
  Result run() { return run(Inputs{}); }  ///< at the current poses
  /// \param positions (K, J) of the query's joints
  Result run(std::span<const double> positions) { return run(Inputs{.positions = positions}); }
  /// \param configurations (K, M) of the query's bodies
  Result run(std::span<const Pose7> configurations) { return run(Inputs{.configurations = configurations}); }

  /// Starts the query and returns at once. The inputs are copied.
  Pending submit(const Inputs& inputs, WhenDone when_done = {}) {
    return runner().submit(inputs, std::move(when_done));
  }

  /// Opens the query with input and columns in the memory of a GPU (docs/cuda.md): of this process, or of the daemon,
  /// which shares it with processes of its machine over shm:// and ipc://. Neither library needs CUDA for it. Other
  /// bodies keep their current poses. Throws QueryError, also without a GPU, and beyond a daemon's limits.
  ///
  /// For Reduce::kNone, kMin and kAny.
  /// \param configurations K, the number of configurations of each run; 0 for one configuration, the current poses
  DeviceQuery on_device(std::uint32_t configurations = 0) { return runner().on_device(configurations); }

  /// Whether run() would throw StaleQuery, as far as a client knows the scene.
  bool is_stale() const { return runner().is_stale(); }

 private:
  Runner& runner() const {
    if (!runner_) throw std::logic_error("this prepared query was moved from");
    return *runner_;
  }
  std::unique_ptr<Runner> runner_;
};

}  // namespace clearance
