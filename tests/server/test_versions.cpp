// What is compatible with what (docs/wire.md, "Versions"): a client of version 1, as it was recorded, asks this daemon;
// a daemon of version 1, as it was recorded, answers this client; and records between this client and this daemon.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <sstream>
#include <thread>
#include <zmq.hpp>

#include "client/client.h"
#include "daemon_fixture.h"
#include "loop_fixture.h"
#include "raw_shm_client.h"
#include "server/shm_transport.h"
#include "tests/client/scripted_server.h"
#include "tests/patience.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;
using Bytes = std::vector<std::byte>;

// --- the recording

struct Exchange {
  std::string name;
  Bytes request, reply;
};

Bytes bytes_of(const std::string& hex) {
  Bytes bytes(hex.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i] = static_cast<std::byte>(std::stoi(hex.substr(2 * i, 2), nullptr, 16));
  return bytes;
}

const std::vector<Exchange>& recorded() {
  static const auto all = [] {
    std::vector<Exchange> exchanges;
    std::ifstream file(source_file("tests/server/version_1.txt"));
    for (std::string name, request, reply; std::getline(file, name);)
      if (!name.starts_with('#') && std::getline(file, request) && std::getline(file, reply))
        exchanges.push_back({name, bytes_of(request), bytes_of(reply)});
    return exchanges;
  }();
  return all;
}

const Exchange& recorded(const std::string& name) {
  for (const Exchange& exchange : recorded())
    if (exchange.name == name) return exchange;
  throw std::runtime_error("no recording of " + name);
}

wire::FrameHeader header_of(const Bytes& frame) {
  wire::FrameHeader header;
  std::memcpy(&header, frame.data(), sizeof header);
  return header;
}

std::span<const std::byte> payload_of(const Bytes& frame) {
  return std::span(frame).subspan(sizeof(wire::FrameHeader));
}

template <class Record>
void forget(Bytes& frame, std::initializer_list<std::size_t> members) {
  if (frame.size() < sizeof(wire::FrameHeader) + sizeof(Record)) return;
  for (const std::size_t member : members) std::memset(frame.data() + sizeof(wire::FrameHeader) + member, 0, 8);
}

/// Zeroes what differs from run to run: clocks, and revisions, which are digests of the scene.
void forget_clocks(Bytes& frame) {
  std::memset(frame.data() + offsetof(wire::FrameHeader, scene_revision), 0, 8);
  switch (static_cast<FrameType>(header_of(frame).type)) {
    case FrameType::kReply:
      return forget<wire::ReplyHeader>(
          frame, {offsetof(wire::ReplyHeader, scene_revision), offsetof(wire::ReplyHeader, oldest_receipt_ns),
                  offsetof(wire::ReplyHeader, engine_ns), offsetof(wire::ReplyHeader, server_ns),
                  offsetof(wire::ReplyHeader, pose_age_ns)});
    case FrameType::kScene:
      return forget<wire::SceneHeader>(frame, {offsetof(wire::SceneHeader, scene_revision)});
    case FrameType::kPairTable:
      return forget<wire::PairsHeader>(frame, {offsetof(wire::PairsHeader, scene_revision)});
    case FrameType::kPosesDone:
      return forget<wire::PosesResult>(frame, {offsetof(wire::PosesResult, scene_revision)});
    case FrameType::kSceneChanged:
      return forget<wire::SceneChange>(
          frame, {offsetof(wire::SceneChange, scene_revision), offsetof(wire::SceneChange, seconds)});
    default:
      return;
  }
}

/// Whether rows are of groups that hold a body without a pose. When they were recorded such a row was that of the
/// others.
bool lacks_a_pose(const Exchange& then) {
  return then.name == "query_least_compact_warm" || then.name == "query_nearest_stale";
}

