// The client's channel over LCM and a server that loses, repeats, reorders and forges messages: a reply is correct or
// does not arrive.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <random>
#include <thread>

#include "client/channel/channel.h"
#include "client/client.h"
#include "tests/lcm/lcm_fixture.h"
#include "wire/lcm/lcm_check.h"
#include "wire/lcm/lcm_frames.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using clearance_lcm::frame_t;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Bytes = std::vector<std::byte>;

/// Answers each request frame with parts that the test selects; greetings are answered as by a daemon.
class ScriptedServer {
 public:
  using Script = std::function<std::vector<frame_t>(const Bytes& reply, std::vector<frame_t> parts)>;

  ScriptedServer(const LcmAddress& address, Script script) : bus_(address), script_(std::move(script)) {
    bus_.subscribe("CLEARANCE_FRAME_IN", 512, [this](std::span<const std::byte> packet) { take(packet); });
    thread_ = std::thread([this] {
      while (!stopping_) {
        if (bus_.wait(std::chrono::steady_clock::now() + milliseconds(10))) bus_.handle();
      }
    });
  }
  ~ScriptedServer() {
    stopping_ = true;
    thread_.join();
  }

  /// The parts of a reply as a daemon sends them.
  std::vector<frame_t> parts_of(const Bytes& frame, std::int64_t client, std::int64_t request) {
    ++sequence_;
    std::vector<frame_t> parts;
    for (std::uint64_t i = 0; i < frame_part_count(frame.size()); ++i) {
      frame_t part = frame_part(frame, i);
      part.server_id = 11;
      part.client_id = client;
      part.request_id = request;
      part.sequence = sequence_;
      parts.push_back(part);
    }
    return parts;
  }
  std::size_t requests() const { return requests_; }

 private:
  void take(std::span<const std::byte> packet) {
    frame_t part;
    if (!decode_checked(packet, part).empty()) return;
    const auto whole = assembler_.add(part, FrameAssembler::Clock::now());
    if (!whole) return;
    wire::FrameHeader header;
    const auto payload = wire::split_frame(whole->frame.span(), header);
    header.type = static_cast<std::uint16_t>(wire::FrameType::kPong);
    Bytes reply(sizeof header + payload.size());
    std::memcpy(reply.data(), &header, sizeof header);
    if (!payload.empty()) std::memcpy(reply.data() + sizeof header, payload.data(), payload.size());
    std::vector<frame_t> parts = parts_of(reply, whole->client_id, whole->request_id);
    const bool greeting = header.request_id >= std::uint64_t{1} << 62;
    if (!greeting) {
      ++requests_;
      parts = script_(reply, std::move(parts));
    }
    for (const frame_t& p : parts) {
      while (!pacer_.ready(LcmPacer::Clock::now())) std::this_thread::sleep_for(pacer_.pause());
      bus_.publish_message("CLEARANCE_FRAME_OUT", p);
      pacer_.sent(p.bytes.size());
    }
  }

