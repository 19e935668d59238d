// The link between the daemon and a gateway process that sends arbitrary data: datagrams produce messages within the
// limits, with the bytes that were sent, or break the link. Complete messages then pass unchanged over a valid link, as
// a request to the daemon and as a reply from it.
#include <sys/socket.h>

#include <map>
#include <string>

#include "server/gateway/link.h"
#include "tests/fuzz/fuzz_target.h"

namespace clearance::fuzz {
namespace {

using gateway::Head;
using gateway::Link;
using gateway::Message;

constexpr Link::Limits kLimits{.message_bytes = 40'000, .coming_bytes = 60'000, .waiting_bytes = 1 << 20};
/// Set in the control byte of a datagram if the sizes in its head are to be corrected, so that not all mutations are
/// rejected.
constexpr std::uint8_t kMendHead = 1;

struct Ends {
  shm::UniqueFd one, other;
  Ends() {
    int both[2];
    require(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, both) == 0, "a pair is made");
    one.reset(both[0]);
    other.reset(both[1]);
  }
};

/// Reads the next datagram: [control 1 B | size 2 B | bytes].
std::string next_datagram(Input& in) {
  const auto control = in.number<std::uint8_t>();
  const Bytes bytes = in.take(in.number<std::uint16_t>());
  std::string datagram(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (datagram.size() < sizeof(Head) || !(control & kMendHead)) return datagram;
  Head head;
  std::memcpy(&head, datagram.data(), sizeof head);
  const std::size_t more = datagram.size() - sizeof head;
  head.name_bytes = static_cast<std::uint16_t>(std::min({std::size_t{head.name_bytes}, gateway::kMaxNameBytes, more}));
  head.extra_bytes = static_cast<std::uint16_t>(
      std::min({std::size_t{head.extra_bytes}, gateway::kMaxExtraBytes, more - head.name_bytes}));
  const std::uint64_t part = more - head.name_bytes - head.extra_bytes;
  head.body_bytes = std::clamp(head.body_bytes, part, std::max(part, kLimits.message_bytes));
  head.offset = std::min(head.offset, head.body_bytes - part);
  std::memcpy(datagram.data(), &head, sizeof head);
  return datagram;
}

/// Bytes sent so far for each name's body.
using Said = std::map<std::string, std::string>;

void note(const std::string& datagram, Said& said) {
  Head head;
  if (datagram.size() < sizeof head) return;
  std::memcpy(&head, datagram.data(), sizeof head);
  if (datagram.size() - sizeof head < std::size_t{head.name_bytes} + head.extra_bytes) return;
  said[datagram.substr(sizeof head, head.name_bytes)] +=
      datagram.substr(sizeof head + head.name_bytes + head.extra_bytes);
}

/// Sends a message over a link to another one.
void pass_on(const Message& message, Link& from, Link& to) {
  from.send(message);
  std::optional<Message> got;
  while (!got) {
    from.turn();
    to.turn();
    got = to.receive();
  }
  require(got->kind == message.kind && got->number == message.number && got->name == message.name &&
              got->extra == message.extra && got->body.text() == message.body.text(),
          "a message arrives as it was sent");
}

}  // namespace
}  // namespace clearance::fuzz

CLEARANCE_FUZZ_TARGET(gateway_link) {
  using namespace clearance::fuzz;
  Ends hostile, honest;
  Link link(std::move(hostile.one), kLimits), from(std::move(honest.one), kLimits),
      to(std::move(honest.other), kLimits);
  Input in(bytes);
  Said said;
  int whole = 0;
  try {
    while (!in.empty()) {
      const std::string datagram = next_datagram(in);
      if (datagram.empty()) continue;
      note(datagram, said);
      require(::send(hostile.other.get(), datagram.data(), datagram.size(), MSG_NOSIGNAL) ==
                  static_cast<ssize_t>(datagram.size()),
              "a datagram is taken");
      link.turn();
      while (const auto message = link.receive()) {
        require(message->name.size() <= clearance::gateway::kMaxNameBytes &&
                    message->extra.size() <= clearance::gateway::kMaxExtraBytes &&
                    message->body.bytes <= kLimits.message_bytes,
                "a message is within the limits");
        require(said[message->name] == message->body.text(), "a body has the bytes that were said, in their order");
        said.erase(message->name);
        pass_on(*message, from, to);
        ++whole;
      }
    }
  } catch (const clearance::gateway::Broken&) {
    return false;
  }
  return whole > 0 && said.empty();
}
