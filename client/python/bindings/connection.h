// A daemon's connection in Python, shared by several objects that are freed on any thread.
#pragma once

#include <nanobind/nanobind.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "client/client.h"
#include "client/python/bindings/gil.h"
#include "wire/fork_guard.h"

namespace clearance::python {

namespace nb = nanobind;

inline std::chrono::nanoseconds duration_of(double seconds) {
  constexpr double kLongest = 365.0 * 24 * 3600;
  return std::chrono::nanoseconds(static_cast<std::int64_t>(std::clamp(seconds, 0.0, kLongest) * 1e9));
}

/// One connection, shared by the client object, its futures and the answers that view its memory. A clearance::Client
/// is not thread-safe, but Python frees objects on any thread: work that a free cannot do at once is left to the next
/// call.
class Connection {
 public:
  Connection(const std::vector<std::string>& urls, const ConnectOptions& options)
      : client_(connect(urls, options)), timeout_s_(1e-9 * static_cast<double>(options.timeout.count())) {
    name_ = client_.url();
  }

  /// Runs f(client) exclusively, with the GIL released.
  template <class F>
  auto with(F&& f) {
    // Before the lock, which another thread can have held at the fork; that thread does not exist in the child.
    if (fork_guard_.forked())
      throw ConnectionError(name_ +
                            ": this connection was opened before a fork; the child process must open a new one");
    const GilRelease release;
    const std::lock_guard lock(mutex_);
    empty_trash();
    return f(client_);
  }

  /// Destroys a Result, Pending or DeviceQuery, now or before the next call. Never blocks.
  template <class T>
  void discard(T&& object) {
    if (fork_guard_.forked()) {
      (void)new T(std::move(object));  // the parent's, so neither used nor freed here
      return;
    }
    if (const std::unique_lock lock(mutex_, std::try_to_lock); lock) {
      const T gone = std::move(object);
    } else {
      const std::lock_guard trash_lock(trash_mutex_);
      trash_.emplace_back(std::move(object));
    }
  }

  double timeout_s() const { return timeout_s_; }
  void set_timeout(double seconds) {
    timeout_s_ = seconds;
    with([&](Client& client) { client.set_timeout(duration_of(seconds)); });
  }

 private:
  void empty_trash() {
    std::vector<std::variant<Result, Pending, DeviceQuery>> gone;
    const std::lock_guard lock(trash_mutex_);
    gone.swap(trash_);
  }

  ForkGuard fork_guard_;
  std::mutex mutex_;
  Client client_;
  std::string name_;  // initially the url
  double timeout_s_;
  std::mutex trash_mutex_;
  std::vector<std::variant<Result, Pending, DeviceQuery>> trash_;
};
using ConnectionPtr = std::shared_ptr<Connection>;

}  // namespace clearance::python
