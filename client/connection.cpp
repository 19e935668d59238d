#include "client/connection.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "client/channel/url.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Interval between greetings over a transport that can lose them.
constexpr auto kRequestAgain = 200ms;
constexpr auto kShortestHang = 10ms;

std::chrono::nanoseconds hang_of(const ConnectOptions& options) {
  const auto hang = options.hang.value_or(std::max<std::chrono::nanoseconds>(1s, options.timeout / 5));
  if (hang != 0ns && hang < kShortestHang)
    throw std::invalid_argument("hang: expected 0, or 10 ms and more, got " + std::to_string(hang.count()) + " ns");
  return hang;
}

}  // namespace

std::string seconds(std::chrono::nanoseconds duration) {
  char text[32];
  std::snprintf(text, sizeof text, "%g s", std::chrono::duration<double>(duration).count());
  return text;
}

Deadline deadline_in(std::chrono::nanoseconds duration) {
  constexpr std::chrono::nanoseconds kLongest = std::chrono::hours(24 * 365);
  return Clock::now() + std::clamp(duration, std::chrono::nanoseconds(0), kLongest);
}

Connection::Connection(std::span<const std::string> urls, const ConnectOptions& options)
    : urls_(urls.begin(), urls.end()), options_(options), hang_(hang_of(options)), watch_(hang_) {
  if (urls_.empty()) throw std::invalid_argument("connect: expected at least one url");
  for (const std::string& url : urls_) parse_url(url);  // reports an invalid url at once, not on its first use
  connect_to(0, options.timeout);
}

wire::FrameHeader Connection::next_header(wire::FrameType type, std::uint64_t payload_bytes,
                                          std::uint64_t scene_revision, std::uint64_t records_bytes) {
  wire::FrameHeader header = wire::make_header(type, next_request_id_++, payload_bytes, scene_revision);
  if (options_.as_planning) header.flags = wire::kFramePlanning;
  return wire::with_records(header, records_bytes);
}

Connection::~Connection() {
  // In a forked child, the channel's sockets, threads and slots belong to the parent, and stay open.
  if (fork_guard_.forked()) (void)channel_.release();
}

void Connection::check_process() const {
  if (fork_guard_.forked())
    throw ConnectionError(url_ + ": this connection was opened before a fork; the child process must open a new one");
}

/// Connects to the url of that index, or to the next one that responds.
/// \param patience timeout of the last one
void Connection::connect_to(std::size_t first, std::chrono::nanoseconds patience) {
  std::string why;
  for (std::size_t i = 0; i < urls_.size(); ++i) {
    const bool is_last = i + 1 == urls_.size();
    const Deadline deadline = deadline_in(is_last || hang_ == 0ns ? patience : std::min(patience, hang_));
    try {
      at_ = (first + i) % urls_.size();
      channel_ = open_channel(urls_[at_], options_, deadline);
      url_ = channel_->url();
      watch_ = HangWatch(hang_);
      channel_->watch_by([this] { return look_for_hang(Clock::now()); });
      has_hung_ = false;
      if (!has_met_) meet(deadline);
      return;
    } catch (const RequestError&) {
      return;  // the daemon is too busy to send its epoch, which the first request fetches again
    } catch (const ConnectionError& error) {
      if (urls_.size() == 1) throw;
      why += (why.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  throw ConnectionError(why);
}

/// Reconnects after a call has thrown because the daemon was lost or hung. Requests keep their epoch and scene, so that
/// another daemon rejects them (kNewEpoch, kWrongScene).
void Connection::connect_anew() {
  oldest_request_id_ = next_request_id_;
  connect_to((at_ + 1) % urls_.size(), has_hung_ ? std::min(timeout_, hang_) : timeout_);
}

/// Fetches the daemon's epoch. Throws RequestError if the daemon rejects the request.
void Connection::meet(Deadline deadline) {
  std::unique_ptr<Frame> frame;
  while (!frame) {
    const wire::FrameHeader header = wire::make_header(wire::FrameType::kPing, next_own_request_++, 0);
    std::memcpy(channel_->begin(sizeof header, 0), &header, sizeof header);
    channel_->send();
    frame = await(header.request_id, channel_->may_lose() ? std::min(deadline, deadline_in(kRequestAgain)) : deadline);
    if (frame) break;
    channel_->forget(header.request_id);
    if (Clock::now() >= deadline) throw TimeoutError(url_ + ": the daemon does not answer");
  }
  try {
    const wire::PayloadParts parts = wire::split_payload(frame->header(), frame->payload());
    if (frame->header().type == static_cast<std::uint16_t>(wire::FrameType::kError)) {
      const auto error = wire::parse_error(parts.body);
      throw RequestError(error.header.code, error.text);
    }
    epoch_ = wire::epoch_of(frame->header(), frame->payload());
  } catch (const wire::WireError& error) {
    throw ConnectionError(url_ + ": the daemon sent a malformed frame: " + error.what());
  }
  has_met_ = true;
  epoch_record_.clear();
  if (epoch_) wire::append_epoch(epoch_record_, epoch_, wire::kRecordRequired);
}

const std::vector<std::byte>& Connection::prepare() {
  check_process();
  if (channel_->lost() || has_hung_) connect_anew();
  if (!has_met_) meet(deadline_in(timeout_));
  return epoch_record_;
}

std::byte* Connection::begin(std::uint64_t frame_bytes, std::uint64_t reply_bytes) {
  if (channel_->signs_queue_up()) watch_.expect(frame_bytes + reply_bytes);
  return channel_->begin(frame_bytes, reply_bytes);
}

std::unique_ptr<Frame> Connection::await(std::uint64_t request_id, Deadline deadline) {
  check_process();
  if (request_id < oldest_request_id_)
    throw ConnectionError(url_ + ": the daemon disconnected before request " + std::to_string(request_id) +
                          " was answered; the connection has been replaced");
  for (;;) {
    if (auto frame = channel_->receive(request_id, std::min(deadline, watch_.due()))) return frame;
    const auto now = Clock::now();
    look_for_hang(now);
    if (now >= deadline) return nullptr;
  }
}

/// Throws DaemonHung. Returns the time of the next check.
Deadline Connection::look_for_hang(Deadline now) {
  if (now >= watch_.due() && watch_.look(*channel_, now)) {
    has_hung_ = true;
    throw DaemonHung(url_ + ": the daemon hangs: its loop has been blocked for " + seconds(hang_) +
                     " with a request under way");
  }
  return watch_.due();
}

std::uint64_t Connection::acknowledge_epoch() {
  prepare();
  const Deadline deadline = deadline_in(timeout_);
  channel_->bind(deadline);
  meet(deadline);
  return epoch_;
}

}  // namespace clearance
