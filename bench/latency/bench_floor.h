// Baseline of a transport: another process that echoes the same bytes over the same kind of transport, without any of
// our code. The difference to the daemon's transport is our overhead.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clearance::cli {

/// The bytes sent each way: whole frames, header and payload.
struct EchoSize {
  std::uint64_t request_bytes = 0;
  std::uint64_t reply_bytes = 0;
};

/// A running echo process and our end of the connection.
class Floor {
 public:
  virtual ~Floor() = default;
  /// Sends the request and waits for the reply, which the echo delays by `held` of computation, as the daemon does.
  /// Returns false if none arrived in time (LCM may lose messages).
  virtual bool exchange(std::chrono::nanoseconds held) = 0;
  /// Selects the best settings for such exchanges by a few trials.
  virtual void tune(std::chrono::nanoseconds /*held*/) {}
  virtual std::string description() const = 0;
};

/// Opens the baseline of the transport that `url` names. Throws std::runtime_error if it cannot be set up.
std::unique_ptr<Floor> open_floor(const std::string& url, const EchoSize& size);

/// The echo process: runs `clearance bench-echo ARGUMENTS`. Ends with the process that started it.
int run_echo(const std::vector<std::string>& arguments);

/// A child that runs `clearance bench-echo ARGUMENTS` and ends with this object. It prints "ready" once it serves.
class EchoProcess {
 public:
  /// \param inherited a descriptor that the child inherits under the same number; -1 for none
  explicit EchoProcess(const std::vector<std::string>& arguments, int inherited = -1);
  ~EchoProcess();
  EchoProcess(const EchoProcess&) = delete;
  EchoProcess& operator=(const EchoProcess&) = delete;
  /// The child's output after "ready": an endpoint.
  const std::string& said() const { return said_; }
  bool alive();

 private:
  pid_t pid_ = -1;
  std::string said_;
};

/// Writes the delay of its echo into a request; the echo process applies it with hold().
void request_to_hold(std::byte* request, std::chrono::nanoseconds held);
void hold(const std::byte* request);

// One per transport.
std::unique_ptr<Floor> open_shm_floor(const std::string& url, const EchoSize& size);
std::unique_ptr<Floor> open_zmq_floor(const std::string& url, const EchoSize& size);
std::unique_ptr<Floor> open_lcm_floor(const std::string& url, const EchoSize& size);
int run_shm_echo(const std::vector<std::string>& arguments);
int run_zmq_echo(const std::vector<std::string>& arguments);
int run_lcm_echo(const std::vector<std::string>& arguments);

}  // namespace clearance::cli
