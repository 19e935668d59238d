#include "server/gateway/zap_handler.h"

#include <cstring>
#include <utility>
#include <vector>

#include "wire/zmq_calls.h"

namespace clearance::gateway {
namespace {

constexpr const char* kHandlerEndpoint = "inproc://zeromq.zap.01";
constexpr const char* kMonitorEndpoint = "inproc://events";
constexpr const char* kDomain = "clearance";
constexpr int kEventsPerTurn = 16;
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

ZapHandler::ZapHandler(zmq::context_t& context, Callbacks callbacks)
    : callbacks_(std::move(callbacks)),
      socket_(context, zmq::socket_type::rep),
      monitor_(context, zmq::socket_type::pair) {
  socket_.set(zmq::sockopt::linger, 0);
  socket_.bind(kHandlerEndpoint);
}

void ZapHandler::guard(zmq::socket_t& socket, const std::string& secret_key) {
  const auto set = [&socket](int option, const void* value, std::size_t bytes) {
    if (zmq_setsockopt(socket.handle(), option, value, bytes) != 0) throw zmq::error_t();
  };
  const int yes = 1;
  set(ZMQ_CURVE_SERVER, &yes, sizeof yes);
  set(ZMQ_CURVE_SECRETKEY, secret_key.data(), secret_key.size());
  set(ZMQ_ZAP_DOMAIN, kDomain, std::strlen(kDomain));
  const int events = ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL;
  if (zmq_socket_monitor(socket.handle(), kMonitorEndpoint, events) != 0) throw zmq::error_t();
  monitor_.set(zmq::sockopt::linger, 0);
  monitor_.connect(kMonitorEndpoint);
}

void ZapHandler::serve() {
  if (!waits_ && has_input(socket_)) read_request();
  for (int i = 0; i < kEventsPerTurn && has_input(monitor_); ++i) read_event();
}

void ZapHandler::read_request() {
  const auto parts = receive_all(socket_);
  if (parts.empty()) return;
  request_ = parts.size() > 1 ? parts[1].to_string() : "";
  key_.clear();
  waits_ = true;
  if (parts.size() != kRequestParts || parts[5].to_string_view() != "CURVE" || parts[6].size() != 32)
    return finish(false);
  char text[41];
  zmq_z85_encode(text, parts[6].data<std::uint8_t>(), 32);
  key_ = text;
  callbacks_.authenticate(parts[3].to_string(), key_);
}

void ZapHandler::finish(bool is_authorized) {
  if (!std::exchange(waits_, false)) return;
  const auto reply = [this](const std::string& text, bool more) {
    zmq::message_t part(text.data(), text.size());
    clearance::send(socket_, part, more ? zmq::send_flags::sndmore : zmq::send_flags::none);
  };
  reply("1.0", true);
  reply(request_, true);
  reply(is_authorized ? "200" : "400", true);
  reply(is_authorized ? "" : "this key is not authorized", true);
  reply(is_authorized ? key_ : "", true);  // user id, which the messages of this connection carry
  reply("", false);
}

void ZapHandler::read_event() {
  const auto parts = receive_all(monitor_);
  if (parts.size() >= 2) callbacks_.handshake_failed(parts[1].to_string());
}

std::string key_of(const zmq::message_t& message) {
  const char* user = zmq_msg_gets(const_cast<zmq_msg_t*>(message.handle()), "User-Id");
  return user ? user : "";
}

}  // namespace clearance::gateway
