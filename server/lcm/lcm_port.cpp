#include "server/lcm/lcm_port.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "server/gateway/process.h"

namespace clearance {
namespace {

using gateway::Bytes;
using gateway::Kind;
using gateway::Message;

class LcmBusPort final : public LcmPort {
 public:
  explicit LcmBusPort(const LcmAddress& address) : bus_(address) {}

  void subscribe(const std::string& name, int queue, Handler handler) override {
    bus_.subscribe(name, queue, std::move(handler));
  }
  std::vector<int> descriptors() const override { return {bus_.descriptor()}; }
  bool handle() override { return bus_.handle(); }
  bool publish(const std::string& name, std::span<const std::byte> message) override {
    return bus_.publish(name, message);
  }

 private:
  LcmBus bus_;
};

gateway::ProcessOptions lcm_process_options(const LcmAddress& address, std::uint64_t memory_bytes) {
  gateway::ProcessOptions options;
  options.url = address.url();
  options.what = "lcm";
  options.memory_bytes = memory_bytes;
  std::string channels;
  for (const char* channel : kLcmChannelsIn) channels += std::string(channel) + "\n";
  const std::string with_buffer = options.url + "&recv_buf_size=" + std::to_string(address.recv_buf_size);
  options.start = {Kind::kStart, 0, with_buffer, {}, Bytes(std::string_view(channels))};
  return options;
}

class LcmGatewayPort final : public LcmPort {
 public:
  LcmGatewayPort(const LcmAddress& address, std::uint64_t memory_bytes)
      : process_(lcm_process_options(address, memory_bytes)) {}

  void subscribe(const std::string& name, int, Handler handler) override {
    if (std::ranges::find(kLcmChannelsIn, name) == std::end(kLcmChannelsIn))
      throw std::logic_error("the gateway does not pass on the channel " + name);
    handlers_[name] = std::move(handler);
  }
  std::vector<int> descriptors() const override {
    return process_.descriptor() < 0 ? std::vector<int>() : std::vector<int>{process_.descriptor()};
  }
  void begin_turn(RequestHandler& inbox) override { process_.turn(inbox); }
  bool has_work() const override { return process_.has_more(); }
  void tick(RequestHandler& inbox) override { process_.tick(inbox); }

  bool handle() override {
    const std::optional<Message> message = process_.receive();
    if (!message) return false;
    const auto handler = handlers_.find(message->name);
    if (message->kind == Kind::kPacket && message->body.bytes <= kLcmDatagramBytes && handler != handlers_.end())
      handler->second(message->body.span());
    else
      process_.lose("it sent something other than an LCM packet");
    return true;
  }

  bool publish(const std::string& name, std::span<const std::byte> message) override {
    constexpr std::uint64_t kMostWaiting = 16 << 20;
    if (!process_.link() || process_.link()->waiting_bytes() > kMostWaiting) return false;
    process_.send({Kind::kPacket, 0, name, {}, Bytes(message)});
    return true;
  }

 private:
  std::map<std::string, Handler> handlers_;
  gateway::Process process_;
};

}  // namespace

std::unique_ptr<LcmPort> open_lcm_port(const LcmAddress& address, std::uint64_t gateway_bytes) {
  if (address.ttl == 0) return std::make_unique<LcmBusPort>(address);
  check_multicast(address);  // here, where an error can be reported
  return std::make_unique<LcmGatewayPort>(address, gateway_bytes);
}

}  // namespace clearance
