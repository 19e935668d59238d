// Clients that break the rules of the shared-memory transport: the daemon survives, and others get correct answers.
#include <fcntl.h>

#include "tests/server/shm/raw_shm_client.h"
#include "tests/server/shm/shm_echo.h"

namespace clearance {
namespace {

using shm::Message;
using shm::MessageKind;

class ShmHostile : public ::testing::Test {
 protected:
  void expect_good_service() {
    const auto payload = random_bytes(5000, ++id_);
    send_ping(*good_, id_, payload);
    EXPECT_TRUE(echoes(*good_, id_, payload));
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "c.sock";
  EchoThread server_{path_};
  std::unique_ptr<Channel> good_ = open_shm_channel(path_, soon());
  std::uint64_t id_ = 0;
};

TEST_F(ShmHostile, EachBrokenRuleOfTheRingEndsTheConnectionWithAReason) {
  struct Case {
    const char* why;
    std::uint64_t ticket, frame_bytes;
    std::uint32_t head;
  };
  const std::uint64_t capacity = ShmLimits{}.request_capacity;
  const Case cases[] = {
      {"request_head ran ahead of the slots", shm::pack_ticket(0, 1), 64, 17},
      {"request_head ran ahead of the slots", shm::pack_ticket(0, 1), 64, 0xFFFFFFFF},
      {"a slot that does not exist", shm::pack_ticket(16, 1), 64, 1},
      {"a slot that does not exist", shm::pack_ticket(0xFFFFFFFF, 1), 64, 1},
      {"a generation out of order", shm::pack_ticket(0, 0), 64, 1},
      {"a generation out of order", shm::pack_ticket(0, 2), 64, 1},
      {"a frame size that cannot be", shm::pack_ticket(0, 1), 0, 1},
      {"a frame size that cannot be", shm::pack_ticket(0, 1), 63, 1},
      {"a frame size that cannot be", shm::pack_ticket(0, 1), capacity + 1, 1},
      {"a frame size that cannot be", shm::pack_ticket(0, 1), ~std::uint64_t{0}, 1},
  };
  std::uint64_t violations = 0;
  for (const Case& c : cases) {
    RawClient client(path_);
    client.post(c.ticket, c.frame_bytes, c.head);
    const Message answer = client.receive();
    EXPECT_EQ(answer.kind, static_cast<std::uint32_t>(MessageKind::kRejected));
    EXPECT_EQ(std::string(answer.text), std::string("disconnected: ") + c.why);
    EXPECT_EQ(client.receive().kind, 0u) << "the daemon should have hung up";
    EXPECT_EQ(server_.counter("shm.violations"), ++violations);
    expect_good_service();
  }
  {
    server_.set_mode(EchoRequestHandler::Mode::kHold);
    RawClient client(path_);
    client.post(shm::pack_ticket(3, 1), 64, 1);
    server_.await_held(1);
    client.post(shm::pack_ticket(3, 2), 64, 2);
    EXPECT_STREQ(client.receive().text, "disconnected: a slot that is still being answered");
    server_.call([](EchoServer& s) {
      EXPECT_FALSE(s.handler.held[0].sink->alive());
      s.handler.answer_held(0);  // into memory that only the two of them share
      s.handler.held.clear();
      s.handler.mode = EchoRequestHandler::Mode::kEcho;
    });
    expect_good_service();
  }
}

TEST_F(ShmHostile, BadMessagesOnTheSocketEndTheConnection) {
  const auto expect_end = [&](RawClient& client, const char* why) {
    const Message answer = client.receive();
    EXPECT_EQ(answer.kind, static_cast<std::uint32_t>(MessageKind::kRejected));
    EXPECT_NE(std::string(answer.text).find(why), std::string::npos) << answer.text;
    EXPECT_EQ(client.receive().kind, 0u);
    expect_good_service();
  };
  {
    RawClient client(path_, false);
    Message message = RawClient::make(MessageKind::kHello);
    message.magic = 1;
    client.send(message);
    expect_end(client, "not a message of this protocol");
  }
  for (const std::size_t size : {std::size_t{1}, std::size_t{15}}) {
    RawClient client(path_, false);
    client.send(RawClient::make(MessageKind::kHello), size);
    expect_end(client, "not a message of this protocol");
  }
  {
    RawClient client(path_, false);
    client.send(RawClient::make(MessageKind::kHello), 100);
    expect_end(client, "a message of a wrong size");
  }
  for (const auto kind : {MessageKind{0}, MessageKind{77}, MessageKind::kSegment, MessageKind::kRejected}) {
    RawClient client(path_);
    client.send(RawClient::make(kind));
    expect_end(client, "a message of unknown kind");
  }
  {
    RawClient client(path_);
    client.send(RawClient::make(MessageKind::kHello));
    expect_end(client, "a second hello");
  }
  for (const auto kind : {MessageKind::kGrow, MessageKind::kRetire}) {
    RawClient client(path_, false);
    client.send(RawClient::make(kind));
    expect_end(client, kind == MessageKind::kGrow ? "no hello" : "retires a segment that it does not have");
  }
  for (const std::uint32_t segment : {0u, 1u, 0xFFFFFFFFu}) {
    RawClient client(path_);
    Message message = RawClient::make(MessageKind::kRetire);
    message.segment_id = segment;
    client.send(message);
    expect_end(client, "retires a segment that it does not have");
  }
  {
    RawClient client(path_, false);
  }  // hangs up without a message
  expect_good_service();
}

TEST_F(ShmHostile, AbsurdSizesAreRejectedAndTheConnectionGoesOn) {
  RawClient client(path_);
  for (const std::uint64_t size :
       {std::uint64_t{1} << 40, std::uint64_t{1} << 63, ~std::uint64_t{0}, ~std::uint64_t{0} - 4095}) {
    for (const bool request : {false, true}) {
      Message message = RawClient::make(MessageKind::kGrow);
      (request ? message.request_capacity : message.reply_capacity) = size;
      client.send(message);
      const Message answer = client.receive();
      EXPECT_EQ(answer.kind, static_cast<std::uint32_t>(MessageKind::kRejected));
      EXPECT_NE(std::string(answer.text).find("the limit is"), std::string::npos) << answer.text;
    }
  }
  int given = 1;  // the first segment
  Message answer;
  for (int i = 0; i < 20; ++i) {
    client.send(RawClient::make(MessageKind::kGrow));
    answer = client.receive();
    if (answer.kind == static_cast<std::uint32_t>(MessageKind::kRejected)) break;
    ++given;
  }
  EXPECT_EQ(given, 4);
  EXPECT_NE(std::string(answer.text).find("all 4 segments of this client"), std::string::npos) << answer.text;
  expect_good_service();
}

TEST_F(ShmHostile, ClientsThatHoardSegmentsLeaveMemoryForNewOnes) {
  ShmLimits limits;
  limits.pool_bytes = std::uint64_t{400} << 20;  // a usual segment takes 20 MiB
  const std::string path = folder_ / "hoard.sock";
  EchoThread server(path, limits);
  std::vector<std::unique_ptr<RawClient>> hoarders;
  std::string said;
  for (int i = 0; i < 8 && said.find("are allocated to clients") == std::string::npos; ++i) {
    hoarders.push_back(std::make_unique<RawClient>(path));
    for (Message answer = RawClient::make(MessageKind::kSegment);
         answer.kind == static_cast<std::uint32_t>(MessageKind::kSegment);) {
      hoarders.back()->send(RawClient::make(MessageKind::kGrow));
      answer = hoarders.back()->receive();
      said = answer.text;
    }
  }
  EXPECT_NE(said.find("of 314572800 bytes of shared memory are allocated to clients"), std::string::npos) << said;
  Message large = RawClient::make(MessageKind::kHello);
  large.reply_capacity = 2 << 20;
  RawClient greedy(path, false);
  greedy.send(large);
  EXPECT_NE(std::string(greedy.receive().text).find("are allocated to clients"), std::string::npos)
      << "nor at the door";
  std::vector<std::unique_ptr<Channel>> newcomers;
  for (std::uint64_t i = 1; i <= 4; ++i) {
    newcomers.push_back(open_shm_channel(path, soon()));
    send_ping(*newcomers.back(), i, random_bytes(100, i));
    EXPECT_TRUE(echoes(*newcomers.back(), i, random_bytes(100, i)));
  }
}

TEST_F(ShmHostile, AnotherVersionIsRejectedWithBothVersions) {
  for (const bool layout : {false, true}) {
    RawClient client(path_, false);
    Message message = RawClient::make(MessageKind::kHello);
    (layout ? message.layout_version : message.wire_version) = 99;
    client.send(message, layout ? 48 : sizeof message);  // another version's message may have another size
    const Message answer = client.receive();
    EXPECT_EQ(answer.kind, static_cast<std::uint32_t>(MessageKind::kRejected));
    EXPECT_EQ(std::string(answer.text), "the client speaks shared-memory layout " + std::string(layout ? "99" : "1") +
                                            " and wire version " + (layout ? "1" : "99") +
                                            "; this daemon speaks 1 and 1");
    EXPECT_EQ(client.receive().kind, 0u);
  }
  expect_good_service();
}

// The client's side of the same: a daemon of another version, and servers that are no daemon at all.
TEST_F(ShmHostile, AClientRejectsAnUnknownDaemon) {
  const std::string path = folder_ / "strange.sock";
  sockaddr_un address;
  ASSERT_TRUE(shm::socket_address(path.c_str(), address));
  shm::UniqueFd listener(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  ASSERT_EQ(::bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(::listen(listener.get(), 8), 0);
  const auto error_with = [&](std::function<void(int)> serve) -> std::string {
    std::thread thread([&] {
      const shm::UniqueFd socket(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
      serve(socket.get());
      char byte;
      while (::recv(socket.get(), &byte, 1, 0) > 0) {
      }
    });
    std::string text;
    try {
      open_shm_channel(path, std::chrono::steady_clock::now() + 5s);
    } catch (const ConnectionError& error) {
      text = error.what();
    }
    thread.join();
    return text;
  };
  const auto answer = [](Message message) {
    return [message](int socket) { ::send(socket, &message, sizeof message, MSG_NOSIGNAL); };
  };
  Message segment = RawClient::make(MessageKind::kSegment);
  EXPECT_NE(error_with(answer(segment)).find("the daemon's greeting lacks the segment"), std::string::npos);
  Message newer = segment;
  newer.layout_version = 2;
  EXPECT_NE(error_with(answer(newer)).find("speaks another version of the shared-memory layout"), std::string::npos);
  Message stranger = segment;
  stranger.magic = 7;
  EXPECT_NE(error_with(answer(stranger)).find("what listens there is not clearanced"), std::string::npos);
  EXPECT_NE(error_with(answer(RawClient::make(MessageKind{9}))).find("a message of unknown kind"), std::string::npos);
  EXPECT_NE(error_with([](int socket) { ::shutdown(socket, SHUT_RDWR); }).find("the daemon closed the connection"),
            std::string::npos);

  const auto with_file = [&](off_t bytes, std::uint32_t version) {
    return [=](int socket) {
      const shm::UniqueFd file(::memfd_create("not-a-segment", MFD_CLOEXEC));
      ASSERT_EQ(::ftruncate(file.get(), bytes), 0);
      if (bytes > 64) {
        ASSERT_EQ(::pwrite(file.get(), &version, sizeof version, offsetof(shm::SegmentHeader, version)), 4);
      }
      const int fds[2] = {file.get(), file.get()};
      ASSERT_TRUE(shm::send_message(socket, RawClient::make(MessageKind::kSegment), fds));
    };
  };
  EXPECT_NE(error_with(with_file(0, 0)).find("something that is not a segment"), std::string::npos);
  EXPECT_NE(error_with(with_file(8192, 0)).find("a layout unknown to this client"), std::string::npos);
  EXPECT_NE(error_with(with_file(8192, shm::kLayoutVersion)).find("a layout unknown to this client"),
            std::string::npos);
  const std::size_t descriptors = open_descriptors();
  for (int i = 0; i < 20; ++i) error_with(with_file(8192, 0));
  EXPECT_EQ(open_descriptors(), descriptors);
}

TEST_F(ShmHostile, TheSegmentCannotBeResizedAndDescriptorsSentToTheDaemonAreClosed) {
  const std::size_t mine = open_descriptors();
  {
    RawClient client(path_);
    EXPECT_NE(::ftruncate(client.memfd.get(), 0), 0);
    EXPECT_NE(::ftruncate(client.memfd.get(), 1 << 30), 0);
    EXPECT_NE(::fcntl(client.memfd.get(), F_ADD_SEALS, F_SEAL_WRITE), 0);
    // A hole under the daemon's mapping reads as zeros, which is harmless as well.
    ASSERT_EQ(::fallocate(client.memfd.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, 0,
                          static_cast<off_t>(client.bytes)),
              0);
    client.post(shm::pack_ticket(0, 1), 64, 1);
    const int fds[2] = {client.socket.get(), client.memfd.get()};
    Message message = RawClient::make(MessageKind::kGrow);
    message.reply_capacity = ~std::uint64_t{0};
    for (int i = 0; i < 10; ++i) {
      if (!shm::send_message(client.socket.get(), message, fds)) {  // the kernel keeps them out
        ASSERT_EQ(errno, EPERM);
        ASSERT_TRUE(shm::send_message(client.socket.get(), message));
      }
      EXPECT_EQ(client.receive().kind, static_cast<std::uint32_t>(MessageKind::kRejected));
    }
    expect_good_service();
  }
  while (server_.counter("shm.clients") > 1) std::this_thread::yield();
  EXPECT_EQ(open_descriptors(), mine);
}

TEST_F(ShmHostile, ASilentConnectionIsClosed) {
  ShmLimits limits;
  limits.hello_timeout = 1ms;
  const std::string path = folder_ / "impatient.sock";
  EchoThread server(path, limits);
  RawClient client(path, false);
  while (server.counter("shm.connections") < 1) std::this_thread::yield();
  while (server.counter("shm.clients") > 0) server.call([](EchoServer& s) { s.transport->tick(s.handler); });
  EXPECT_EQ(client.receive().kind, 0u);
}

// Random values over every byte of a mapped segment while the daemon reads it and another client is served.
TEST_F(ShmHostile, AScribblingClientHurtsOnlyItself) {
  std::atomic<bool> done{false};
  std::atomic<std::uint64_t> connections{0}, whole_passes{0};
  std::thread hostile([&] {
    std::mt19937_64 random(11);
    while (!done) {
      RawClient client(path_);
      ++connections;
      // Some valid requests first, so that there is work in progress in the segment.
      const std::uint32_t polite = random() % 5;
      for (std::uint32_t i = 0; i < polite; ++i) {
        wire::FrameHeader header;
        header.request_id = i;
        header.scene_revision = random() % 100000;
        std::memcpy(client.base + shm::kPage + i * client.header->request_capacity, &header, sizeof header);
        client.post(shm::pack_ticket(i, 1), 64 + random() % 1000, i + 1);
      }
      const auto words = reinterpret_cast<std::atomic<std::uint64_t>*>(client.base);
      const std::size_t count = client.bytes / 8, control = sizeof(shm::SegmentHeader) / 8;
      // The control words many times over, and occasionally every byte.
      for (int i = 0; i < 3000; ++i) {
        // Mostly small values, which are closer to valid ones.
        const std::uint64_t value = random() >> (random() % 64);
        words[random() % control].store(value, std::memory_order_relaxed);
        if (i % 64 == 0) client.wake_daemon();
      }
      if (connections % 8 == 1) {
        for (std::size_t i = 0; i < count; ++i) words[i].store(random(), std::memory_order_relaxed);
        client.wake_daemon();
        ++whole_passes;
      }
    }
  });
  for (int i = 0; i < 3000 || whole_passes < 3 || server_.counter("shm.violations") < 20; ++i) expect_good_service();
  done = true;
  hostile.join();
  EXPECT_GE(connections, 20u);
  EXPECT_EQ(server_.idle_timeouts(), 0);
  while (server_.counter("shm.clients") > 1) std::this_thread::yield();
  expect_good_service();
}

}  // namespace
}  // namespace clearance
