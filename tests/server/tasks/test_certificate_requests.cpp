// Certificates through the loop: the engine's own document, made in slices alongside other requests, and rejections.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "engine/narrow/work_meter.h"
#include "server/tasks/certificate_request.h"
#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

std::vector<std::byte> rows_record(std::vector<std::uint64_t> rows) {
  std::vector<std::byte> records;
  wire::append_record(records, static_cast<std::uint16_t>(wire::QueryRecord::kRows), wire::kRecordRequired,
                      std::as_bytes(std::span(rows)));
  return records;
}

/// Adjacent combs, whose teeth are convex parts.
engine::Scene combs(int count, int teeth) {
  engine::Scene scene;
  for (int b = 0; b < count; ++b) {
    Body body;
    body.name = "comb_" + std::to_string(b);
    body.source = "test";
    body.pose = Pose{{0, 0.5 * b, 0}, 1, 0, 0, 0};
    for (int p = 0; p < teeth; ++p)
      body.parts.push_back(make_convex_part({{1.0 * p, 0, 0}, {p + 0.6, 0, 0}, {p + 0.3, 0, 0.4}}));
    scene.add_body(std::move(body));
  }
  return scene;
}

class CertificateRequests : public LoopTest {
 protected:
  std::string document(const std::unique_ptr<MemoryFrame>& frame) {
    EXPECT_EQ(frame->type(), FrameType::kCertificate);
    const auto body = frame->body();
    return {reinterpret_cast<const char*>(body.data()), body.size()};
  }
  void expect_rejected(const std::vector<std::byte>& frame, ErrorCode code, const std::string& text) {
    const auto error = error_of(evaluate(a_, frame));
    EXPECT_EQ(static_cast<ErrorCode>(error.header.code), code);
    EXPECT_EQ(error.text, text);
  }
};

TEST_F(CertificateRequests, AreAnsweredWithTheEnginesOwnDocument) {
  start(small_scene());
  QueryView query;
  EXPECT_EQ(document(evaluate(a_, TestQuery().frame(1, FrameType::kCertify))), engine_->certificate(query));

  TestQuery some;
  some.records = rows_record({1, 0});
  const std::vector<std::uint64_t> numbers{1, 0};
  EXPECT_EQ(document(evaluate(a_, some.frame(2, FrameType::kCertify))), engine_->certificate(query, numbers));

  some.records = rows_record({});
  EXPECT_EQ(document(evaluate(a_, some.frame(3, FrameType::kCertify))),
            engine_->certificate(query, std::vector<std::uint64_t>()))
      << "no rows are not all rows";
}

TEST_F(CertificateRequests, OfConfigurations) {
  start(small_scene());
  TestQuery query;
  query.pairs = {{0, 1}, {1, 2}};
  query.bodies = {1};
  for (int k = 0; k < 3; ++k) query.configurations.push_back({0.5 * k, 0.1, 2, 1, 0, 0, 0});
  const std::string text = document(evaluate(a_, query.frame(1, FrameType::kCertify)));
  QueryView view;
  const std::vector<BodyPair> pairs{{0, 1}, {1, 2}};
  std::vector<Pose> poses;
  for (int k = 0; k < 3; ++k) poses.push_back(Pose{{0.5 * k, 0.1, 2}, 1, 0, 0, 0});
  const std::vector<std::uint32_t> bodies{1};
  view.pairs = pairs;
  view.all_pairs = false;
  view.bodies = bodies;
  view.configurations = poses;
  view.configuration_count = 3;
  EXPECT_EQ(text, engine_->certificate(view));
  EXPECT_NE(text.find("\"row\":5,\"configuration\":2"), std::string::npos);
}

TEST_F(CertificateRequests, AreMadeInSlices) {
  // Rows of many parts: no turn of a worker takes long, and others are answered in between.
  start(combs(4, 40), short_slices());
  transport_->send(a_, TestQuery().frame(1, FrameType::kCertify));
  std::uint64_t most = 0;
  int turns = 0, others = 0;
  while (a_.replies.empty()) {
    if (turns % 100 == 50) transport_->send(b_, simple_frame(FrameType::kPing, 1));
    const std::uint64_t before = units_of_this_thread;
    loop_->turn();
    most = std::max(most, units_of_this_thread - before);
    ++turns;
    for (; !b_.replies.empty(); ++others) b_.replies.pop_front();
  }
  EXPECT_GT(turns, 1000);
  EXPECT_GT(others, 5);
  EXPECT_LE(most, 2048u);
  EXPECT_EQ(document(take(a_)), engine_->certificate(QueryView()));
}

TEST_F(CertificateRequests, AreRejectedByName) {
  start(small_scene());
  TestQuery query;
  query.records = rows_record({0});
  expect_rejected(query.frame(1), ErrorCode::kBadQuery, "query: rows (record 16) are for kCertify");
  query.records = rows_record({0, 77});
  const QueryView view;
  const std::string rows = std::to_string(engine_->size(view).rows);
  expect_rejected(query.frame(1, FrameType::kCertify), ErrorCode::kBadQuery,
                  "certificate: rows[1]: expected one of " + rows + " rows, got 77");
  query.records = rows_record(std::vector<std::uint64_t>(100'001));
  expect_rejected(query.frame(1, FrameType::kCertify), ErrorCode::kTooLarge,
                  "certificate: of at most 100000 rows at a time, got 100001");
  query.records.clear();
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  expect_rejected(query.frame(1, FrameType::kCertify), ErrorCode::kBadQuery,
                  "certificate: only rows of reduce none and motions have one");
  expect_rejected(
      waiting_query().frame(1, FrameType::kCertify), ErrorCode::kNotSupported,
      "certificate: min_pose_stamp_ns and deadline_ns are not supported; request it once the poses are there");
}

TEST_F(CertificateRequests, OfTooMuchAreRejectedAsSoonAsThatIsSeen) {
  start(combs(2, 1000));  // each pair of parts has its own direction in the document
  expect_rejected(TestQuery().frame(1, FrameType::kCertify), ErrorCode::kTooLarge,
                  "certificate: the document takes more than " + std::to_string(CertificateRequest::kMostBytes) +
                      " bytes: request fewer rows at a time");
  EXPECT_EQ(evaluate(a_, small_query()).rows(), 1u) << "the daemon goes on";
}

TEST_F(CertificateRequests, CountAsWhatTheyMayTake) {
  Loop::Options options = short_slices();
  options.max_client_bytes = CertificateRequest::kMostBytes + (1 << 20);
  start(scattered_scene(20), options);
  transport_->send(a_, TestQuery().frame(1, FrameType::kCertify));
  loop_->turn();
  transport_->send(a_, TestQuery().frame(2, FrameType::kCertify));
  while (a_.replies.empty()) loop_->turn();
  const auto error = error_of(take(a_));
  EXPECT_EQ(static_cast<ErrorCode>(error.header.code), ErrorCode::kBusy);
  EXPECT_NE(error.text.find("limit max-client-mib"), std::string::npos) << error.text;
  turn_until_idle();
  EXPECT_EQ(take(a_)->type(), FrameType::kCertificate);
}

}  // namespace
}  // namespace clearance