/// Byte for byte, but for clocks, and for numbers of columns, which may differ by what arithmetic may change.
void expect_same(const Exchange& then, Bytes now) {
  SCOPED_TRACE(then.name);
  Bytes expected = then.reply;
  forget_clocks(expected);
  forget_clocks(now);
  ASSERT_EQ(now.size(), expected.size());
  std::size_t end = now.size();
  if (header_of(expected).type == static_cast<std::uint16_t>(FrameType::kReply)) {
    end = sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader);
    const auto header = wire::parse_reply(payload_of(expected));
    for (int f = 0; f < kFieldCount; ++f) {
      if (!(header.fields >> f & 1) || lacks_a_pose(then)) continue;
      const std::size_t at = end + wire::column_offset(header.rows, header.fields, Field(1u << f));
      const std::uint64_t bytes = header.rows * kFieldBytes[f];
      const bool are_doubles =
          (1u << f) & (kFieldDistance | kFieldLower | kFieldUpper | kFieldPoints | kFieldNormal | kFieldGradient);
      for (std::uint64_t i = 0; i < bytes / 8 && are_doubles; ++i) {
        double a, b;
        std::memcpy(&a, expected.data() + at + 8 * i, 8);
        std::memcpy(&b, now.data() + at + 8 * i, 8);
        EXPECT_TRUE(a == b || std::abs(a - b) <= 1e-6 || (std::isnan(a) && std::isnan(b)))
            << f << ": " << a << " " << b;
      }
      if (!are_doubles && (1u << f) != kFieldCompact) {
        EXPECT_EQ(std::memcmp(now.data() + at, expected.data() + at, bytes), 0) << "column " << f;
      }
    }
  }
  EXPECT_TRUE(std::equal(now.begin(), now.begin() + static_cast<std::ptrdiff_t>(end), expected.begin()));
}

// --- a client of version 1

class RecordedClient {
 public:
  virtual ~RecordedClient() = default;
  virtual Bytes ask(const Bytes& frame) = 0;
};

class RecordedZmqClient final : public RecordedClient {
 public:
  explicit RecordedZmqClient(const std::string& url) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.connect(url);
  }
  Bytes ask(const Bytes& frame) override {
    socket_.send(zmq::buffer(frame.data(), 64), zmq::send_flags::sndmore);
    socket_.send(zmq::buffer(frame.data() + 64, frame.size() - 64), zmq::send_flags::none);
    zmq::message_t head, payload;
    (void)socket_.recv(head);
    (void)socket_.recv(payload);
    Bytes reply(head.data<std::byte>(), head.data<std::byte>() + head.size());
    reply.insert(reply.end(), payload.data<std::byte>(), payload.data<std::byte>() + payload.size());
    return reply;
  }

 private:
  zmq::context_t context_;
  zmq::socket_t socket_{context_, zmq::socket_type::dealer};
};

class RecordedShmClient final : public RecordedClient {
 public:
  explicit RecordedShmClient(const std::string& url) : client_(url.substr(std::string("shm://").size()), false) {
    // The greeting of version 1: "CLSM", layout 1, wire 1, kHello, and zeros.
    const Bytes greeting = bytes_of("434c534d0100010001000000" + std::string(2 * 244, '0'));
    EXPECT_EQ(::send(client_.socket.get(), greeting.data(), greeting.size(), MSG_NOSIGNAL), 256);
    client_.take_segment();
    client_.map();
  }
  Bytes ask(const Bytes& frame) override {
    const auto& header = *client_.header;
    std::memcpy(client_.base + header.request_offset, frame.data(), frame.size());
    ++asked_;
    client_.post(shm::pack_ticket(0, asked_), frame.size(), asked_);
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (header.reply_head.load() != asked_) {
      if (std::chrono::steady_clock::now() > deadline)
        throw std::runtime_error("no answer to request " + std::to_string(asked_));
      std::this_thread::yield();
    }
    const std::byte* reply = client_.base + header.reply_offset;
    return {reply, reply + header.replies[(asked_ - 1) % shm::kRingEntries].frame_bytes.load()};
  }

 private:
  RawClient client_;
  std::uint32_t asked_ = 0;
};

