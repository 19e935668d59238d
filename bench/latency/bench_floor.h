// The floor of a transport: another process that echoes the same bytes over the same kind of transport, with nothing of
// ours in the way. What the daemon's transport takes beyond it is ours to answer for.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace clearance::cli {

/// The bytes that go to and fro: whole frames, header and payload.
struct EchoSize {
  std::uint64_t request_bytes = 0;
  std::uint64_t reply_bytes = 0;
};

/// A running echo process and our end of it.
class Floor {
 public:
  virtual ~Floor() = default;
  /// Sends the request's bytes and waits for the reply's, which the echo holds back for `held`, computing, as the
  /// daemon does. False if nothing came in time (LCM may lose messages).
  virtual bool exchange(std::chrono::nanoseconds held) = 0;
  /// Chooses what is best at the moment for such exchanges, by a few of them.
  virtual void tune(std::chrono::nanoseconds /*held*/) {}
  virtual std::string description() const = 0;
};

/// The floor of the transport that `url` names. Throws std::runtime_error if it cannot be set up.
std::unique_ptr<Floor> open_floor(const std::string& url, const EchoSize& size);

/// The echo process: what `clearance bench-echo ARGUMENTS` runs. Ends with the process that started it.
int run_echo(const std::vector<std::string>& arguments);

/// A child that runs `clearance bench-echo ARGUMENTS` and is ended with this object. It says "ready" when it is.
class EchoProcess {
 public:
  /// \param inherited a descriptor that the child gets as well, under the same number; -1: none.
  explicit EchoProcess(const std::vector<std::string>& arguments, int inherited = -1);
  ~EchoProcess();
  EchoProcess(const EchoProcess&) = delete;
  EchoProcess& operator=(const EchoProcess&) = delete;
  /// What the child said after "ready": an endpoint.
  const std::string& said() const { return said_; }
  bool alive();

 private:
  pid_t pid_ = -1;
  std::string said_;
};

/// Writes into a request how long its echo is to be held back; the echo's side: holds it.
void ask_to_hold(std::byte* request, std::chrono::nanoseconds held);
void hold(const std::byte* request);

// One for each transport.
std::unique_ptr<Floor> open_shm_floor(const std::string& url, const EchoSize& size);
std::unique_ptr<Floor> open_zmq_floor(const std::string& url, const EchoSize& size);
std::unique_ptr<Floor> open_lcm_floor(const std::string& url, const EchoSize& size);
int run_shm_echo(const std::vector<std::string>& arguments);
int run_zmq_echo(const std::vector<std::string>& arguments);
int run_lcm_echo(const std::vector<std::string>& arguments);

}  // namespace clearance::cli
