// The run of the daemon that a request is for, and the one that answers (docs/service/wire.md, "Epochs").
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;
using Bytes = std::vector<std::byte>;

template <class Record>
Bytes frame_of(FrameType type, const Record& record) {
  return simple_frame(type, 1, std::as_bytes(std::span(&record, 1)));
}

Bytes poses_frame(double z) {
  wire::PosesHeader header;
  header.count = 1;
  wire::PoseRecord record;
  record.body = 1;
  record.pose[2] = z;
  record.pose[3] = 1;
  return wire::FrameBuilder(wire::make_header(FrameType::kSetPoses, 1, 0)).add(header).add(record).take();
}

/// The same request with an epoch record.
Bytes for_epoch(const Bytes& frame, std::uint64_t epoch) {
  Bytes records;
  wire::append_epoch(records, epoch, wire::kRecordRequired);
  return extended(frame, records);
}

std::uint64_t epoch_of(const MemoryFrame& frame) {
  return wire::epoch_of(frame.header(), frame.payload());
}

class Epochs : public LoopTest {
 protected:
  void begin(Loop::Options options = {}) {
    start(small_scene(), options);
    wire::AttachRecord attach;
    attach.child = 1;
    attach.parent = 2;
    wire::RemoveBodyRecord remove;
    wire::set_name(remove.name, "nobody");
    requests_ = {
        {"ping", simple_frame(FrameType::kPing, 1)},
        {"describe", simple_frame(FrameType::kDescribe, 1)},
        {"states", simple_frame(FrameType::kGetStates, 1)},
        {"stats", simple_frame(FrameType::kGetStats, 1)},
        {"query", small_query().frame(1)},
        {"pairs", small_query().frame(1, FrameType::kPairs)},
        {"certify", small_query().frame(1, FrameType::kCertify)},
        {"open plan", small_query().frame(1, FrameType::kOpenPlan)},
        {"run plan", frame_of(FrameType::kRunPlan, wire::PlanRecord())},
        {"close plan", frame_of(FrameType::kClosePlan, wire::PlanRecord())},
        {"poses", poses_frame(0.7)},
        {"attach", frame_of(FrameType::kAttach, attach)},
        {"an error", frame_of(FrameType::kRemoveBody, remove)},
        {"reload", simple_frame(FrameType::kReload, 1)},
    };
  }
  std::map<std::string, Bytes> requests_;
};

TEST_F(Epochs, EveryReplyCarriesThatOfTheDaemon) {
  begin();
  ASSERT_NE(loop_->epoch(), 0u);
  for (const auto& [name, request] : requests_) {
    SCOPED_TRACE(name);
    EXPECT_EQ(epoch_of(*evaluate(a_, request)), loop_->epoch());
    EXPECT_EQ(epoch_of(*evaluate(a_, for_epoch(request, loop_->epoch()))), loop_->epoch());
  }
}

TEST_F(Epochs, AreNotTheSameTwice) {
  begin();
  const std::uint64_t first = loop_->epoch();
  begin();
  EXPECT_NE(loop_->epoch(), first);
}

TEST_F(Epochs, RequestsForAnotherOneAreRejectedAndChangeNothing) {
  begin();
  const Pose before = engine_->body_state(1).X_wb;
  for (const auto& [name, request] : requests_) {
    SCOPED_TRACE(name);
    const auto frame = evaluate(a_, for_epoch(request, loop_->epoch() ^ 1));
    ASSERT_EQ(frame->type(), FrameType::kError);
    EXPECT_EQ(epoch_of(*frame), loop_->epoch());
    const auto error = wire::parse_error(frame->body());
    EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kNewEpoch));
    EXPECT_NE(error.text.find("was restarted or replaced"), std::string::npos) << error.text;
  }
  EXPECT_EQ(engine_->body_state(1).X_wb.translation.z, before.translation.z);
  EXPECT_EQ(engine_->body_state(1).parent, kNone);
  EXPECT_EQ(loop_->counter("errors.new_epoch"), requests_.size());
}

TEST_F(Epochs, RecordsThatNameNoneAreRejected) {
  begin();
  const auto rejection = [&](std::size_t bytes, std::byte value) {
    TestQuery query = small_query();
    wire::append_record(query.records, static_cast<std::uint16_t>(wire::CommonRecord::kEpoch), 0, Bytes(bytes, value));
    const auto frame = evaluate(a_, query.frame(1));
    const auto error = wire::parse_error(frame->body());
    EXPECT_EQ(error.header.code, static_cast<std::uint16_t>(ErrorCode::kBadFrame));
    return error.text;
  };
  EXPECT_EQ(rejection(4, std::byte{1}), "query: an epoch is a number of 8 bytes, and not 0");
  EXPECT_EQ(rejection(16, std::byte{1}), "query: an epoch is a number of 8 bytes, and not 0");
  EXPECT_EQ(rejection(8, std::byte{0}), "query: an epoch is a number of 8 bytes, and not 0");
}

TEST_F(Epochs, ADaemonThatRequiresThemAnswersWhoNamesNoneOnlyWhatIsHarmless) {
  Loop::Options options;
  options.require_epoch = true;
  begin(options);
  int rejected = 0;
  for (const auto& [name, request] : requests_) {
    SCOPED_TRACE(name);
    const bool is_harmless = name == "ping" || name == "describe" || name == "stats";
    const auto frame = evaluate(a_, request);
    EXPECT_EQ(frame->type() != FrameType::kError, is_harmless);
    if (is_harmless) continue;
    EXPECT_EQ(wire::parse_error(frame->body()).header.code, static_cast<std::uint16_t>(ErrorCode::kNewEpoch));
    ++rejected;
  }
  EXPECT_EQ(rejected, 11);
  EXPECT_EQ(evaluate(a_, for_epoch(requests_["query"], loop_->epoch()))->type(), FrameType::kReply);
}

TEST_F(Epochs, AQueryThatWaitsForPosesIsAnsweredWithThem) {
  begin();
  TestQuery query = waiting_query();
  transport_->send(a_, for_epoch(query.frame(1), loop_->epoch()));
  turn_until_idle();
  ASSERT_EQ(loop_->held(), 1u);
  const BodyPose pose{1, Pose{{0, 0, 0.3}}};
  loop_->on_poses(std::span(&pose, 1), 1000);
  turn_until_idle();
  const auto frame = take(a_);
  ASSERT_EQ(frame->type(), FrameType::kReply);
  EXPECT_EQ(epoch_of(*frame), loop_->epoch());
}

}  // namespace
}  // namespace clearance
