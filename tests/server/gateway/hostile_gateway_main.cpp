// A compromised gateway process: started by the daemon in place of clearance-gateway (CLEARANCE_OUTSIDE), it misbehaves
// as selected by CLEARANCE_HOSTILE.
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <string>

#include "server/gateway/confine.h"
#include "server/gateway/link.h"
#include "wire/protocol.h"
#include "wire/wire.h"

namespace clearance::gateway {
namespace {

const std::string kSomebody = "hostile";

void send_datagram(const Head& head, const std::string& rest) {
  std::string datagram(sizeof head, '\0');
  std::memcpy(datagram.data(), &head, sizeof head);
  datagram += rest;
  while (::send(kLinkFd, datagram.data(), datagram.size(), MSG_NOSIGNAL) < 0 && errno == EAGAIN) ::usleep(1000);
}

Message frame(const std::string& key, wire::FrameType type = wire::FrameType::kGetStats) {
  const wire::FrameHeader header = wire::make_header(type, 1, 0);
  return {Kind::kFrame, 0, kSomebody, std::string(reinterpret_cast<const char*>(&header), sizeof header) + key, {}};
}

/// Waits for a message of this kind. Throws Broken once the daemon has broken the link.
Message await(Link& link, Kind kind) {
  for (;;) {
    pollfd waiting{link.descriptor(), POLLIN, 0};
    ::poll(&waiting, 1, -1);
    link.turn();
    while (std::optional<Message> message = link.receive())
      if (message->kind == kind) return *message;
  }
}

void act(Link& link, const std::string& what) {
  if (what == "garbage") send_datagram({~0u, 0xffff, 0xffff, ~0ull, ~0ull, ~0ull}, std::string(1000, 'x'));
  if (what == "kind") link.send({static_cast<Kind>(4711), 0, kSomebody, {}, {}});
  if (what == "packet") link.send({Kind::kPacket, 0, "CLEARANCE_POSES", {}, Bytes(std::string_view("poses"))});
  if (what == "no key") link.send(frame(""));
  if (what == "wrong key") link.send(frame("short"));
  if (what == "nameless") link.send({Kind::kFrame, 0, "", frame("").extra, {}});
  if (what == "headless") link.send({Kind::kFrame, 0, kSomebody, "x", {}});
  if (what == "reply released") link.send({Kind::kReplyReleased, 12345, {}, {}, {}});
  if (what == "authenticate") link.send({Kind::kAuthenticate, 0, "127.0.0.1", "no key", {}});
  if (what == "bodies")  // started and never finished, until there are too many
    for (int i = 0; i < 100; ++i)
      send_datagram({static_cast<std::uint32_t>(Kind::kFrame), 3, 0, 0, 8 << 20, 0}, std::to_string(100 + i) + "x");
  // An unauthorised key has no rights, and the answer reports that.
  if (what == "stranger's key") {
    link.send(frame(std::string(40, 'a')));
    const Message reply = await(link, Kind::kReply);
    wire::ErrorHeader error;
    if (reply.body.bytes < sizeof error) return;
    std::memcpy(&error, reply.body.begin.get(), sizeof error);
    const bool forbidden = error.code == static_cast<std::uint16_t>(wire::ErrorCode::kForbidden);
    const char* const said = forbidden ? "forbidden as it should be" : "something else";
    link.send({Kind::kFailed, 0, {}, {}, Bytes(std::string_view(said))});
  }
  if (what == "greedy") {  // sends requests and reads nothing
    for (;;) {
      link.turn();
      if (link.waiting_bytes() < 1 << 20)
        link.send(frame(std::getenv("CLEARANCE_KEY_TO_CLAIM"), wire::FrameType::kPing));
    }
  }
}

}  // namespace
}  // namespace clearance::gateway

int main() try {
  using namespace clearance::gateway;
  Link link(clearance::shm::UniqueFd(kLinkFd),
            {.message_bytes = 64 << 20, .coming_bytes = 64 << 20, .waiting_bytes = 64 << 20});
  await(link, Kind::kStart);
  link.send({Kind::kReady, 0, {}, {}, {}});
  // The daemon is ready once it has received this; it must tolerate everything that follows.
  act(link, std::getenv("CLEARANCE_HOSTILE"));
  for (;;) await(link, Kind::kAuthenticated);
} catch (const clearance::gateway::Broken&) {
  return 0;
}
