// Replies of the LCM transport: state that it shares with its sinks, and the sinks that turn frames into messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "server/lcm/lcm_outbox.h"
#include "server/lcm/lcm_port.h"
#include "server/requests/transport.h"
#include "wire/lcm_frames.h"

namespace clearance {

/// Shared by the transport and its sinks, which may outlive it.
struct LcmLink {
  explicit LcmLink(std::unique_ptr<LcmPort> way) : port(std::move(way)) {}

  std::unique_ptr<LcmPort> port;
  LcmOutbox outbox;                                              // replies and distances
  LcmOutbox announcements{LcmOutbox::kAnnouncedBytesPerSecond};  // scene, states, status
  std::int64_t server_id = draw_lcm_id();
  std::int64_t last_sequence = 0;
  std::uint64_t replies = 0, dropped = 0;
  Rights rights = kStrangersRights;  // of all clients, which are not authenticated

  /// Sends a message. Returns its bytes, or 0 after an error.
  template <class Message>
  std::size_t send(const char* channel, const Message& message) {
    return port->publish_message(channel, message) ? static_cast<std::size_t>(message.getEncodedSize()) : 0;
  }
  /// Queues a message of `parts` parts that hold about `bytes` of memory, and sends as much as may be sent now.
  void push(LcmOutbox& box, std::uint64_t parts, std::uint64_t bytes, LcmOutbox::SendPart send_part);
  template <class Message>
  void push_all(LcmOutbox& box, const char* channel, std::vector<Message> messages) {
    const auto held = std::make_shared<std::vector<Message>>(std::move(messages));
    push(box, held->size(), held->size() * kLcmMessageBytes,
         [this, channel, held](std::uint64_t i) { return send(channel, (*held)[i]); });
  }
};

/// Holds the frame that the loop writes, and passes it to deliver().
class LcmSink : public ReplySink {
 public:
  /// Limit of a reply, which takes half a second to send.
  static constexpr std::uint64_t kMaxReplyBytes = std::uint64_t{64} << 20;

  LcmSink(std::weak_ptr<LcmLink> link, std::uint64_t client) : link_(std::move(link)), client_(client) {}

  std::byte* reserve(std::uint64_t frame_bytes) override;
  void publish(std::uint64_t frame_bytes) override;
  bool alive() const override { return !link_.expired(); }
  std::uint64_t client() const override { return client_; }
  Rights rights() const override {
    const auto link = link_.lock();
    return link ? link->rights : 0;
  }

 protected:
  virtual void deliver(LcmLink& link, FrameBytes frame) = 0;

 private:
  std::weak_ptr<LcmLink> link_;
  std::uint64_t client_;
  FrameBytes frame_;
};

/// Answers a query_t by reply_t messages.
class LcmReplySink final : public LcmSink {
 public:
  LcmReplySink(std::weak_ptr<LcmLink> link, std::uint64_t client, std::int64_t lcm_client)
      : LcmSink(std::move(link), client), lcm_client_(lcm_client) {}

 private:
  void deliver(LcmLink& link, FrameBytes frame) override;
  std::int64_t lcm_client_;
};

/// Answers a frame by a frame, in parts.
class LcmFrameSink final : public LcmSink {
 public:
  LcmFrameSink(std::weak_ptr<LcmLink> link, std::uint64_t client, std::int64_t lcm_client, std::int64_t request)
      : LcmSink(std::move(link), client), lcm_client_(lcm_client), request_(request) {}

 private:
  void deliver(LcmLink& link, FrameBytes frame) override;
  std::int64_t lcm_client_, request_;
};

/// For messages without a reply. Their publishers have the right to set poses alone.
class LcmSilentSink final : public LcmSink {
 public:
  using Refused = std::function<void(std::span<const std::byte> frame)>;
  /// @param refused called with the frame of an error
  LcmSilentSink(std::weak_ptr<LcmLink> link, std::uint64_t client, Refused refused)
      : LcmSink(std::move(link), client), refused_(std::move(refused)) {}
  Rights rights() const override { return kMayPose; }

 private:
  void deliver(LcmLink&, FrameBytes frame) override { refused_(frame.span()); }
  Refused refused_;
};

/// Passes the frame to the transport itself.
class LcmOwnSink final : public LcmSink {
 public:
  using Take = std::function<void(LcmLink&, std::span<const std::byte> frame)>;
  LcmOwnSink(std::weak_ptr<LcmLink> link, std::uint64_t client, Take take)
      : LcmSink(std::move(link), client), take_(std::move(take)) {}

 private:
  void deliver(LcmLink& link, FrameBytes frame) override { take_(link, frame.span()); }
  Take take_;
};

}  // namespace clearance
