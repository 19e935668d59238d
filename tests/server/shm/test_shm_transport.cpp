// The shared-memory transport and its channel: frames of every size, slots, growth, and the rules of both ends.
#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <numeric>

#include "tests/server/shm/shm_echo.h"

namespace clearance {
namespace {

using Mode = EchoRequestHandler::Mode;

class ShmTransport : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string path_ = folder_ / "c.sock";
};

std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

TEST_F(ShmTransport, EchoesFramesOfManySizes) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  EXPECT_EQ(channel->url(), "shm://" + path_);
  const std::size_t first_request = 256 << 10, first_reply = 1 << 20;
  const std::vector<std::size_t> sizes = {0,
                                          1,
                                          63,
                                          64,
                                          65,
                                          4095,
                                          4096,
                                          first_request - 65,
                                          first_request - 64,
                                          first_request - 63,
                                          first_reply - 64,
                                          first_reply - 63,
                                          5 << 20,
                                          64 << 20,
                                          3,
                                          0,
                                          64 << 20,
                                          1000};
  std::uint64_t id = 0;
  for (const std::size_t size : sizes) {
    const auto payload = random_bytes(size, ++id);
    send_ping(*channel, id, payload);
    EXPECT_TRUE(echoes(*channel, id, payload)) << size;
  }
  EXPECT_EQ(server.call([](EchoServer& s) { return s.handler.frames; }), sizes.size() + 3)
      << "three replies should have outgrown their slot";
  EXPECT_EQ(server.counter("shm.clients"), 1u);
}

// Every wake-up must arrive, on both sides: the server sleeps after each frame, and the client as well without
// spinning.
TEST_F(ShmTransport, NoWakeUpIsLost) {
  EchoThread server(path_);
  for (const char* options : {"", "?spin_us=0", "?spin_us=200"}) {
    auto channel = open_shm_channel(path_ + options, soon());
    for (std::uint64_t id = 1; id <= 3000; ++id) {
      send_ping(*channel, id, {});
      ASSERT_TRUE(echoes(*channel, id, {})) << options << " " << id;
    }
  }
  EXPECT_EQ(server.idle_timeouts(), 0);
}

TEST_F(ShmTransport, ManyOutstandingRequestsAreAnsweredInAnyOrder) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  std::mt19937_64 random(1);
  bool reordered = false;
  for (int round = 0; round < 50; ++round) {
    server.set_mode(Mode::kHold);
    std::vector<std::uint64_t> ids(16);
    std::iota(ids.begin(), ids.end(), 1000 * round + 1);
    std::vector<std::vector<std::byte>> payloads;
    for (const auto id : ids) {
      payloads.push_back(random_bytes(random() % 5000, id));
      send_ping(*channel, id, payloads.back());
    }
    server.await_held(16);
    std::vector<std::size_t> order(16);
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), random);
    reordered |= !std::is_sorted(order.begin(), order.end());
    server.call([&](EchoServer& s) {
      for (const auto i : order) s.handler.answer_held(i);
      s.handler.held.clear();
    });
    std::shuffle(order.begin(), order.end(), random);
    for (const auto i : order) EXPECT_TRUE(echoes(*channel, ids[i], payloads[i]));
  }
  EXPECT_TRUE(reordered);
}

TEST_F(ShmTransport, RepliesStayWhileTheirFramesLive) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  std::vector<std::unique_ptr<Frame>> frames;
  std::vector<std::vector<std::byte>> payloads;
  for (std::uint64_t id = 1; id <= 16; ++id) {
    payloads.push_back(random_bytes(2000, id));
    send_ping(*channel, id, payloads.back());
    frames.push_back(channel->receive(id, soon()));
    ASSERT_TRUE(frames.back());
  }
  const auto all_there = [&] {
    for (std::size_t i = 0; i < frames.size(); ++i)
      if (frames[i] &&
          !std::equal(payloads[i].begin(), payloads[i].end(), frames[i]->payload().begin(), frames[i]->payload().end()))
        return false;
    return true;
  };
  EXPECT_TRUE(all_there());
  EXPECT_NE(error_of([&] { send_ping(*channel, 17, {}); })
                .find("all 16 slots are taken: 0 requests under way, 0 replies not yet "
                      "received, 16 replies still held"),
            std::string::npos);
  frames[5].reset();
  for (std::uint64_t id = 100; id < 200; ++id) {  // the one free slot, repeatedly
    send_ping(*channel, id, random_bytes(3000, id));
    EXPECT_TRUE(echoes(*channel, id, random_bytes(3000, id)));
  }
  EXPECT_TRUE(all_there());
  channel.reset();  // the mapping outlives the channel
  server.stop();
  EXPECT_TRUE(all_there());
}

