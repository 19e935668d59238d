// A request to a daemon that a Python object waits for.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>
#include <stdexcept>
#include <utility>

#include "client/client.h"
#include "client/python/bindings/answer.h"
#include "client/python/bindings/connection.h"
#include "client/python/bindings/gil.h"

namespace clearance::python {

using Clock = std::chrono::steady_clock;

/// Interval at which a waiting call checks for Ctrl-C and lets other threads use the connection.
constexpr std::chrono::milliseconds kSlice{10};

/// Returns a copy of the reply, or a view that keeps the reply's memory.
Answer answer_of(const ConnectionPtr& connection, Result reply, bool copy, bool beyond_limits);

/// A request that the destructor abandons.
struct UnderWay {
  ConnectionPtr connection;
  std::optional<Pending> pending;
  ~UnderWay() {
    if (pending) connection->discard(std::move(*pending));
  }
};

/// A pending request.
class PyPending {
 public:
  PyPending(ConnectionPtr connection, Pending pending, bool copy, bool beyond_limits)
      : connection_(std::move(connection)),
        pending_(std::in_place, std::move(pending)),
        copy_(copy),
        beyond_limits_(beyond_limits) {}
  ~PyPending() { cancel(); }
  PyPending(const PyPending&) = delete;
  PyPending& operator=(const PyPending&) = delete;

 private:
  template <class F>
  auto use(F&& f) {
    return connection_->with([&](Client&) {
      if (!pending_) throw std::logic_error("this request is over");
      return f(*pending_);
    });
  }

 public:
  /// Waits for at most `timeout_s`, and returns whether the answer has arrived.
  bool wait(double timeout_s) {
    const auto deadline = Clock::now() + duration_of(timeout_s);
    while (true) {
      const auto left = deadline - Clock::now();
      const auto slice = std::clamp<Clock::duration>(left, Clock::duration(0), kSlice);
      if (use([&](Pending& pending) { return pending.wait_for(slice); })) return true;
      if (left <= kSlice) return false;
      check_signals();
    }
  }

  /// Returns the answer. Call once, after wait() has returned true.
  Answer answer() {
    Result reply = use([](Pending& pending) { return pending.get(); });
    pending_.reset();
    return answer_of(connection_, std::move(reply), copy_, beyond_limits_);
  }

  void cancel() {
    if (!pending_) return;
    connection_->discard(std::move(*pending_));
    pending_.reset();
  }

 private:
  ConnectionPtr connection_;
  std::optional<Pending> pending_;
  bool copy_, beyond_limits_;
};

}  // namespace clearance::python