  LcmBus bus_;
  Script script_;
  FrameAssembler assembler_{{.frame_bytes = 32 << 20, .total_bytes = 64 << 20, .frames = 64}};
  LcmPacer pacer_;
  std::int64_t sequence_ = 0;
  std::atomic<std::size_t> requests_{0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

std::vector<frame_t> as_is(const Bytes&, std::vector<frame_t> parts) {
  return parts;
}

Bytes random_payload(std::mt19937& random, std::size_t size) {
  Bytes bytes(size);
  for (auto& b : bytes) b = static_cast<std::byte>(random());
  return bytes;
}

class LcmChannelTest : public LcmTest {
 protected:
  static Deadline in(std::chrono::nanoseconds time) { return Deadline::clock::now() + time; }

  std::unique_ptr<Channel> open() { return open_lcm_channel(url(), "", in(kPatience)); }

  static void evaluate(Channel& channel, std::uint64_t request, const Bytes& payload) {
    const auto header = wire::make_header(wire::FrameType::kPing, request, payload.size());
    std::byte* room = channel.begin(sizeof header + payload.size(), 0);
    std::memcpy(room, &header, sizeof header);
    if (!payload.empty()) std::memcpy(room + sizeof header, payload.data(), payload.size());
    channel.send();
  }
  static bool same(const Frame& frame, const Bytes& payload) {
    return std::equal(frame.payload().begin(), frame.payload().end(), payload.begin(), payload.end()) &&
           reinterpret_cast<std::uintptr_t>(frame.payload().data()) % 64 == 0;
  }
  /// Repeats a request until an answer arrives (a part may be lost on a busy machine); every answer must be correct.
  static bool echo(Channel& channel, std::uint64_t& request, const Bytes& payload) {
    for (const Deadline end = in(kPatience); Deadline::clock::now() < end;) {
      evaluate(channel, ++request, payload);
      if (const auto frame = channel.receive(request, in(seconds(2)))) return same(*frame, payload);
      channel.forget(request);
    }
    return false;
  }
};

TEST_F(LcmChannelTest, EchoesOfAllSizes) {
  ScriptedServer server(address_, as_is);
  const auto channel = open();
  EXPECT_EQ(channel->url(), url());
  std::mt19937 random(1);
  std::uint64_t request = 0;
  for (const std::size_t size : {0ul, 1ul, 48576ul, 48577ul, 200000ul, 1500000ul}) {
    EXPECT_TRUE(echo(*channel, request, random_payload(random, size))) << size << " bytes";
  }
}

TEST_F(LcmChannelTest, AnswersOutOfOrderAreKept) {
  ScriptedServer server(address_, as_is);
  const auto channel = open();
  for (std::uint64_t id = 1; id <= 5; ++id) evaluate(*channel, id, Bytes(id, std::byte(id)));
  for (std::uint64_t id = 5; id >= 1; --id) {
    const auto frame = channel->receive(id, in(seconds(10)));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->header().request_id, id);
    EXPECT_EQ(frame->payload().size(), id);
  }
}

TEST_F(LcmChannelTest, ALostPartIsADeadlinePassed) {
  std::atomic<int> lose{0};
  ScriptedServer server(address_, [&](const Bytes&, std::vector<frame_t> parts) {
    if (lose >= 0) parts.erase(parts.begin() + lose);
    return parts;
  });
  const auto channel = open();
  std::mt19937 random(2);
  const Bytes payload = random_payload(random, 200000);
  std::uint64_t request = 0;
  for (lose = 0; lose < 5; ++lose) {
    const Deadline end = in(kPatience);
    for (const std::uint64_t before = server.requests();
         server.requests() == before;) {  // until the server has received one
      ASSERT_LT(Deadline::clock::now(), end);
      evaluate(*channel, ++request, payload);
      EXPECT_FALSE(channel->receive(request, in(milliseconds(100))));
      channel->forget(request);
    }
  }
  lose = -1;
  EXPECT_TRUE(echo(*channel, request, payload));
}

TEST_F(LcmChannelTest, ShuffledAndRepeatedPartsMakeOneReply) {
  std::mt19937 shuffle(3);
  ScriptedServer server(address_, [&](const Bytes&, std::vector<frame_t> parts) {
    const auto once = parts;
    parts.insert(parts.end(), once.begin(), once.end());
    std::shuffle(parts.begin(), parts.end(), shuffle);
    return parts;
  });
  const auto channel = open();
  std::mt19937 random(4);
  std::uint64_t request = 0;
  for (int round = 0; round < 5; ++round) EXPECT_TRUE(echo(*channel, request, random_payload(random, 300000)));
}

TEST_F(LcmChannelTest, HalvesOfTwoAnswersMakeNone) {
  // The request was answered twice (a repeated datagram); the even parts of one answer and the odd parts of the other
  // are lost.
  ScriptedServer* self = nullptr;
  ScriptedServer server(address_, [&](const Bytes& reply, std::vector<frame_t> parts) {
    Bytes other = reply;
    for (std::size_t i = sizeof(wire::FrameHeader); i < other.size(); ++i) other[i] ^= std::byte{0xFF};
    const auto again = self->parts_of(other, parts[0].client_id, parts[0].request_id);
    for (std::size_t i = 1; i < parts.size(); i += 2) parts[i] = again[i];
    return parts;
  });
  self = &server;
  const auto channel = open();
  std::mt19937 random(5);
  for (std::uint64_t request = 1; request <= 3; ++request) {
    evaluate(*channel, request, random_payload(random, 150000));
    EXPECT_FALSE(channel->receive(request, in(milliseconds(100))));
  }
  EXPECT_EQ(server.requests(), 3u);
}

TEST_F(LcmChannelTest, WhatIsNotOursOrNotAFrameIsPassedOver) {
  std::mt19937 random(6);
  const Bytes payload = random_payload(random, 100000);
  int forged = 0;
  ScriptedServer server(address_, [&](const Bytes&, std::vector<frame_t> parts) {
    std::vector<frame_t> sent;
    const auto forge = [&](auto change) {
      auto wrong = parts;
      for (auto& part : wrong) {
        part.sequence += 1000 * ++forged;
        change(part);
      }
      sent.insert(sent.end(), wrong.begin(), wrong.end());
    };
    forge([](frame_t& p) { p.client_id ^= 1; });
    forge([](frame_t& p) { p.request_id += 1; });
    forge([](frame_t& p) { p.server_id += 1, p.bytes.back() ^= 1; });  // the answer of another daemon
    forge([](frame_t& p) { p.frame_bytes = std::int64_t{1} << 40; });
    forge([](frame_t& p) { p.parts += 1; });
    // Whole frames with an invalid header: magic, version, size, another request.
    forge([](frame_t& p) { p.bytes[0] ^= p.part == 0; });
    forge([](frame_t& p) { p.bytes[4] ^= p.part == 0; });
    forge([](frame_t& p) { p.bytes[16] ^= p.part == 0; });
    forge([](frame_t& p) { p.bytes[8] ^= p.part == 0; });
    sent.insert(sent.end(), parts.begin(), parts.end());
    return sent;
  });
  const auto channel = open();
  RawSender raw(address_.port);
  const auto garbage = random_payload(random, 500);
  raw.send(garbage);
  raw.send(RawSender::datagram("CLEARANCE_FRAME_OUT", garbage));
  auto endless = RawSender::datagram("CLEARANCE_FRAME_OUT", {});
  endless.pop_back();  // the channel's name is not terminated
  raw.send(endless);
  std::uint64_t request = 0;
  for (const std::size_t size : {100000ul, 1000ul})
    EXPECT_TRUE(echo(*channel, request, Bytes(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(size))));
  EXPECT_GE(forged, 18);
}

TEST_F(LcmChannelTest, PrefixesKeepNetworksApart) {
  LcmAddress other = address_;
  other.prefix = "two/";
  ScriptedServer server(other, as_is);
  EXPECT_THROW(open_lcm_channel(url(), "", in(milliseconds(300))), ConnectionError);
  EXPECT_NO_THROW(open_lcm_channel(url(), "two/", in(kPatience)));
  EXPECT_NO_THROW(open_lcm_channel(url("&prefix=two/"), "", in(kPatience)));
}

TEST_F(LcmChannelTest, NoDaemon) {
  try {
    open_lcm_channel(url(), "", in(milliseconds(250)));
    FAIL() << "connected to nobody";
  } catch (const ConnectionError& error) {
    EXPECT_EQ(error.what(),
              url() + ": no daemon answers; is clearanced running with --lcm and this group, port and prefix?");
  }
}

TEST_F(LcmChannelTest, RequestsHaveALimit) {
  ScriptedServer server(address_, as_is);
  const auto channel = open();
  try {
    channel->begin((16 << 20) + 1, 0);
    FAIL() << "room for too large a request";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge));
    EXPECT_EQ(error.what(), url() + ": a request of 16777217 bytes; over LCM at most 16777216");
  }
}

}  // namespace
}  // namespace clearance
