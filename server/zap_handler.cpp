#include "zap_handler.h"

#include <spdlog/spdlog.h>

#include <cstring>

#include "log_text.h"
#include "zmq_calls.h"

namespace clearance {
namespace {

constexpr const char* kHandlerEndpoint = "inproc://zeromq.zap.01";
constexpr const char* kMonitorEndpoint = "inproc://events";
constexpr const char* kDomain = "clearance";
constexpr int kAnswersPerTurn = 16;
constexpr std::size_t kRequestParts = 7;  // version, request id, domain, address, identity, mechanism, key

std::vector<zmq::message_t> receive_all(zmq::socket_t& socket) {
  std::vector<zmq::message_t> parts;
  zmq::message_t part;
  if (!receive(socket, part, zmq::recv_flags::dontwait)) return parts;
  for (bool more = true; more;) {
    more = part.more();
    parts.push_back(std::move(part));
    if (more) receive(socket, part, zmq::recv_flags::none);
  }
  return parts;
}

}  // namespace

ZapHandler::ZapHandler(zmq::context_t& context, std::shared_ptr<KeyRing> keys)
    : socket_(context, zmq::socket_type::rep), monitor_(context, zmq::socket_type::pair), keys_(std::move(keys)) {
  socket_.set(zmq::sockopt::linger, 0);
  socket_.bind(kHandlerEndpoint);
}

void ZapHandler::guard(zmq::socket_t& socket) {
  const auto set = [&socket](int option, const void* value, std::size_t bytes) {
    if (zmq_setsockopt(socket.handle(), option, value, bytes) != 0) throw zmq::error_t();
  };
  const int yes = 1;
  set(ZMQ_CURVE_SERVER, &yes, sizeof yes);
  set(ZMQ_CURVE_SECRETKEY, keys_->own().secret_key.data(), keys_->own().secret_key.size());
  set(ZMQ_ZAP_DOMAIN, kDomain, std::strlen(kDomain));
  const int events = ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL;
  if (zmq_socket_monitor(socket.handle(), kMonitorEndpoint, events) != 0) throw zmq::error_t();
  monitor_.set(zmq::sockopt::linger, 0);
  monitor_.connect(kMonitorEndpoint);
}

std::vector<int> ZapHandler::descriptors() const {
  return {socket_.get(zmq::sockopt::fd), monitor_.get(zmq::sockopt::fd)};
}

bool ZapHandler::has_work() const {
  return has_input(socket_) || has_input(monitor_);
}

void ZapHandler::serve(Inbox& inbox) {
  for (int i = 0; i < kAnswersPerTurn && has_input(socket_); ++i) answer(inbox);
  for (int i = 0; i < kAnswersPerTurn && has_input(monitor_); ++i) read_event(inbox);
}

void ZapHandler::answer(Inbox& inbox) {
  const auto parts = receive_all(socket_);
  if (parts.empty()) return;
  std::string key;
  if (parts.size() == kRequestParts && parts[5].to_string_view() == "CURVE" && parts[6].size() == 32) {
    char text[41];
    zmq_z85_encode(text, parts[6].data<std::uint8_t>(), 32);
    key = text;
  }
  refresh();
  const KeyRing::Entry* entry = keys_->find(key);
  const std::string address = parts.size() > 3 ? parts[3].to_string() : "";
  if (entry) {
    ++inbox.counter("zmq.keys_accepted");
    spdlog::info("event=key_accepted address={} key=\"{}\" name=\"{}\" rights={}", log_text(address), log_text(key),
                 log_text(entry->name), rights_text(entry->rights));
  } else {
    complain(inbox,
             "reason=\"this key is not authorized\" address=" + log_text(address) + " key=\"" + log_text(key) + "\"");
  }
  const auto reply = [this](const std::string& text, bool more) {
    zmq::message_t part(text.data(), text.size());
    clearance::send(socket_, part, more ? zmq::send_flags::sndmore : zmq::send_flags::none);
  };
  reply("1.0", true);
  reply(parts.size() > 1 ? parts[1].to_string() : "", true);
  reply(entry ? "200" : "400", true);
  reply(entry ? "" : "this key is not authorized", true);
  reply(entry ? key : "", true);  // the user id: what the messages of this connection carry
  reply("", false);
}

void ZapHandler::read_event(Inbox& inbox) {
  const auto parts = receive_all(monitor_);
  if (parts.size() < 2) return;
  complain(inbox,
           "reason=\"the handshake failed: no keys, or another server's\" endpoint=" + log_text(parts[1].to_string()));
}

void ZapHandler::complain(Inbox& inbox, const std::string& what) {
  ++inbox.counter("zmq.refused");
  const auto now = std::chrono::steady_clock::now();
  if (now < next_line_) {
    ++unsaid_;  // whoever knocks all the time does not fill the log
    return;
  }
  next_line_ = now + std::chrono::seconds(1);
  spdlog::warn("event=zmq_refused more={} {}", std::exchange(unsaid_, 0), what);
}

std::string ZapHandler::key_of(const zmq::message_t& message) {
  const char* user = zmq_msg_gets(const_cast<zmq_msg_t*>(message.handle()), "User-Id");
  return user ? user : "";
}

Rights ZapHandler::rights_of(const zmq::message_t& message) const {
  const KeyRing::Entry* entry = keys_->find(key_of(message));
  return entry ? entry->rights : 0;
}

void ZapHandler::refresh() {
  try {
    if (keys_->refresh()) spdlog::info("event=keys_read keys={}", keys_->size());
  } catch (const std::runtime_error& error) {
    spdlog::error("event=keys_not_read error=\"{}\"", log_text(error.what()));
  }
}

}  // namespace clearance