class NewDaemon : public testing::TestWithParam<const char*> {
 protected:
  std::string url(const std::string& scheme) const {
    for (const std::string& url : daemon_.urls())
      if (url.starts_with(scheme)) return url;
    throw std::runtime_error("no " + scheme);
  }
  TestFolder folder_;
  Daemon daemon_{{"--scene", folder_.write("scene.yaml", kSmallSceneYaml), "--zmq", "ipc://" + (folder_ / "z"), "--shm",
                  folder_ / "s", "--threads", "1"}};
};

TEST_P(NewDaemon, AnswersAClientOfVersion1AsBefore) {
  std::unique_ptr<RecordedClient> client;
  if (GetParam() == std::string("shm"))
    client = std::make_unique<RecordedShmClient>(url("shm"));
  else
    client = std::make_unique<RecordedZmqClient>(url("ipc"));
  int compared = 0;
  for (const Exchange& then : recorded()) {
    if (then.name == "version_2") continue;
    expect_same(then, client->ask(then.request));
    ++compared;
  }
  EXPECT_EQ(compared, 15);
}

// --- a daemon of version 1

/// Answers what was recorded, whoever asks for it.
class RecordedDaemon {
 public:
  Bytes answer(const wire::FrameHeader& asked, std::span<const std::byte> payload) {
    const Exchange* found = asked.version == 2 ? &recorded("version_2") : nullptr;
    for (const Exchange& then : recorded())
      if (!found && header_of(then.request).type == asked.type && std::ranges::equal(payload_of(then.request), payload))
        found = &then;
    if (!found) ++unknown;
    Bytes frame = found ? found->reply : recorded("refused").reply;
    std::memcpy(frame.data() + offsetof(wire::FrameHeader, request_id), &asked.request_id, sizeof asked.request_id);
    return frame;
  }
  std::atomic<int> unknown{0};  ///< requests of version 1 that no client of that time sent
};

/// The same over shared memory: the transport is this daemon's, whose greeting and layout have not changed.
class RecordedShmDaemon final : public Inbox {
 public:
  explicit RecordedShmDaemon(const std::string& path) : transport_(make_shm_transport(path, {})) {
    thread_ = std::thread([this] {
      while (!stopping_) {
        if (transport_->poll(*this) == 0) std::this_thread::yield();
        transport_->tick(*this);
      }
    });
  }
  ~RecordedShmDaemon() override {
    stopping_ = true;
    thread_.join();
  }
  void on_frame(const wire::FrameHeader& header, std::span<const std::byte> payload,
                std::unique_ptr<ReplySink> sink) override {
    const Bytes frame = daemon.answer(header, payload);
    std::memcpy(sink->reserve(frame.size()), frame.data(), frame.size());
    sink->publish(frame.size());
  }
  PoseUpdateResult on_poses(std::span<const BodyPose>, std::int64_t, std::int64_t, std::uint64_t) override {
    return {};
  }
  PoseUpdateResult on_joints(std::span<const JointPosition>, std::int64_t, std::int64_t, std::uint64_t) override {
    return {};
  }
  std::uint64_t& counter(const std::string& name) override { return counters_[name]; }
  Engine& engine() override { throw std::logic_error("this server has no engine"); }
  RecordedDaemon daemon;

 private:
  std::map<std::string, std::uint64_t> counters_;
  std::unique_ptr<Transport> transport_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

void ask_a_recorded_daemon(const std::string& url, const RecordedDaemon& daemon) {
  Client client = patient(url);
  EXPECT_EQ(client.scene().bodies.size(), 4u);
  const Reply all = client.distances();
  EXPECT_EQ(all.rows(), client.scene().pair_count);
  EXPECT_EQ(all.backend(), "cpu");
  const std::vector<IdPair> pairs{{0, 1}, {1, 2}, {2, 0}};
  Query query;
  query.pairs = pairs;
  EXPECT_EQ(client.distances(query).rows(), 3u);
  query.max_reply_bytes = 1 << 20;
  try {
    (void)client.distances(query);
    ADD_FAILURE() << "a daemon of version 1 knows no records";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(ErrorCode::kWrongVersion));
    EXPECT_STREQ(error.what(),
                 "frame: version 2, this side speaks version 1; the daemon is too old for one of: max_reply_bytes");
  }
  query.max_reply_bytes = 0;
  EXPECT_EQ(client.distances(query).rows(), 3u) << "the connection goes on";
  EXPECT_EQ(daemon.unknown, 0) << "what this client sends without records is what one of version 1 sent";
}