TEST_F(ShmTransport, UnreceivedRepliesAndRequestsUnderWayTakeSlots) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  for (std::uint64_t id = 1; id <= 10; ++id) send_ping(*channel, id, {});
  auto last = channel->receive(10, soon());
  server.set_mode(Mode::kHold);
  for (std::uint64_t id = 11; id <= 16; ++id) send_ping(*channel, id, {});
  EXPECT_NE(error_of([&] {
              channel->begin(64, 0);
            }).find("6 requests under way, 9 replies not yet received, 1 replies still held"),
            std::string::npos);
  for (std::uint64_t id = 1; id <= 9; ++id) EXPECT_TRUE(echoes(*channel, id, {}));
  server.set_mode(Mode::kEcho);
  send_ping(*channel, 20, {});
  EXPECT_TRUE(echoes(*channel, 20, {}));
}

// The same request id in the same slot, while the first one's reply is still to come: generations distinguish them.
TEST_F(ShmTransport, TheLateReplyOfAForgottenRequestIsNotTakenForAnother) {
  ShmLimits limits;
  limits.slots = 1;
  EchoThread server(path_, limits);
  auto channel = open_shm_channel(path_, soon());
  for (int round = 0; round < 100; ++round) {
    server.set_mode(Mode::kHold);
    send_ping(*channel, 7, random_bytes(100, 1));
    EXPECT_EQ(channel->receive(7, std::chrono::steady_clock::now()), nullptr);
    channel->forget(7);
    EXPECT_THROW(channel->receive(7, soon()), ConnectionError);
    server.await_held(1);
    server.call([](EchoServer& s) {
      s.handler.mode = Mode::kEcho;
      s.handler.answer_held(0);
      s.handler.held.clear();
    });
    send_ping(*channel, 7, random_bytes(100, 2));  // waits for the slot
    EXPECT_TRUE(echoes(*channel, 7, random_bytes(100, 2)));
  }
}

TEST_F(ShmTransport, ForgettingARequestWhoseReplyIsThereFreesItsSlot) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  for (std::uint64_t id = 1; id <= 1000; ++id) {
    send_ping(*channel, id, {});
    if (id % 2) {
      send_ping(*channel, 10000 + id, {});
      EXPECT_TRUE(echoes(*channel, 10000 + id, {}));  // so that the first one's has arrived
    }
    channel->forget(id);
  }
  channel->forget(12345);  // an unknown id is harmless
}

TEST_F(ShmTransport, ATimeoutLeavesTheRequestUnderWay) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  server.set_mode(Mode::kHold);
  send_ping(*channel, 1, random_bytes(10, 1));
  EXPECT_EQ(channel->receive(1, std::chrono::steady_clock::now() + 30ms), nullptr);
  server.await_held(1);
  server.call([](EchoServer& s) {
    s.handler.answer_held(0);
    s.handler.held.clear();
  });
  EXPECT_TRUE(echoes(*channel, 1, random_bytes(10, 1)));
}

TEST_F(ShmTransport, ADroppedRequestIsReportedAtOnce) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  server.set_mode(Mode::kDrop);
  for (std::uint64_t id = 1; id <= 40; ++id) {
    send_ping(*channel, id, {});
    EXPECT_NE(error_of([&] { channel->receive(id, soon()); }).find("the daemon dropped request " + std::to_string(id)),
              std::string::npos);
  }
  server.set_mode(Mode::kEcho);
  send_ping(*channel, 50, {});
  EXPECT_TRUE(echoes(*channel, 50, {}));
}

