// What the daemon's loop knows of a transport, and what a transport knows of the daemon.
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

/// A number for ReplySink::client() that no other client of this process has, whatever the transport.
inline std::uint64_t next_client_id() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

/// Right that a request needs, or 0. The table in server/core/request_router.cpp has it.
Rights right_for(wire::FrameType request);

/// One request's way back to its client. Used on the loop's thread only; destroyed without publish(): the client gets
/// nothing (it is gone, or the transport has said so itself).
class ReplySink {
 public:
  virtual ~ReplySink() = default;

  /// Room for one whole frame (header and payload), 64-byte aligned, that the engine writes in place. Null if this
  /// client cannot take so much; the daemon then answers kTooLarge with the bytes needed. May be called again (to
  /// shrink or grow before anything was published); the former room is given up.
  virtual std::byte* reserve(std::uint64_t frame_bytes) = 0;
  /// Sends the frame written into the reserved room; its size is read from `header_bytes + payload_bytes`, never more
  /// than was reserved. Called once.
  virtual void publish(std::uint64_t frame_bytes) = 0;
  /// A device wrote much of this reply: it is worth a delay, once, that it reaches the room of the next ones without a
  /// copy.
  virtual void written_by_device() {}
  /// False once the client is known to be gone: its job is then dropped.
  virtual bool alive() const = 0;
  /// The same for every request of one client, unlike for two clients, never 0: for fairness and warm state.
  virtual std::uint64_t client() const = 0;
  /// Bytes of replies to this client that were published and that the daemon still holds.
  virtual std::uint64_t unsent_bytes() const { return 0; }
  /// Says whether the client is still there for as long as it is kept, beyond the request; null: it is not on this
  /// machine, or nobody would learn of its end. Called on the loop's thread.
  virtual std::function<bool()> watch() const { return nullptr; }
  /// What this client may do, at the time of the request.
  virtual Rights rights() const { return kAllRights; }
  ServiceClass service_class() const { return class_of(rights()); }
};

/// A request's payload in memory of the daemon's own.
struct OwnPayload {
  std::shared_ptr<const std::byte> begin;
  std::uint64_t bytes = 0;

  std::span<const std::byte> span() const { return {begin.get(), bytes}; }
};

/// Payloads beyond this are copied, read and checked off the loop.
inline constexpr std::uint64_t kLargePayload = 64 << 10;

/// Where a transport hands in what arrived. Implemented by the loop.
class RequestHandler {
 public:
  virtual ~RequestHandler() = default;

  /// A frame. `payload` is private memory (a copy of whatever the client can still write) and valid during the call
  /// only. The header has been copied but not validated.
  virtual void on_frame(const wire::FrameHeader& header, std::span<const std::byte> payload,
                        std::unique_ptr<ReplySink> sink) = 0;
  /// A frame whose payload is large. \param fetch brings it, once, on any thread, and may throw std::bad_alloc: a copy
  /// of what the client can still write, or the memory in which it came.
  virtual void on_large_frame(const wire::FrameHeader& header, std::uint64_t payload_bytes,
                              std::function<OwnPayload()> fetch, std::unique_ptr<ReplySink> sink) {
    (void)payload_bytes;
    const OwnPayload payload = fetch();
    on_frame(header, payload.span(), std::move(sink));
  }
  /// Poses from a listener transport (LCM), already validated for size; stamp and sequence are the publisher's, who has
  /// a number as a client has. Throws what Engine::set_poses() throws.
  virtual PoseUpdateResult on_poses(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence = 0,
                                    std::uint64_t publisher = 0) = 0;
  /// The same of positions of joints. Throws what Engine::set_joints() throws.
  virtual PoseUpdateResult on_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns,
                                     std::int64_t sequence = 0, std::uint64_t publisher = 0) = 0;
  /// Whether what was handed in is enough for one turn: what else has arrived waits for the next.
  virtual bool has_enough() const { return false; }
  /// Lets go of what takes long to free, where that holds up nobody.
  virtual void drop(std::shared_ptr<void> thing) { thing.reset(); }
  /// A counter, made on first use: "shm.clients", "lcm.gaps". The reference stays valid.
  virtual std::uint64_t& counter(const std::string& name) = 0;
  virtual Engine& engine() = 0;
};

/// One way in and out. Lives on the loop's thread.
class Transport {
 public:
  virtual ~Transport() = default;

  virtual std::string url() const = 0;  ///< what a client passes to connect()
  /// Descriptors that become readable when poll() has work. Asked again after every poll().
  virtual std::vector<int> descriptors() const = 0;
  /// Takes what arrived, a bounded number of frames, without blocking. Returns how many frames it handed in.
  virtual int poll(RequestHandler& handler) = 0;
  /// Whether poll() makes system calls even where nothing has arrived. The loop then polls it less often than the
  /// others while these keep it awake, and does not stay awake for it.
  virtual bool polls_by_system_call() const { return false; }
  /// Called before the loop goes to sleep in epoll. Returns true if work arrived meanwhile (then the loop does not
  /// sleep).
  virtual bool prepare_sleep() { return false; }
  virtual void finish_sleep() {}
  /// Called about every 100 ms and after each batch of pose updates: periodic messages, dead peers.
  virtual void tick(RequestHandler&) {}
};

/// Each throws std::runtime_error with cause and place if the endpoint cannot be opened.
std::unique_ptr<Transport> make_zmq_transport(const std::string& endpoint, const Access& access = {});
std::unique_ptr<Transport> make_shm_transport(const std::string& socket_path);

/// Which poses are taken from LCM, where whoever reaches the network may send them.
struct LcmPoses {
  bool any = true;                   ///< of every body
  std::vector<std::string> allowed;  ///< not any: of these bodies and groups
};
std::unique_ptr<Transport> make_lcm_transport(const std::string& lcm_url, const LcmPoses& poses = {},
                                              std::uint64_t gateway_bytes = kGatewayBytes);

}  // namespace clearance
