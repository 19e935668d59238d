// The link between the daemon and a gateway process: messages of any size arrive in order and interleaved, and a
// violation of the rules breaks it.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <cstring>
#include <random>

#include "server/gateway/link.h"

namespace clearance::gateway {
namespace {

constexpr Link::Limits kLimits{.message_bytes = 4 << 20, .coming_bytes = 6 << 20, .waiting_bytes = 8 << 20};
constexpr std::size_t kChunk = 64 << 10;

class LinkTest : public testing::Test {
 protected:
  LinkTest() {
    int ends[2];
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends), 0);
    core_.emplace(shm::UniqueFd(ends[0]), kLimits);
    raw_ = ends[1];
  }
  /// A valid end in place of the raw one.
  Link& other() {
    if (!other_) other_.emplace(shm::UniqueFd(raw_), kLimits);
    return *other_;
  }
  ~LinkTest() override {
    if (!other_ && raw_ >= 0) ::close(raw_);
  }

  static Message message(const std::string& name, std::size_t bytes, std::uint64_t number = 1) {
    std::string body(bytes, '\0');
    for (std::size_t i = 0; i < bytes; ++i) body[i] = static_cast<char>(i * 31 + number);
    return {Kind::kFrame, number, name, "extra", Bytes(std::string_view(body))};
  }
  /// Runs both ends until this many messages have arrived.
  std::vector<Message> transfer(Link& from, Link& to, std::size_t count) {
    std::vector<Message> got;
    while (got.size() < count) {
      from.turn();
      to.turn();
      while (auto one = to.receive()) got.push_back(std::move(*one));
    }
    return got;
  }
  /// Sends an invalid datagram, and returns the reason for which the daemon breaks the link.
  std::string broken_by(const Head& head, std::size_t more, std::string (LinkTest::*before)() = nullptr) {
    if (before) (this->*before)();
    std::string datagram(sizeof head + more, 'x');
    std::memcpy(datagram.data(), &head, sizeof head);
    EXPECT_EQ(::send(raw_, datagram.data(), datagram.size(), 0), static_cast<ssize_t>(datagram.size()));
    return why();
  }
  std::string why() {
    try {
      for (core_->turn(); core_->receive();) {
      }
    } catch (const Broken& broken) {
      return broken.what();
    }
    return "nothing";
  }
  void send_raw(const Head& head, std::size_t more) {
    std::string datagram(sizeof head + more, 'x');
    std::memcpy(datagram.data(), &head, sizeof head);
    ASSERT_EQ(::send(raw_, datagram.data(), datagram.size(), 0), static_cast<ssize_t>(datagram.size()));
  }
  static Head head(std::uint16_t name, std::uint16_t extra, std::uint64_t body, std::uint64_t offset = 0) {
    return {static_cast<std::uint32_t>(Kind::kFrame), name, extra, 7, body, offset};
  }

  std::optional<Link> core_, other_;
  int raw_ = -1;
};

TEST_F(LinkTest, MessagesOfAnySizeComeWholeBothWays) {
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{1}, kChunk, kChunk + 1, std::size_t{3'000'000}}) {
    other().send(message("a", bytes, bytes));
    core_->send(message("b", bytes, bytes));
    const auto in = transfer(other(), *core_, 1), out = transfer(*core_, other(), 1);
    for (const Message* got : {&in.at(0), &out.at(0)}) {
      const Message sent = message(got->name, bytes, bytes);
      EXPECT_EQ(got->number, bytes);
      EXPECT_EQ(got->extra, "extra");
      ASSERT_EQ(got->body.bytes, bytes);
      EXPECT_EQ(got->body.text(), sent.body.text());
      EXPECT_EQ(reinterpret_cast<std::uintptr_t>(got->body.begin.get()) % 64, 0u);
    }
  }
}

