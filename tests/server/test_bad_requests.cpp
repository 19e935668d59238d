// Every invalid request gets its rejection with a message, and the next valid one its answer: in the loop alone, and
// over ZeroMQ.
#include <gtest/gtest.h>

#include <set>
#include <zmq.hpp>

#include "client/client.h"
#include "server/core/loop.h"
#include "tests/patience.h"
#include "tests/server/bad_requests.h"
#include "tests/server/core/memory_transport.h"
#include "tests/server/daemon_fixture.h"
#include "tests/server/test_scene.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

std::vector<std::byte> frame_of(const BadRequest& request) {
  std::vector<std::byte> frame(sizeof request.header + request.payload.size());
  std::memcpy(frame.data(), &request.header, sizeof request.header);
  if (!request.payload.empty())
    std::memcpy(frame.data() + sizeof request.header, request.payload.data(), request.payload.size());
  return frame;
}

void expect_rejection(const BadRequest& request, const Frame& reply) {
  ASSERT_EQ(reply.header().type, static_cast<std::uint16_t>(FrameType::kError)) << request.name;
  const auto error = wire::parse_error(wire::split_payload(reply.header(), reply.payload()).body);
  EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(request.code)) << request.name << ": " << error.text;
  EXPECT_EQ(error.text.substr(0, request.text.size()), request.text) << request.name;
  EXPECT_EQ(reply.header().request_id, request.header.request_id) << request.name;
}

void expect_answer(const std::string& after, std::unique_ptr<Frame> frame) {
  ASSERT_EQ(frame->header().type, static_cast<std::uint16_t>(FrameType::kReply)) << "after " << after;
  const Result reply = result_of(std::move(frame));
  ASSERT_EQ(reply.rows(), 1u) << "after " << after;
  EXPECT_EQ(reply.status()[0], Status::kOk) << "after " << after;
  EXPECT_NEAR(reply.distance()[0], 0.15, 1e-9) << "after " << after;
}

TEST(BadRequests, ThereAreEnough) {
  std::set<std::string> names;
  for (const BadRequest& request : bad_requests(1)) names.insert(request.name);
  EXPECT_EQ(names.size(), bad_requests(1).size());
  EXPECT_GE(names.size(), 50u);
}

TEST(BadRequests, AreRejectedByTheLoop) {
  engine::Engine engine(small_scene());
  Loop loop(engine, on_one_thread());
  auto made = std::make_unique<MemoryTransport>();
  MemoryTransport& transport = *made;
  loop.add(std::move(made));
  MemoryClient client;
  const auto evaluate = [&](std::vector<std::byte> frame) {
    transport.send(client, std::move(frame));
    while (loop.turn()) {
    }
    auto reply = std::move(client.replies.at(0));
    client.replies.clear();
    return reply;
  };
  const auto requests = bad_requests(engine.scene_revision());
  for (const BadRequest& request : requests) {
    expect_rejection(request, *evaluate(frame_of(request)));
    expect_answer(request.name, evaluate(good_query(8)));
  }
  EXPECT_EQ(loop.counter("errors"), requests.size());
  EXPECT_EQ(engine.pose_revision(), 0u) << "none of them moved anything";
  EXPECT_EQ(client.sinks, 0);
}

/// A DEALER that sends requests that no client library would.
class RawClient {
 public:
  explicit RawClient(const std::string& url) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::rcvtimeo, 60000);
    socket_.connect(url);
  }
  void send(const std::vector<std::vector<std::byte>>& parts) {
    for (std::size_t i = 0; i < parts.size(); ++i)
      socket_.send(zmq::buffer(parts[i].data(), parts[i].size()),
                   i + 1 < parts.size() ? zmq::send_flags::sndmore : zmq::send_flags::none);
  }
  void send(const std::vector<std::byte>& frame) {
    send({{frame.begin(), frame.begin() + sizeof(wire::FrameHeader)},
          {frame.begin() + sizeof(wire::FrameHeader), frame.end()}});
  }
  std::unique_ptr<MemoryFrame> receive() {
    zmq::message_t head, payload;
    if (!socket_.recv(head) || !socket_.recv(payload)) throw std::runtime_error("no reply");
    std::vector<std::byte> frame(head.size() + payload.size());
    std::memcpy(frame.data(), head.data(), head.size());
    std::memcpy(frame.data() + head.size(), payload.data(), payload.size());
    return std::make_unique<MemoryFrame>(frame.data(), frame.size());
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_{context_, zmq::socket_type::dealer};
};