TEST(OldDaemon, AnswersThisClientOverZmq) {
  RecordedDaemon daemon;
  const ScriptedServer server(
      [&](const wire::FrameHeader& header, std::span<const std::byte> payload) {
        return std::vector<Bytes>{daemon.answer(header, payload)};
      },
      false);
  ask_a_recorded_daemon(server.url(), daemon);
}

TEST(OldDaemon, AnswersThisClientOverSharedMemory) {
  const TestFolder folder;
  RecordedShmDaemon daemon(folder / "s");
  ask_a_recorded_daemon("shm://" + (folder / "s"), daemon.daemon);
}

// --- records

TEST_P(NewDaemon, HoldsAReplyToItsLimit) {
  Client client = patient(url(GetParam()));
  Query query;
  const Reply without = client.distances(query);
  const std::uint64_t bytes =
      64 + 128 + wire::columns_bytes(without.rows(), without.fields()) + wire::kEpochRecordBytes;
  query.max_reply_bytes = bytes;
  EXPECT_EQ(client.distances(query).rows(), without.rows());
  query.max_reply_bytes = bytes - 1;
  for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin}) {
    query.reduce = reduce;
    try {
      (void)client.distances(query);
      ADD_FAILURE() << "too large";
    } catch (const RequestError& error) {
      EXPECT_EQ(error.code, static_cast<std::uint16_t>(ErrorCode::kTooLarge));
      EXPECT_NE(std::string(error.what()).find("more than the max_reply_bytes = " + std::to_string(bytes - 1)),
                std::string::npos)
          << error.what();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Over, NewDaemon, testing::Values("ipc", "shm"),
                         [](const auto& transport) { return std::string(transport.param); });

class Records : public LoopTest {
 protected:
  void SetUp() override { start(small_scene()); }
  static Bytes record(std::uint16_t tag, std::uint16_t flags, std::size_t bytes = 8) {
    Bytes records;
    wire::append_record(records, tag, flags, Bytes(bytes, std::byte{1}));
    return records;
  }
  std::string refusal_of(Bytes frame, ErrorCode code) {
    const auto reply = ask(a_, std::move(frame));
    EXPECT_EQ(reply->type(), FrameType::kError);
    const auto error =
        wire::parse_error(reply->payload().first(reply->payload().size() - reply->header().records_bytes));
    EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(code)) << error.text;
    return error.text;
  }
};

TEST_F(Records, OfUnknownTagsAreRefusedIfRequiredElsePassedOver) {
  TestQuery query = small_query();
  query.records = record(77, wire::kRecordRequired);
  EXPECT_EQ(refusal_of(query.frame(1), ErrorCode::kNotSupported),
            "query: record 77 is required, and this side does not know it");
  query.records = record(77, 0, 13);
  const Bytes last = record(300, 0, 0);
  query.records.insert(query.records.end(), last.begin(), last.end());
  const auto frame = ask(a_, query.frame(2));
  ASSERT_EQ(frame->type(), FrameType::kReply);
  EXPECT_EQ(frame->header().version, wire::kRecordsVersion);
  const auto parts = wire::split_payload(frame->header(), frame->payload());
  EXPECT_EQ(wire::parse_reply(parts.body, parts.records).rows, 1u);
  EXPECT_EQ(parts.records.size(), 16u + wire::kEpochRecordBytes);
  std::vector<std::uint16_t> ignored;
  wire::PassedOver none;
  wire::read_records("reply", parts.records, none, [&](const wire::RecordView& r) {
    EXPECT_EQ(r.tag, static_cast<std::uint16_t>(wire::ReplyRecord::kIgnored));
    ignored.resize(r.bytes.size() / 2);
    std::memcpy(ignored.data(), r.bytes.data(), r.bytes.size());
    return true;
  });
  EXPECT_EQ(ignored, (std::vector<std::uint16_t>{77, 300}));
  EXPECT_EQ(loop_->counter("records.ignored"), 2u);
}