TEST_F(LinkTest, ThoseOfOneNameKeepTheirOrderAndALongOneHoldsUpNoOther) {
  other().send(message("large", 3 << 20, 1));
  other().send(message("large", 10, 2));
  other().send(message("small", 10, 3));
  const auto got = transfer(other(), *core_, 3);
  EXPECT_EQ(got[0].number, 3u);
  EXPECT_EQ(got[1].number, 1u);
  EXPECT_EQ(got[2].number, 2u);
}

TEST_F(LinkTest, ItsDescriptorIsReadableWhereThereIsSomethingToDo) {
  const auto readable = [](const Link& link) {
    pollfd fd{link.descriptor(), POLLIN, 0};
    return ::poll(&fd, 1, 0) == 1;
  };
  EXPECT_FALSE(readable(*core_));
  core_->send(message("a", 3 << 20));
  while (readable(*core_)) core_->turn();  // as long as there is space
  EXPECT_GT(core_->waiting_bytes(), 0u);
  while (readable(other())) {
    other().turn();
    while (other().receive()) {
    }
  }
  EXPECT_TRUE(readable(*core_)) << "there is room again";
}

TEST_F(LinkTest, ATurnMovesABoundedNumberOfBytes) {
  other().send(message("a", 4 << 20));
  int turns = 0;
  for (bool done = false; !done; ++turns) {
    other().turn();
    core_->turn();
    done = core_->receive().has_value();
    EXPECT_LE(core_->turn_bytes(), 600u << 10);
  }
  EXPECT_GE(turns, 8);
}

