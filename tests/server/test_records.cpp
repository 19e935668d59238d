// Records of requests and replies (docs/service/wire.md, "Versions").
#include <gtest/gtest.h>

#include <cstring>

#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;
using Bytes = std::vector<std::byte>;

wire::FrameHeader header_of(const Bytes& frame) {
  wire::FrameHeader header;
  std::memcpy(&header, frame.data(), sizeof header);
  return header;
}

class Records : public LoopTest {
 protected:
  void SetUp() override { start(small_scene()); }
  static Bytes record(std::uint16_t tag, std::uint16_t flags, std::size_t bytes = 8) {
    Bytes records;
    wire::append_record(records, tag, flags, Bytes(bytes, std::byte{1}));
    return records;
  }
  std::string rejection_of(Bytes frame, ErrorCode code) {
    const auto reply = evaluate(a_, std::move(frame));
    EXPECT_EQ(reply->type(), FrameType::kError);
    const auto error = wire::parse_error(reply->body());
    EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(code)) << error.text;
    return error.text;
  }
};

TEST_F(Records, OfUnknownTagsAreRejectedIfRequiredElsePassedOver) {
  TestQuery query = small_query();
  query.records = record(77, wire::kRecordRequired);
  EXPECT_EQ(rejection_of(query.frame(1), ErrorCode::kNotSupported),
            "query: record 77 is required but unknown to this side");
  query.records = record(77, 0, 13);
  const Bytes last = record(300, 0, 0);
  query.records.insert(query.records.end(), last.begin(), last.end());
  const auto frame = evaluate(a_, query.frame(2));
  ASSERT_EQ(frame->type(), FrameType::kReply);
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
  const Bytes describe = simple_frame(FrameType::kDescribe, 1);
  EXPECT_EQ(rejection_of(extended(describe, record(500, wire::kRecordRequired)), ErrorCode::kNotSupported),
            "kDescribe: record 500 is required but unknown to this side");
  const auto scene = evaluate(a_, extended(describe, record(500, 0)));
  EXPECT_EQ(scene->type(), FrameType::kScene);
  TestQuery query = small_query();
  query.records = record(500, 0);
  EXPECT_EQ(evaluate(a_, query.frame(1, FrameType::kPairs))->type(), FrameType::kPairTable);
  EXPECT_EQ(loop_->counter("records.ignored"), 2u);
}

TEST_F(Records, ThatDoNotFitAreRejected) {
  struct Case {
    Bytes records;
    std::string text;
  };
  Bytes twice = record(9, 0), cut = record(9, 0, 40);
  const Bytes again = record(9, 0);
  twice.insert(twice.end(), again.begin(), again.end());
  cut.resize(24);
  const Case cases[] = {
      {record(5, wire::kRecordRequired, 4), "query: margin (record 5) has 4 bytes, expected 8"},
      {record(9, 2), "query: record 9 has unknown flags"},
      {record(0, 0), "query: record 0 comes after record 0: tags must increase from 1"},
      {twice, "query: record 9 comes after record 9: tags must increase from 1"},
      {cut, "query: record 9 goes past the end of the frame"},
  };
  for (const auto& [records, text] : cases) {
    TestQuery query = small_query();
    query.records = records;
    EXPECT_EQ(rejection_of(query.frame(1), ErrorCode::kBadFrame), text);
  }
  Bytes frame = small_query().frame(1);
  wire::FrameHeader header = header_of(frame);
  for (const std::uint64_t bytes : {std::uint64_t{4}, std::uint64_t{1000}, ~std::uint64_t{7}}) {
    header.records_bytes = bytes;
    std::memcpy(frame.data(), &header, sizeof header);
    EXPECT_EQ(rejection_of(frame, ErrorCode::kBadFrame),
              "frame: " + std::to_string(bytes) + " bytes are not whole records at the end of a payload of 136");
  }
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