TEST_F(ShmTransport, AReplyThatDoesNotFitGetsALargerSegment) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  send_ping(*channel, 1, random_bytes(100, 1));
  const auto kept = channel->receive(1, soon());  // leases a slot of the first segment
  ASSERT_TRUE(kept);
  std::uint64_t id = 1;
  for (const std::uint64_t wanted : {std::uint64_t{2} << 20, std::uint64_t{20} << 20, std::uint64_t{48} << 20}) {
    for (const bool hinted : {false, true}) {
      ++id;
      send_ping(*channel, id, random_bytes(100, id), wanted, hinted ? wanted + 64 : 0);
      const auto frame = channel->receive(id, soon());
      ASSERT_TRUE(frame);
      ASSERT_EQ(frame->payload().size(), wanted);
      EXPECT_EQ(frame->payload().front(), static_cast<std::byte>(id));
      EXPECT_EQ(frame->payload().back(), static_cast<std::byte>(id));
    }
  }
  EXPECT_EQ(server.call([](EchoServer& s) { return s.handler.frames; }), 1u + 6 + 3)
      << "three of them should have been sent again";
  const auto expected = random_bytes(100, 1);
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), kept->payload().begin(), kept->payload().end()));
  while (mapped_segments() > 4) std::this_thread::yield();  // the daemon releases outgrown ones on request
  EXPECT_EQ(mapped_segments(), 4u) << "the first, still leased, and the newest, in client and server";
}

TEST_F(ShmTransport, WhatTheDaemonDoesNotAllowIsReported) {
  ShmLimits limits;
  limits.max_segment_bytes = 16 << 20;
  limits.pool_bytes = 40 << 20;
  limits.slots = 4;
  EchoThread server(path_, limits);
  auto channel = open_shm_channel(path_, soon());
  send_ping(*channel, 1, {}, 100 << 20);
  auto frame = channel->receive(1, soon());
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->header().type, static_cast<std::uint16_t>(wire::FrameType::kError));
  wire::ErrorHeader error;
  std::memcpy(&error, frame->payload().data(), sizeof error);
  EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge));
  EXPECT_EQ(error.needed_bytes, (100u << 20) + 64);
  try {
    channel->begin(20 << 20, 0);
    FAIL() << "such a request should be refused";
  } catch (const RequestError& rejected) {
    EXPECT_EQ(rejected.code, static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge));
    EXPECT_NE(std::string(rejected.what()).find("a request of 20971520 bytes does not fit"), std::string::npos)
        << rejected.what();
    EXPECT_NE(std::string(rejected.what()).find("this daemon's limit is 16777216"), std::string::npos)
        << rejected.what();
  }
  EXPECT_NE(error_of([&] { channel->begin(std::uint64_t{1} << 40, 0); }).find("the limit is 268435456"),
            std::string::npos);
  send_ping(*channel, 2, random_bytes(100, 2), 0, std::uint64_t{1} << 60);  // an absurd hint is harmless
  EXPECT_TRUE(echoes(*channel, 2, random_bytes(100, 2)));

  // The pool is shared by all clients.
  std::vector<std::unique_ptr<Channel>> others;
  std::string rejection;
  for (int i = 0; i < 20 && rejection.empty(); ++i)
    rejection = error_of([&] { others.push_back(open_shm_channel(path_, soon())); });
  EXPECT_NE(rejection.find("rejected: no room for a segment of"), std::string::npos) << rejection;
  EXPECT_NE(rejection.find("are allocated to clients"), std::string::npos) << rejection;
  others.clear();
  send_ping(*channel, 3, {});
  EXPECT_TRUE(echoes(*channel, 3, {}));
  while (server.counter("shm.clients") > 1) std::this_thread::yield();
  EXPECT_EQ(error_of([&] { open_shm_channel(path_, soon()); }), "");
}

