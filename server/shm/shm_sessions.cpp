#include "server/shm/shm_sessions.h"

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "server/access/accepting.h"
#include "server/access/fd_filter_proxy.h"

namespace clearance {
namespace {

using shm::MessageKind;
using shm::UniqueFd;

constexpr int kMessagesPerEvent = 8;
/// Interval between polls of the sockets while requests keep the loop awake, and polls between two reads of the clock.
constexpr auto kSocketPollInterval = std::chrono::milliseconds(1);
constexpr int kPollsPerClockRead = 16;

shm::Message make_message(MessageKind kind) {
  shm::Message message;
  message.wire_version = wire::kVersion;
  message.kind = static_cast<std::uint32_t>(kind);
  return message;
}

}  // namespace

ShmSessions::ShmSessions(const std::string& path, const ShmLimits& limits, const Access& access)
    : limits_(limits),
      access_(access),
      places_(limits.max_clients, access.has_control() ? kept_for_control(limits.max_clients) : 0),
      budget_(std::make_shared<SegmentBudget>()),
      listener_(path, access) {
  budget_->limit = limits.pool_bytes;
  if (budget_->limit == 0)
    budget_->limit =
        static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) / 2;
  if (access.has_control()) budget_->kept_for_control = kept_for_control(budget_->limit);
  if (limits_.pinned_bytes > 0) pinner_ = std::make_shared<SegmentPinner>(limits_.pinned_bytes);
  limits_.max_segment_bytes = std::min(limits_.max_segment_bytes, budget_->limit);
  limits_.slots = std::clamp<std::uint32_t>(limits_.slots, 1, shm::kMaxSlots);
  epoll_.reset(::epoll_create1(EPOLL_CLOEXEC));
  if (!epoll_) fail_shm(path, "epoll_create1", errno);
  if (!watch(listener_.get(), EPOLLIN, 0)) fail_shm(path, "epoll_ctl", errno);
}

ShmSessions::~ShmSessions() {
  for (auto& session : sessions_) {  // sinks may live longer than this
    session->gone = true;
    session->place = {};
  }
  budget_->drop = nullptr;
}

void ShmSessions::attach(RequestHandler& handler) {
  if (counters_.connections) return;
  const auto counter = [&](const char* name) { return &handler.counter(name); };
  counters_ = {counter("shm.connections"),  counter("shm.clients"),     counter("shm.rejected"),
               counter("shm.violations"),   counter("shm.over_quota"),  counter("shm.segment_bytes"),
               counter("shm.pinned_bytes"), counter("shm.pin_failures")};
  budget_->drop = [&handler](std::shared_ptr<void> memory) { handler.drop(std::move(memory)); };
}

void ShmSessions::poll(std::uint64_t polls) {
  polls_ = polls;
  if (sockets_due_ || (polls % kPollsPerClockRead == 0 && Clock::now() >= next_poll_)) serve_sockets();
  remove_gone();
}

void ShmSessions::tick() {
  sockets_due_ = true;
  const auto now = Clock::now();
  for (const auto& session : sessions_)
    if (session->segments.empty() && now - session->connected > limits_.hello_timeout) drop(*session);
  remove_gone();
  *counters_.segment_bytes = budget_->used;
  *counters_.pinned_bytes = pinner_ ? pinner_->bytes() : 0;
  *counters_.pin_rejections = pinner_ ? pinner_->rejections() : 0;
}

/// Event tags: 0 is the listener; a session's socket is 2 id, its eventfd 2 id + 1.
bool ShmSessions::watch(int fd, std::uint32_t events, std::uint64_t tag) {
  epoll_event event{};
  event.events = events;
  event.data.u64 = tag;
  return ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) == 0;
}

void ShmSessions::serve_sockets() {
  sockets_due_ = false;
  next_poll_ = Clock::now() + kSocketPollInterval;
  epoll_event events[64];
  const int count = ::epoll_wait(epoll_.get(), events, 64, 0);
  for (int i = 0; i < count; ++i) {
    const std::uint64_t tag = events[i].data.u64;
    if (tag == 0) {
      accept_clients();
    } else if (tag % 2 == 0) {
      const auto session =
          std::find_if(sessions_.begin(), sessions_.end(), [&](const auto& s) { return s->id == tag / 2; });
      if (session != sessions_.end()) serve_socket(**session);
    }  // else an eventfd, edge-triggered, which has woken the loop
  }
  if (count == 64) sockets_due_ = true;
  remove_gone();
}

void ShmSessions::accept_clients() {
  for (int i = 0; i < kMessagesPerEvent; ++i) {
    UniqueFd peer(accept_or_reject(listener_.get(), [this](int unwanted) {
      reject(unwanted, std::string("this daemon has no descriptor for another client: ") + std::strerror(EMFILE));
    }));
    if (!peer) return;
    std::string why;
    const std::optional<ucred> who = peer_process(peer.get());
    const std::optional<Rights> rights = rights_of_peer(peer.get(), access_, why);
    UniqueFd socket = without_descriptors(std::move(peer));
    if (!socket) {
      ++*counters_.rejected;
      continue;
    }
    if (rights && who) why = places_.why_not(*who, "shared-memory clients", class_of(*rights));
    if (!why.empty()) {
      if (rights) ++*counters_.over_quota;
      reject(socket.get(), rights ? why + " (limit max-clients)" : why);
      continue;
    }
    auto session = std::make_shared<ShmSession>();
    session->id = next_client_id();
    session->rights = *rights;
    session->socket = std::move(socket);
    session->connected = Clock::now();
    if (!watch(session->socket.get(), EPOLLIN | EPOLLRDHUP, 2 * session->id)) {
      reject(session->socket.get(), std::string("epoll_ctl: ") + std::strerror(errno));
      continue;
    }
    session->place = places_.take(*who);
    sessions_.push_back(std::move(session));
    ++*counters_.connections;
  }
}