TEST_F(LinkTest, WhoDoesNotReadBreaksIt) {
  EXPECT_THROW(for (int i = 0; i < 1000; ++i) core_->send(message("a", 100'000)), Broken);
}

TEST_F(LinkTest, InvalidMessagesBreakIt) {
  ASSERT_EQ(::send(raw_, "short", 5, 0), 5);
  EXPECT_EQ(why(), "it sends less than a header");
  EXPECT_EQ(broken_by(head(256, 0, 0), 256), "it sends a name or extra data of a wrong length");
  EXPECT_EQ(broken_by(head(0, 105, 0), 105), "it sends a name or extra data of a wrong length");
  EXPECT_EQ(broken_by(head(200, 100, 0), 299), "it sends a name or extra data of a wrong length");
  EXPECT_EQ(broken_by(head(1, 0, kLimits.message_bytes + 1), 2), "it sends too large a body");
  EXPECT_EQ(broken_by(head(1, 0, ~std::uint64_t{0}, ~std::uint64_t{0}), 2), "it sends too large a body");
  EXPECT_EQ(broken_by(head(1, 0, 10), 1 + 11), "it sends more of a body than announced");
  EXPECT_EQ(broken_by(head(1, 0, 10, 11), 1), "it sends more of a body than announced");
  EXPECT_EQ(broken_by(head(1, 0, 10, 5), 1 + 5), "it sends a body without its beginning");
  EXPECT_EQ(broken_by(head(1, 0, 10), 1), "it sends an empty part of a body");
  EXPECT_EQ(broken_by(head(0, 0, 2 * kChunk), kChunk + 1000), "it sends too large a datagram");
}

TEST_F(LinkTest, BodiesOfOneNameMixedUpBreakIt) {
  send_raw(head(1, 0, 100), 1 + 50);
  EXPECT_EQ(why(), "nothing");
  EXPECT_EQ(broken_by(head(1, 0, 100, 60), 1 + 10), "it mixes bodies of one name");
  EXPECT_EQ(broken_by(head(1, 0, 3), 1 + 3), "it mixes bodies of one name");
  EXPECT_EQ(broken_by(head(1, 0, 99, 50), 1 + 10), "it mixes bodies of one name");
}

TEST_F(LinkTest, BodiesThatAreBegunAndNotEndedTakeBoundedMemory) {
  const auto begin = [this](char name) {
    Head begun = head(1, 0, kLimits.message_bytes);
    std::string datagram(sizeof begun, '\0');
    std::memcpy(datagram.data(), &begun, sizeof begun);
    datagram += name;
    datagram += 'x';
    ASSERT_EQ(::send(raw_, datagram.data(), datagram.size(), 0), static_cast<ssize_t>(datagram.size()));
  };
  begin('a');
  EXPECT_EQ(why(), "nothing");
  begin('b');
  EXPECT_EQ(why(), "it sends too many bodies at once");
}

TEST(LinkOfAnyBytes, GivesMessagesWithinItsLimitsOrBreaks) {
  std::mt19937_64 random(17);
  const auto pick = [&random](std::initializer_list<std::uint64_t> of) { return of.begin()[random() % of.size()]; };
  int whole = 0, in_parts = 0, broken = 0;
  for (int run = 0; run < 3000; ++run) {
    int ends[2];
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends), 0);
    const shm::UniqueFd raw(ends[1]);
    Link link(shm::UniqueFd(ends[0]), {.message_bytes = 5000, .coming_bytes = 8000, .waiting_bytes = 1 << 20});
    std::uint64_t offset = 0;
    try {
      for (int i = 0; i < 8; ++i) {
        // The intended content, a whole body or the next part of one; occasionally one field is wrong.
        const bool in_part = offset > 0 || random() % 2;
        const std::uint64_t part = 100, body = in_part ? 300 : part;
        Head head{static_cast<std::uint32_t>(Kind::kFrame), 1, 0, 7, body, in_part ? offset : 0};
        offset = in_part ? (offset + part) % body : 0;
        const std::uint64_t wrong = pick({0, 1, 99, 255, 256, 4999, 5001, 60'000, ~0ull});
        switch (random() % 24) {
          case 0:
            head.name_bytes = static_cast<std::uint16_t>(wrong);
            break;
          case 1:
            head.extra_bytes = static_cast<std::uint16_t>(wrong);
            break;
          case 2:
            head.number = wrong;
            break;
          case 3:
            head.body_bytes = wrong;
            break;
          case 4:
            head.offset = wrong;
            break;
          default:
            break;
        }
        std::string datagram(sizeof head + 1 + (random() % 30 ? part : wrong % 70'000), 'x');
        std::memcpy(datagram.data(), &head, sizeof head);
        ASSERT_GT(::send(raw.get(), datagram.data(), random() % 40 ? datagram.size() : random() % 40 + 1, 0), 0);
        link.turn();
        while (const auto message = link.receive()) {
          ASSERT_LE(message->name.size(), kMaxNameBytes);
          ASSERT_LE(message->extra.size(), kMaxExtraBytes);
          ASSERT_LE(message->body.bytes, 5000u);
          EXPECT_EQ(message->body.text().find_first_not_of('x'), std::string::npos) << "every byte of it was sent";
          ++(message->body.bytes > part ? in_parts : whole);
        }
      }
    } catch (const Broken&) {
      ++broken;
    }
  }
  EXPECT_GT(whole, 1000);
  EXPECT_GT(in_parts, 300);
  EXPECT_GT(broken, 1000);
  EXPECT_LT(broken, 2900);
}

TEST_F(LinkTest, LastMessagesOfAPeerThatClosesWithUnreadInputAreReceived) {
  other().send(message("a", 10));
  other().turn();
  core_->send(message("b", 10));
  core_->turn();
  other_.reset();  // closes its end with unread input
  raw_ = -1;
  core_->turn();
  const auto last = core_->receive();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->name, "a");
  EXPECT_EQ(why(), "it has gone");
}

TEST_F(LinkTest, ItsEndIsNoticed) {
  ::shutdown(raw_, SHUT_RDWR);
  EXPECT_EQ(why(), "it has gone");
  EXPECT_THROW(core_->send(message("a", 1)), Broken);
}

}  // namespace
}  // namespace clearance::gateway