TEST_F(ShmTransport, TooManyClientsAreRejected) {
  ShmLimits limits;
  limits.max_clients = 3;
  EchoThread server(path_, limits);
  std::vector<std::unique_ptr<Channel>> channels;
  for (int i = 0; i < 3; ++i) channels.push_back(open_shm_channel(path_, soon()));
  for (int i = 0; i < 20; ++i)
    EXPECT_NE(error_of([&] { open_shm_channel(path_, soon()); }).find("already has 3 shared-memory clients"),
              std::string::npos);
  channels.pop_back();
  while (server.counter("shm.clients") > 2) std::this_thread::yield();
  channels.push_back(open_shm_channel(path_, soon()));
  send_ping(*channels.back(), 1, {});
  EXPECT_TRUE(echoes(*channels.back(), 1, {}));
}

TEST_F(ShmTransport, ClientsAreDistinguished) {
  EchoThread server(path_);
  server.set_mode(Mode::kHold);
  auto a = open_shm_channel(path_, soon()), b = open_shm_channel(path_, soon());
  send_ping(*a, 1, random_bytes(10, 1));
  send_ping(*a, 2, random_bytes(10, 2));
  send_ping(*b, 1, random_bytes(10, 3));
  server.await_held(3);
  server.call([](EchoServer& s) {
    std::map<std::uint64_t, int> clients;
    for (const auto& held : s.handler.held) {
      EXPECT_NE(held.sink->client(), 0u);
      EXPECT_TRUE(held.sink->alive());
      ++clients[held.sink->client()];
    }
    EXPECT_EQ(clients.size(), 2u);
    for (std::size_t i = 0; i < 3; ++i) s.handler.answer_held(i);
    s.handler.held.clear();
  });
  EXPECT_TRUE(echoes(*b, 1, random_bytes(10, 3)));
  EXPECT_TRUE(echoes(*a, 1, random_bytes(10, 1)));
  EXPECT_TRUE(echoes(*a, 2, random_bytes(10, 2)));
}

