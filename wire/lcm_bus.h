// One end of an LCM network: opened with a clear error where there is no multicast route, messages in and out.
//
// Used by the daemon's LCM transport and by the client's LCM channel. No call throws through liblcm's C frames, and
// nothing waits in it: liblcm's own self test would wait ten seconds where multicast does not come back.
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

/// What every message of ours stays under, so that it is one datagram.
inline constexpr std::size_t kLcmMessageBytes = 48 * 1024;
/// A longer message was fragmented by LCM and is not accepted: liblcm counts fragments without looking which ones came,
/// so that a repeated one makes a message with a hole.
inline constexpr std::size_t kLcmDatagramBytes = 65499;

/// "udpm://239.255.76.67:7667?ttl=0&prefix=cell2_", taken apart.
struct LcmAddress {
  std::string host = "239.255.76.67";
  std::uint16_t port = 7667;
  int ttl = 0;               ///< 0: stays on this host
  long recv_buf_size = 0;    ///< bytes; 0: as much as the system grants, up to 4 MB
  std::string prefix;        ///< before every channel's name
  double distances_hz = -1;  ///< daemon: at most so many distances_t a second; 0: none; negative: not said

  /// What connect() takes.
  std::string url() const;
};

/// Throws std::invalid_argument naming the url, the part and what was expected.
LcmAddress parse_lcm_address(const std::string& url);

/// Makes sure that a packet to the group comes back on this machine, within a second. Throws std::runtime_error with
/// the cause and the commands that add a route.
void check_multicast(const LcmAddress& address);

/// A number to know a client, publisher or daemon by: from the system's random source, positive, never 0.
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
  /// \param queue messages kept between two calls of handle(); more are dropped by liblcm without a word.
  void subscribe(const std::string& name, int queue, Handler handler);
  /// Likewise with each message of every channel `prefix + CLEARANCE_...`, and the channel's whole name.
  void subscribe_all(int queue, std::function<void(const std::string&, std::span<const std::byte>)> handler);

  /// Sends one message on `prefix + name`. False if the system refused it. Never blocks for long.
  bool publish(const std::string& name, std::span<const std::byte> message);
  /// Encodes and sends a message of a generated type.
  template <class Message>
  bool publish_message(const std::string& name, const Message& message) {
    buffer_.resize(static_cast<std::size_t>(message.getEncodedSize()));
    const int size = message.encode(buffer_.data(), 0, static_cast<int>(buffer_.size()));
    return size >= 0 && publish(name, {buffer_.data(), static_cast<std::size_t>(size)});
  }

  /// Becomes readable when a message waits.
  int descriptor() const { return descriptor_; }
  /// Hands one waiting message to its handler; false if none waits. Passes on what the handler throws.
  bool handle();
  /// Waits until a message waits; false once `deadline` has passed.
  bool wait(std::chrono::steady_clock::time_point deadline) const;

  const LcmAddress& address() const { return address_; }

 private:
  struct Subscription;
  /// Adds a subscription to the channels that a regular expression matches.
  void add(const std::string& pattern, int queue, std::unique_ptr<Subscription> subscription);

  LcmAddress address_;
  _lcm_t* lcm_ = nullptr;
  int descriptor_ = -1;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::vector<std::byte> buffer_;
  std::exception_ptr thrown_;
};

/// Spreads a burst out, so that receivers with a small socket buffer keep up: `burst_bytes` at once, then
/// `bytes_per_second`. All that is sent to an LCM network counts, since every receiver's socket gets all of it.
class LcmPacer {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr double kBurstBytes = 96 * 1024;
  static constexpr double kBytesPerSecond = 128e6;

  explicit LcmPacer(double bytes_per_second = kBytesPerSecond) : bytes_per_second_(bytes_per_second) {}

  /// Whether more may be sent now.
  bool ready(Clock::time_point now);
  void sent(std::size_t bytes) { allowance_ -= static_cast<double>(bytes); }
  /// How long until ready(), from the last call of it.
  std::chrono::nanoseconds pause() const;

 private:
  double bytes_per_second_;
  double allowance_ = kBurstBytes;
  Clock::time_point last_ = Clock::now();
};

}  // namespace clearance
