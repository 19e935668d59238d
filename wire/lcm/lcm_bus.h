// An endpoint of an LCM network, with a clear error if there is no multicast route.
//
// Used by the daemon's LCM transport and by the client's LCM channel. No exception passes through liblcm's C frames,
// and no call blocks in it: liblcm's own self test would wait ten seconds without multicast.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

struct _lcm_t;

namespace clearance {

/// Maximum size of our messages, so that each is one datagram.
inline constexpr std::size_t kLcmMessageBytes = 48 * 1024;
/// Maximum size of an accepted message. LCM fragments longer ones and only counts the fragments, so that a repeated one
/// leaves a hole in the message.
inline constexpr std::size_t kLcmDatagramBytes = 65499;

/// Parsed url, such as "udpm://239.255.76.67:7667?ttl=0&prefix=cell2_".
struct LcmAddress {
  std::string host = "239.255.76.67";
  std::uint16_t port = 7667;
  int ttl = 0;               ///< 0 for this host only
  long recv_buf_size = 0;    ///< bytes; 0 for the system's limit, up to 4 MB
  std::string prefix;        ///< prefix of every channel's name
  double distances_hz = -1;  ///< of the daemon: maximum rate of distances_t, 0 for none; negative if not given

  /// The url for connect().
  std::string url() const;
};

/// Throws std::invalid_argument naming the url, the part and the expected value.
LcmAddress parse_lcm_address(const std::string& url);

/// Checks that a packet to the group arrives on this machine within a second. Throws std::runtime_error with the cause
/// and the commands that add a route.
void check_multicast(const LcmAddress& address);

/// Returns a random positive id for a client, publisher or daemon, from the system's random source.
std::int64_t draw_lcm_id();

/// Not thread-safe. Handlers run inside handle().
class LcmBus {
 public:
  using Handler = std::function<void(std::span<const std::byte>)>;

  /// Throws std::runtime_error with cause and remedy.
  explicit LcmBus(const LcmAddress& address);
  ~LcmBus();
  LcmBus(const LcmBus&) = delete;
  LcmBus& operator=(const LcmBus&) = delete;

  /// Calls `handler` with each message of the channel `prefix + name`.
  /// \param queue maximum number of messages between two calls of handle(); liblcm drops further ones silently
  void subscribe(const std::string& name, int queue, Handler handler);

  /// Sends one message on `prefix + name`. Returns false on a system error. Never blocks for long.
  bool publish(const std::string& name, std::span<const std::byte> message);
  /// Encodes and sends a message of a generated type.
  template <class Message>
  bool publish_message(const std::string& name, const Message& message) {
    buffer_.resize(static_cast<std::size_t>(message.getEncodedSize()));
    const int size = message.encode(buffer_.data(), 0, static_cast<int>(buffer_.size()));
    return size >= 0 && publish(name, {buffer_.data(), static_cast<std::size_t>(size)});
  }

  /// Descriptor that is readable while messages wait.
  int descriptor() const { return descriptor_; }
  /// Passes one waiting message to its handler; returns false if none waits. Propagates the handler's exceptions.
  bool handle();
  /// Blocks until a message waits; returns false after `deadline`.
  bool wait(std::chrono::steady_clock::time_point deadline) const;

  const LcmAddress& address() const { return address_; }

 private:
  struct Subscription;

  LcmAddress address_;
  _lcm_t* lcm_ = nullptr;
  int descriptor_ = -1;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::vector<std::byte> buffer_;
  std::exception_ptr thrown_;
};

/// Rate limiter for receivers with a small socket buffer: `burst_bytes` at once, then `bytes_per_second`. Counts all
/// bytes sent to an LCM network, since every receiver's socket gets all of them.
class LcmPacer {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr double kBurstBytes = 96 * 1024;
  static constexpr double kBytesPerSecond = 128e6;

  explicit LcmPacer(double bytes_per_second = kBytesPerSecond) : bytes_per_second_(bytes_per_second) {}

  /// Whether more bytes can be sent now.
  bool ready(Clock::time_point now);
  void sent(std::size_t bytes) { allowance_ -= static_cast<double>(bytes); }
  /// Time until ready(), from its last call.
  std::chrono::nanoseconds pause() const;

 private:
  double bytes_per_second_;
  double allowance_ = kBurstBytes;
  Clock::time_point last_ = Clock::now();
};

}  // namespace clearance