TEST_F(ShmTransport, TheSocketIsOursAloneAndGoesWithTheDaemon) {
  const mode_t old = ::umask(0);
  {
    EchoServer server(path_);
    struct stat made{};
    ASSERT_EQ(::stat(path_.c_str(), &made), 0);
    EXPECT_EQ(made.st_mode & 07777, 0600u);
    EXPECT_EQ(server.transport->url(), "shm://" + path_);
  }
  ::umask(old);
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(ShmTransport, AStaleSocketIsReplacedAndALiveOneIsNot) {
  {  // the remains of a killed daemon
    sockaddr_un address;
    ASSERT_TRUE(shm::socket_address(path_.c_str(), address));
    shm::UniqueFd dead(::socket(AF_UNIX, SOCK_SEQPACKET, 0));
    ASSERT_EQ(::bind(dead.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  EXPECT_NE(error_of([&] { open_shm_channel(path_, soon()); }).find("no process listens there: the daemon is gone"),
            std::string::npos);
  EchoThread server(path_);
  EXPECT_NE(error_of([&] { EchoServer second(path_); }).find("shm://" + path_ + ": another process listens there"),
            std::string::npos);
  auto channel = open_shm_channel(path_, soon());  // the rejected one has not removed the socket
  send_ping(*channel, 1, {});
  EXPECT_TRUE(echoes(*channel, 1, {}));
}

TEST_F(ShmTransport, PathsThatCannotBeAreRejected) {
  EXPECT_NE(error_of([&] { EchoServer s(folder_ / "none/c.sock"); }).find("there is no folder"), std::string::npos);
  EXPECT_NE(error_of([&] { EchoServer s(folder_ / std::string(120, 'x')); }).find("a socket's path has 1 to 107 bytes"),
            std::string::npos);
  EXPECT_NE(error_of([&] { EchoServer s(""); }).find("a socket's path has 1 to 107 bytes"), std::string::npos);
  std::ofstream(path_) << "precious";
  EXPECT_NE(error_of([&] { EchoServer s(path_); }).find("the path is taken by something that is not a socket"),
            std::string::npos);
  EXPECT_TRUE(std::filesystem::is_regular_file(path_));
  EXPECT_NE(
      error_of([&] { open_shm_channel(folder_ / "other", soon()); }).find("there is no socket: is clearanced running?"),
      std::string::npos);
  const std::string stream = folder_ / "stream";
  sockaddr_un address;
  ASSERT_TRUE(shm::socket_address(stream.c_str(), address));
  shm::UniqueFd other(::socket(AF_UNIX, SOCK_STREAM, 0));
  ASSERT_EQ(::bind(other.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(::listen(other.get(), 1), 0);
  EXPECT_NE(error_of([&] { EchoServer s(stream); }).find("the path is taken by a socket of another kind"),
            std::string::npos);
  EXPECT_NE(error_of([&] { open_shm_channel(stream, soon()); }).find("the socket there is not clearanced's"),
            std::string::npos);
}

TEST_F(ShmTransport, OptionsThatDoNotExistAreRejected) {
  EchoThread server(path_);
  for (const char* options :
       {"?spin=3", "?spin_us=", "?spin_us=-1", "?spin_us=1x", "?spin_us=2000000", "?spin_us=1&turbo=1"})
    EXPECT_NE(error_of([&] { open_shm_channel(path_ + options, soon()); }).find("is not an option; there is spin_us=0"),
              std::string::npos)
        << options;
  EXPECT_EQ(error_of([&] { open_shm_channel(path_ + "?", soon()); }), "");
  EXPECT_EQ(error_of([&] { open_shm_channel(path_ + "?spin_us=5", soon()); }), "");
}

TEST_F(ShmTransport, MisuseOfAChannelIsReported) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  EXPECT_NE(error_of([&] { channel->send(); }).find("send() without begin()"), std::string::npos);
  EXPECT_NE(error_of([&] { channel->begin(63, 0); }).find("a frame begins with its header"), std::string::npos);
  EXPECT_NE(error_of([&] { channel->receive(1, soon()); }).find("no request 1 is under way"), std::string::npos);
  for (int i = 0; i < 100; ++i) channel->begin(100, 0);  // unused space is released
  wire::FrameHeader header;
  header.payload_bytes = ~std::uint64_t{0};
  std::memcpy(channel->begin(64, 0), &header, sizeof header);
  EXPECT_NE(error_of([&] { channel->send(); }).find("the frame is larger than the memory"), std::string::npos);
  send_ping(*channel, 1, {});
  EXPECT_TRUE(echoes(*channel, 1, {}));
}

TEST_F(ShmTransport, FramesMayBeLetGoOfInAnotherThread) {
  EchoThread server(path_);
  auto channel = open_shm_channel(path_, soon());
  for (std::uint64_t id = 1; id <= 500; ++id) {
    send_ping(*channel, id, random_bytes(64, id));
    auto frame = channel->receive(id, soon());
    ASSERT_TRUE(frame);
    std::thread([owned = std::move(frame)]() mutable { owned.reset(); }).join();
  }
}

TEST_F(ShmTransport, NothingIsLeftOfClientsThatWent) {
  EchoThread server(path_);
  {
    auto channel = open_shm_channel(path_, soon());
  }
  while (server.counter("shm.clients") > 0) std::this_thread::yield();
  const std::size_t descriptors = open_descriptors();
  EXPECT_EQ(mapped_segments(), 0u);
  for (int i = 0; i < 100; ++i) {
    auto channel = open_shm_channel(path_, soon());
    send_ping(*channel, 1, {}, i % 10 == 0 ? 2 << 20 : 0);
    EXPECT_TRUE(channel->receive(1, soon()));
  }
  while (server.counter("shm.clients") > 0) std::this_thread::yield();
  EXPECT_EQ(open_descriptors(), descriptors);
  EXPECT_EQ(mapped_segments(), 0u);
  server.call([](EchoServer& s) { s.transport->tick(s.handler); });
  EXPECT_EQ(server.counter("shm.segment_bytes"), 0u);
}

}  // namespace
}  // namespace clearance
