// clearance-gateway, the gateway between the network and clearanced (process.h). Usage, by clearanced only:
// clearance-gateway zmq|lcm MEMORY_BYTES CONNECTIONS
// with one end of a socket pair as descriptor 3 and, for zmq, a listening TCP socket as descriptor 4.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <string>

#include "server/gateway/confine.h"
#include "server/gateway/link.h"
#include "server/gateway/zmq_gateway.h"
#include "server/gateway/zmtp_gate.h"
#ifdef CLEARANCE_HAVE_LCM
#include "server/gateway/lcm_gateway.h"
#endif

namespace clearance::gateway {
namespace {

/// Descriptors in addition to connections: libzmq's and liblcm's own.
constexpr int kOwnDescriptors = 64;
/// Exit codes of a gateway, for the daemon's log.
enum Exit : int { kCoreHasGone = 0, kUsage = 2, kError = 4 };

Message await_start(Link& link) {
  for (;;) {
    pollfd waiting{link.descriptor(), POLLIN, 0};
    ::poll(&waiting, 1, -1);
    link.turn();
    if (std::optional<Message> message = link.receive()) return *message;
  }
}

[[noreturn]] void serve(const std::string& what, Link& link) {
  const Message start = await_start(link);
#ifdef CLEARANCE_HAVE_LCM
  if (what == "lcm") serve_lcm(link, start);
#endif
  serve_zmq(link, start);
}

int run(const std::string& what, std::uint64_t memory_bytes, int connections) {
  ::signal(SIGPIPE, SIG_IGN);
  const int descriptors = kOwnDescriptors + connections;
  limit_gateway(memory_bytes, static_cast<std::uint64_t>(descriptors) + 8);
  reject_connections_from(descriptors);
  Link link(shm::UniqueFd(kLinkFd),
            {.message_bytes = memory_bytes, .coming_bytes = memory_bytes, .waiting_bytes = memory_bytes});
  try {
    serve(what, link);
  } catch (const Broken&) {
    return kCoreHasGone;
  } catch (const std::exception& error) {
    try {
      link.send({Kind::kFailed, 0, {}, {}, Bytes(std::string_view(error.what()))});
    } catch (const std::exception&) {
    }
    return kError;
  }
}

}  // namespace
}  // namespace clearance::gateway

int main(int argc, char** argv) {
  using namespace clearance::gateway;
  const bool known = argc == 4 && (!std::strcmp(argv[1], "zmq") || !std::strcmp(argv[1], "lcm"));
  if (!known || ::fcntl(kLinkFd, F_GETFD) < 0) {
    std::fprintf(stderr, "clearance-gateway is started by clearanced for network traffic; do not run it by hand\n");
    return kUsage;
  }
  ::fcntl(kLinkFd, F_SETFD, FD_CLOEXEC);
#ifdef SYS_close_range
  const bool takes_connections = !std::strcmp(argv[1], "zmq");
  ::syscall(SYS_close_range, unsigned{kLinkFd} + 1 + takes_connections, ~0u, 0u);  // inherited from the daemon
#endif
  ::_exit(run(argv[1], std::strtoull(argv[2], nullptr, 10), std::atoi(argv[3])));
}
