// Baseline of LCM: liblcm alone, publishing and subscribing on two channels of the same network.
#include <lcm/lcm.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <stdexcept>

#include "bench/latency/bench_floor.h"
#include "wire/lcm/lcm_bus.h"

namespace clearance::cli {
namespace {

constexpr std::chrono::milliseconds kTimeout{200};
constexpr int kQueue = 512;

/// One end: sends and receives messages of at most one datagram, as the transport does.
class Lcm {
 public:
  Lcm(const std::string& url, const std::string& in) : lcm_(lcm_create(url.c_str())) {
    if (!lcm_) throw std::runtime_error("floor: cannot open " + url);
    const auto take = [](const lcm_recv_buf_t* received, const char*, void* user) {
      auto* self = static_cast<Lcm*>(user);
      if (self->received_bytes_ == 0)
        std::memcpy(self->first_, received->data, std::min(sizeof self->first_, std::size_t{received->data_size}));
      self->received_bytes_ += received->data_size;
    };
    lcm_subscription_set_queue_capacity(lcm_subscribe(lcm_, in.c_str(), take, this), kQueue);
  }
  ~Lcm() { lcm_destroy(lcm_); }
  Lcm(const Lcm&) = delete;
  Lcm& operator=(const Lcm&) = delete;

  void send(const std::string& channel, const std::vector<std::byte>& bytes) {
    for (std::size_t at = 0; at < bytes.size(); at += kLcmMessageBytes)
      lcm_publish(lcm_, channel.c_str(), bytes.data() + at,
                  static_cast<unsigned>(std::min(kLcmMessageBytes, bytes.size() - at)));
  }
  /// Waits for the given number of bytes; false if `timeout` passes without a message. Discards the rest of an
  /// incomplete exchange.
  bool receive(std::size_t bytes, std::chrono::milliseconds timeout) {
    while (received_bytes_ < bytes) {
      if (lcm_handle_timeout(lcm_, static_cast<int>(timeout.count())) <= 0) {
        received_bytes_ = 0;
        return false;
      }
    }
    received_bytes_ = 0;
    return true;
  }

  /// Start of the bytes last received.
  const std::byte* first() const { return first_; }

 private:
  lcm_t* lcm_;
  std::size_t received_bytes_ = 0;
  std::byte first_[sizeof(std::int64_t)] = {};
};

class LcmFloor final : public Floor {
 public:
  LcmFloor(const std::string& url, const EchoSize& size)
      : url_(parse_lcm_address(url).url()),
        channel_("CLEARANCE_BENCH_" + std::to_string(draw_lcm_id())),
        request_(size.request_bytes),
        reply_bytes_(size.reply_bytes),
        echo_({"lcm", url_, channel_, std::to_string(size.request_bytes), std::to_string(size.reply_bytes)}),
        lcm_(url_, channel_ + "_R") {}

  bool exchange(std::chrono::nanoseconds held) override {
    request_to_hold(request_.data(), held);
    lcm_.send(channel_ + "_Q", request_);
    if (lcm_.receive(reply_bytes_, kTimeout)) return true;
    if (!echo_.alive()) throw std::runtime_error("floor: the echo process is gone");
    return false;
  }
  std::string description() const override { return "liblcm alone, in messages of at most 48 KB"; }

 private:
  std::string url_, channel_;
  std::vector<std::byte> request_;
  std::size_t reply_bytes_;
  EchoProcess echo_;
  Lcm lcm_;
};

}  // namespace

std::unique_ptr<Floor> open_lcm_floor(const std::string& url, const EchoSize& size) {
  return std::make_unique<LcmFloor>(url, size);
}

int run_lcm_echo(const std::vector<std::string>& arguments) {
  const std::string channel = arguments.at(1);
  Lcm lcm(arguments.at(0), channel + "_Q");
  const std::size_t request_bytes = std::stoull(arguments.at(2));
  const std::vector<std::byte> reply(std::stoull(arguments.at(3)));
  if (::write(STDOUT_FILENO, "ready \n", 7) != 7) return 1;
  ::close(STDOUT_FILENO);
  for (;;) {
    if (!lcm.receive(request_bytes, std::chrono::milliseconds(100))) continue;
    hold(lcm.first());
    lcm.send(channel + "_R", reply);
  }
}

}  // namespace clearance::cli
