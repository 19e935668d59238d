// Replies of the LCM transport: state that it shares with its sinks, and the sinks that turn frames into messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/lcm/lcm_outbox.h"
#include "server/lcm/lcm_port.h"
#include "server/requests/transport.h"
#include "wire/lcm/lcm_frames.h"

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

/// Holds the frame that the loop writes, and passes it on.
class LcmSink final : public ReplySink {
 public:
  /// Limit of a reply, which takes half a second to send.
  static constexpr std::uint64_t kMaxReplyBytes = std::uint64_t{64} << 20;
  using Deliver = std::function<void(LcmLink& link, FrameBytes frame)>;

  /// @param rights of the message, or nothing for those of the link
  LcmSink(std::weak_ptr<LcmLink> link, std::uint64_t client, Deliver deliver,
          std::optional<Rights> rights = std::nullopt)
      : link_(std::move(link)), client_(client), deliver_(std::move(deliver)), rights_(rights) {}

  std::byte* reserve(std::uint64_t frame_bytes) override;
  void publish(std::uint64_t frame_bytes) override;
  bool alive() const override { return !link_.expired(); }
  std::uint64_t client() const override { return client_; }
  Rights rights() const override {
    const auto link = link_.lock();
    return rights_.value_or(link ? link->rights : 0);
  }

 private:
  std::weak_ptr<LcmLink> link_;
  std::uint64_t client_;
  Deliver deliver_;
  std::optional<Rights> rights_;
  FrameBytes frame_;
};

/// Replies to a query_t by reply_t messages.
LcmSink::Deliver reply_to(std::int64_t client);
/// Replies to a frame_t by parts of a frame.
LcmSink::Deliver frame_to(std::int64_t client, std::int64_t request);

}  // namespace clearance