TEST_F(Records, OfOtherRequestsFollowTheSameRule) {
  const auto with = [](const Bytes& frame, const Bytes& records) {
    const auto header = wire::with_records(header_of(frame), records.size());
    return wire::FrameBuilder(header)
        .add_bytes(frame.data() + sizeof header, frame.size() - sizeof header)
        .add_bytes(records.data(), records.size())
        .take();
  };
  const Bytes describe = simple_frame(FrameType::kDescribe, 1);
  EXPECT_EQ(refusal_of(with(describe, record(500, wire::kRecordRequired)), ErrorCode::kNotSupported),
            "kDescribe: record 500 is required, and this side does not know it");
  const auto scene = ask(a_, with(describe, record(500, 0)));
  EXPECT_EQ(scene->type(), FrameType::kScene);
  EXPECT_EQ(scene->header().version, wire::kRecordsVersion) << "a reply has its request's version";
  TestQuery query = small_query();
  query.records = record(500, 0);
  EXPECT_EQ(ask(a_, query.frame(1, FrameType::kPairs))->type(), FrameType::kPairTable);
  EXPECT_EQ(loop_->counter("records.ignored"), 2u);
}

TEST_F(Records, ThatDoNotFitAreRefused) {
  struct Case {
    Bytes records;
    std::string text;
  };
  Bytes twice = record(9, 0), cut = record(9, 0, 40);
  const Bytes again = record(9, 0);
  twice.insert(twice.end(), again.begin(), again.end());
  cut.resize(24);
  const Case cases[] = {
      {record(1, wire::kRecordRequired, 4), "query: max_reply_bytes (record 1) has 4 bytes, expected 8"},
      {record(9, 2), "query: record 9 has unknown flags"},
      {record(0, 0), "query: record 0 comes after record 0: tags must rise, from 1 on"},
      {twice, "query: record 9 comes after record 9: tags must rise, from 1 on"},
      {cut, "query: record 9 goes past the end of the frame"},
  };
  for (const auto& [records, text] : cases) {
    TestQuery query = small_query();
    query.records = records;
    EXPECT_EQ(refusal_of(query.frame(1), ErrorCode::kBadFrame), text);
  }
  Bytes frame = small_query().frame(1);
  wire::FrameHeader header = header_of(frame);
  header.version = wire::kRecordsVersion;
  for (const std::uint64_t bytes : {std::uint64_t{4}, std::uint64_t{1000}, ~std::uint64_t{7}}) {
    header.records_bytes = bytes;
    std::memcpy(frame.data(), &header, sizeof header);
    EXPECT_EQ(refusal_of(frame, ErrorCode::kBadFrame),
              "frame: " + std::to_string(bytes) + " bytes are no whole records at the end of a payload of 136");
  }
  header.version = wire::kVersion;
  std::memcpy(frame.data(), &header, sizeof header);
  EXPECT_EQ(refusal_of(frame, ErrorCode::kBadFrame), "frame: reserved words must be 0");
}

TEST_F(Records, StayWithAQueryThatWaitsForPoses) {
  TestQuery query = waiting_query();
  query.records = record(77, 0);
  transport_->send(a_, query.frame(1));
  turn_until_idle();
  ASSERT_EQ(loop_->held(), 1u);
  const BodyPose pose{1, Pose{{0, 0, 0.3}}};
  loop_->on_poses(std::span(&pose, 1), 1000);
  turn_until_idle();
  const auto frame = take(a_);
  ASSERT_EQ(frame->type(), FrameType::kReply);
  EXPECT_EQ(frame->header().records_bytes, 16u + wire::kEpochRecordBytes);
}

}  // namespace
}  // namespace clearance
