#include "server/gateway/lcm_gateway.h"

#include <poll.h>

#include <cerrno>
#include <sstream>

#include "server/gateway/confine.h"
#include "wire/lcm/lcm_bus.h"

namespace clearance::gateway {
namespace {

constexpr int kMessagesPerTurn = 64;
/// Messages that liblcm keeps between two polls, per channel.
constexpr int kPacketQueue = 512;
/// Bytes that may wait for the daemon. Later messages are lost, as in a network.
constexpr std::uint64_t kMostWaiting = 16 << 20;

}  // namespace

void serve_lcm(Link& link, const Message& start) {
  const std::string unfiltered = confine_to_datagrams();  // before any data of unauthenticated peers is read
  LcmBus bus(parse_lcm_address(start.name));
  std::istringstream channels(start.body.text());
  for (std::string channel; std::getline(channels, channel);)
    bus.subscribe(channel, kPacketQueue, [&link, channel](std::span<const std::byte> packet) {
      if (packet.size() <= kLcmDatagramBytes && link.waiting_bytes() < kMostWaiting)
        link.send({Kind::kPacket, 0, channel, {}, Bytes(packet)});
    });
  link.send({Kind::kReady, 0, {}, {}, Bytes(unfiltered)});
  for (bool more = false;;) {
    pollfd waiting[] = {{link.descriptor(), POLLIN, 0}, {bus.descriptor(), POLLIN, 0}};
    ::poll(waiting, 2, more || link.has_more() ? 0 : -1);
    link.turn();
    while (std::optional<Message> message = link.receive()) {
      if (message->kind == Kind::kPing)
        link.send({Kind::kAlive, 0, {}, {}, {}});
      else if (message->kind == Kind::kPacket)
        bus.publish(message->name, message->body.span());
      else
        throw Broken("the daemon sent a message of unknown type");
    }
    int taken = 0;
    while (taken < kMessagesPerTurn && bus.handle()) ++taken;
    more = taken == kMessagesPerTurn;
  }
}

}  // namespace clearance::gateway