class BadFramesOverZmq : public testing::Test {
 protected:
  TestFolder folder_;
  Daemon daemon_{{"--scene", folder_.write("scene.yaml", kSmallSceneYaml), "--zmq", "ipc://" + (folder_ / "c.ipc")}};
  RawClient raw_{daemon_.url()};

  void expect_good(const std::string& after) {
    raw_.send(good_query(8));
    expect_answer(after, raw_.receive());
  }
};

TEST_F(BadFramesOverZmq, AreRejectedAndTheDaemonGoesOn) {
  Client client = patient(daemon_.url());
  for (const BadRequest& request : bad_requests(client.scene().revision)) {
    raw_.send(frame_of(request));
    expect_rejection(request, *raw_.receive());
    expect_good(request.name);
  }
  EXPECT_EQ(daemon_.stop(15), 0);
}

TEST_F(BadFramesOverZmq, GarbledPartsAreRejected) {
  const std::vector<std::byte> good = good_query(8);
  const std::vector<std::byte> head(good.begin(), good.begin() + 64), payload(good.begin() + 64, good.end());
  const std::vector<std::byte> short_head(head.begin(), head.begin() + 63);
  const std::string expected = "frame: ZeroMQ carries it in two parts, a header of 64 bytes and a payload; got ";
  const std::pair<std::vector<std::vector<std::byte>>, std::string> cases[] = {
      {{good}, "1 parts, the first of 200 bytes"},
      {{{}}, "1 parts, the first of 0 bytes"},
      {{short_head, payload}, "2 parts, the first of 63 bytes"},
      {{{}, head, payload}, "3 parts, the first of 0 bytes"},
      {{head, payload, payload}, "3 parts, the first of 64 bytes"},
  };
  for (const auto& [parts, text] : cases) {
    raw_.send(parts);
    const auto reply = raw_.receive();
    const auto error = wire::parse_error(wire::split_payload(reply->header(), reply->payload()).body);
    EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kBadFrame));
    EXPECT_EQ(error.text, expected + text);
    EXPECT_EQ(reply->header().request_id, 0u);
    expect_good(text);
  }
}

TEST_F(BadFramesOverZmq, UnknownBodiesAreAStatusNotAnError) {
  Client client = patient(daemon_.url());
  const std::vector<IdPair> pairs{{0, 1}, {0, 77}, {98, 99}};
  Query query;
  query.pairs = pairs;
  const Result reply = client.distances(query);
  ASSERT_EQ(reply.rows(), 3u);
  EXPECT_EQ(reply.status()[0], Status::kOk);
  EXPECT_EQ(reply.status()[1], Status::kUnknownBody);
  EXPECT_TRUE(std::isnan(reply.distance()[1]));
}

TEST_F(BadFramesOverZmq, AMessageBeyondTheLimitCostsOnlyItsSender) {
  expect_good("nothing");
  RawClient other(daemon_.url());
  // ZeroMQ closes the sender's connection as soon as it reads the size.
  other.send({std::vector<std::byte>(64), std::vector<std::byte>(wire::kMaxRequestBytes + 1)});
  other.send(good_query(9));
  expect_good("a message of 256 MiB");
}

TEST_F(BadFramesOverZmq, RandomBytesNeverStopIt) {
  std::mt19937 random(31);
  int answered = 0;
  for (int round = 0; round < 300; ++round) {
    std::vector<std::byte> frame = good_query(8);
    const std::int64_t deadline = 20'000'000;  // a flipped bit may make it wait for poses
    std::memcpy(frame.data() + 64 + offsetof(wire::QueryHeader, deadline_ns), &deadline, sizeof deadline);
    if (round % 3 == 0) {  // noise after a valid header
      std::vector<std::byte> noise(random() % 600);
      for (auto& byte : noise) byte = std::byte(random());
      frame.resize(64);
      const std::uint64_t size = noise.size();
      std::memcpy(frame.data() + offsetof(wire::FrameHeader, payload_bytes), &size, sizeof size);
      const std::uint16_t type = 1 + random() % 8;
      std::memcpy(frame.data() + offsetof(wire::FrameHeader, type), &type, sizeof type);
      frame.insert(frame.end(), noise.begin(), noise.end());
    } else {  // a few flipped bits
      for (int i = 0; i < 3; ++i) frame[random() % frame.size()] ^= std::byte(1 << random() % 8);
    }
    raw_.send(frame);
    const auto reply = raw_.receive();
    answered += reply->header().type == static_cast<std::uint16_t>(FrameType::kError);
  }
  EXPECT_GT(answered, 100) << "most of them are refused";
  expect_good("300 rounds of noise");
  EXPECT_EQ(daemon_.stop(15), 0);
}

}  // namespace
}  // namespace clearance
