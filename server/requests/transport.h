// Interfaces between the daemon's loop and its transports.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "server/access/access.h"
#include "wire/protocol.h"

namespace clearance {

/// A number for ReplySink::client(), unique in this process.
inline std::uint64_t next_client_id() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

/// Right that a request needs, or 0. Defined with the table in server/core/request_router.cpp.
Rights right_for(wire::FrameType request);

/// Where a request's reply goes. Used on the loop's thread. Destroyed without publish(), it sends nothing, as the
/// client is gone or the transport has replied itself.
class ReplySink {
 public:
  virtual ~ReplySink() = default;

  /// Returns memory for a whole frame (header and payload), 64-byte aligned, in which the engine writes. Null if that
  /// is more than this client can take; the daemon then replies kTooLarge with the bytes needed. May be called again
  /// before publish(), which replaces the memory.
  virtual std::byte* reserve(std::uint64_t frame_bytes) = 0;
  /// Sends the frame, whose size is at most the reserved one. Called once.
  virtual void publish(std::uint64_t frame_bytes) = 0;
  /// Called if a device wrote much of this reply, so that the transport may make later replies reach the client without
  /// a copy.
  virtual void written_by_device() {}
  /// False once the client is known to be gone. Its request is then dropped.
  virtual bool alive() const = 0;
  /// Nonzero number of the client, for fairness.
  virtual std::uint64_t client() const = 0;
  /// Bytes of published replies to this client that the daemon still holds.
  virtual std::uint64_t unsent_bytes() const { return 0; }
  /// Returns a function, valid beyond the request, that tests whether the client is still connected. Null if the client
  /// is not on this machine, or its end is not detected. Called on the loop's thread.
  virtual std::function<bool()> watch() const { return nullptr; }
  /// Whether the daemon sees at once that the client ends.
  virtual bool sees_end() const { return false; }
  /// Rights of this client at the time of the request.
  virtual Rights rights() const { return kAllRights; }
  ServiceClass service_class() const { return class_of(rights()); }
};

/// A request's payload in memory of the daemon.
struct OwnPayload {
  std::shared_ptr<const std::byte> begin;
  std::uint64_t bytes = 0;

  std::span<const std::byte> span() const { return {begin.get(), bytes}; }
};

/// Larger payloads are copied, read and checked on a worker.
inline constexpr std::uint64_t kLargePayload = 64 << 10;

/// Receives requests and poses from transports. Implemented by the loop.
class RequestHandler {
 public:
  virtual ~RequestHandler() = default;

  /// Handles a frame. `payload` is private memory, as the client can still write to its own, and valid during the call.
  /// The header is not validated.
  virtual void on_frame(const wire::FrameHeader& header, std::span<const std::byte> payload,
                        std::unique_ptr<ReplySink> sink) = 0;
  /// Handles a frame with a large payload.
  /// @param fetch brings the payload, once, on any thread: a copy, or the memory in which it came. May throw
  /// std::bad_alloc
  virtual void on_large_frame(const wire::FrameHeader& header, std::uint64_t payload_bytes,
                              std::function<OwnPayload()> fetch, std::unique_ptr<ReplySink> sink) {
    (void)payload_bytes;
    const OwnPayload payload = fetch();
    on_frame(header, payload.span(), std::move(sink));
  }
  /// Applies poses from LCM, whose size is validated. Throws as Engine::set_poses().
  /// @param stamp_ns time of the publisher
  /// @param sequence of the publisher
  /// @param publisher a number such as a client's
  virtual PoseUpdateResult on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence = 0,
                                    std::uint64_t publisher = 0) = 0;
  /// Applies joint positions. Throws as Engine::set_joints().
  virtual PoseUpdateResult on_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns,
                                     std::int64_t sequence = 0, std::uint64_t publisher = 0) = 0;
  /// Whether further requests must wait for the next turn.
  virtual bool has_enough() const { return false; }
  /// Frees an object that takes long to free on a worker.
  virtual void drop(std::shared_ptr<void> thing) { thing.reset(); }
  /// Counter by name, such as "shm.clients", made on first use. The reference stays valid.
  virtual std::uint64_t& counter(const std::string& name) = 0;
  virtual engine::Engine& engine() = 0;
};

/// A way to the daemon. Lives on the loop's thread.
class Transport {
 public:
  virtual ~Transport() = default;

  virtual std::string url() const = 0;  ///< for a client's connect()
  /// Descriptors that are readable when poll() has work. Called again after every poll().
  virtual std::vector<int> descriptors() const = 0;
  /// Passes on a bounded number of received frames, without blocking, and returns their number.
  virtual int poll(RequestHandler& handler) = 0;
  /// Whether poll() makes system calls even if nothing has arrived. While other transports keep the loop awake it is
  /// polled less often, and does not keep the loop awake itself.
  virtual bool polls_by_system_call() const { return false; }
  /// Called before the loop sleeps. Returns true if work has arrived meanwhile, so that the loop must not sleep.
  virtual bool prepare_sleep() { return false; }
  virtual void finish_sleep() {}
  /// Called about every 100 ms and after each batch of poses, for periodic messages and dead peers.
  virtual void tick(RequestHandler&) {}
};

/// Both throw std::runtime_error with cause and place if the endpoint cannot be opened.
std::unique_ptr<Transport> make_zmq_transport(const std::string& endpoint, const Access& access = {});
std::unique_ptr<Transport> make_shm_transport(const std::string& socket_path);

/// Poses accepted from LCM, where any peer in the network may send them.
struct LcmPoses {
  bool any = true;                   ///< for all bodies
  std::vector<std::string> allowed;  ///< unless `any`, bodies and groups
};
std::unique_ptr<Transport> make_lcm_transport(const std::string& lcm_url, const LcmPoses& poses = {},
                                              std::uint64_t gateway_bytes = kGatewayBytes);

}  // namespace clearance