/// Sends and counts a rejection. The caller decides whether the connection ends.
void ShmSessions::reject(int socket, const std::string& why) {
  shm::Message message = make_message(MessageKind::kRejected);
  std::memcpy(message.text, why.data(), std::min(why.size(), sizeof message.text - 1));
  shm::send_message(socket, message);
  ++*counters_.rejected;
}

void ShmSessions::serve_socket(ShmSession& session) {
  for (int i = 0; i < kMessagesPerEvent && !session.gone; ++i) {
    shm::Message message;
    const ssize_t received = shm::receive_message(session.socket.get(), message);
    if (received < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
    if (received <= 0) return drop(session);
    serve_message(session, message, static_cast<std::size_t>(received));
  }
  sockets_due_ = true;
}

void ShmSessions::serve_message(ShmSession& session, const shm::Message& message, std::size_t received) {
  if (received < shm::kMessagePrefixBytes || message.magic != shm::kMagic)
    return violate(session, "not a message of this protocol");
  if (message.layout_version != shm::kLayoutVersion || message.wire_version != wire::kVersion) {
    reject(session.socket.get(), "the client speaks shared-memory layout " + std::to_string(message.layout_version) +
                                     " and wire version " + std::to_string(message.wire_version) +
                                     "; this daemon speaks " + std::to_string(shm::kLayoutVersion) + " and " +
                                     std::to_string(wire::kVersion));
    return drop(session);
  }
  if (received != sizeof message) return violate(session, "a message of a wrong size");
  const bool greeted = !session.segments.empty();
  switch (static_cast<MessageKind>(message.kind)) {
    case MessageKind::kHello:
      if (greeted) return violate(session, "a second hello");
      return give_segment(session, message, true);
    case MessageKind::kGrow:
      if (!greeted) return violate(session, "no hello");
      if (session.segments.size() >= limits_.max_segments_per_client)
        return reject(session.socket.get(),
                      "all " + std::to_string(limits_.max_segments_per_client) +
                          " segments of this client still hold requests or replies; release some");
      return give_segment(session, message, false);
    case MessageKind::kRetire: {
      auto& segments = session.segments;
      const auto retired =
          std::find_if(segments.begin(), segments.end(), [&](const auto& s) { return s->id() == message.segment_id; });
      if (retired == segments.end() || segments.size() < 2)
        return violate(session, "retires a segment that it does not have");
      segments.erase(retired);
      return;
    }
    default:
      return violate(session, "a message of unknown kind");
  }
}

void ShmSessions::give_segment(ShmSession& session, const shm::Message& wanted, bool first) {
  std::string why;
  auto segment = Segment::make(budget_, pinner_, limits_, class_of(session.rights), session.next_segment,
                               wanted.request_capacity, wanted.reply_capacity, why);
  if (segment && first) {
    session.wake.reset(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!session.wake || !watch(session.wake.get(), EPOLLIN | EPOLLET, 2 * session.id + 1)) {
      why = std::string("eventfd: ") + std::strerror(errno);
      segment.reset();
    }
  }
  if (!segment) {
    reject(session.socket.get(), why);
    if (first) drop(session);
    return;
  }
  segment->show_turns(polls_ + 1);
  ++session.next_segment;
  shm::Message message = make_message(MessageKind::kSegment);
  message.segment_id = segment->id();
  message.request_capacity = segment->request_capacity();
  message.reply_capacity = segment->reply_capacity();
  const int fds[2] = {segment->memfd(), session.wake.get()};
  if (!shm::send_message(session.socket.get(), message, std::span(fds, first ? 2 : 1))) return drop(session);
  session.segments.push_back(std::move(segment));
}

void ShmSessions::violate(ShmSession& session, const char* why) {
  reject(session.socket.get(), std::string("disconnected: ") + why);
  ++*counters_.violations;
  drop(session);
}

/// The session leaves the list in remove_gone(); requests under way keep its segments until they end.
void ShmSessions::drop(ShmSession& session) {
  session.gone = true;
  any_gone_ = true;
}

void ShmSessions::remove_gone() {
  if (any_gone_) {
    any_gone_ = false;
    std::erase_if(sessions_, [this](const std::shared_ptr<ShmSession>& session) {
      if (!session->gone) return false;
      // The client holds the same eventfd, so that closing our end would not remove it from epoll.
      session->place = {};
      if (session->wake) ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, session->wake.get(), nullptr);
      session->wake.reset();
      session->socket.reset();
      session->segments.clear();
      return true;
    });
  }
  *counters_.clients = sessions_.size();
}

}  // namespace clearance
