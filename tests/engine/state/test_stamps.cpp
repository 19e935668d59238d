// Stamps of poses: invalid times, late updates, and the newest stamp in answers.
#include <gtest/gtest.h>

#include <chrono>
#include <limits>

#include "engine/engine.h"
#include "engine/state/stamp_marks.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;
constexpr std::int64_t kMin = std::numeric_limits<std::int64_t>::min(), kMax = std::numeric_limits<std::int64_t>::max();

engine::Scene three_balls() {
  engine::Scene scene;
  for (const char* name : {"a", "b", "c"}) scene.add_sphere(name, 0.1, {});
  return scene;
}

class Stamps : public testing::Test {
 protected:
  /// Returns the reason for rejecting an update of one body, or an empty string if it was applied.
  std::string set(std::uint32_t body, double x, std::int64_t stamp, std::uint64_t publisher = 0,
                  std::int64_t sequence = 0) {
    const BodyPose pose{body, Pose{{x, 0, 0}}};
    const std::uint64_t revision = engine_->pose_revision();
    try {
      EXPECT_EQ(engine_->set_poses(std::span(&pose, 1), stamp, sequence, publisher).applied, 1u);
      EXPECT_EQ(engine_->body_state(body).X_wb.translation.x, x);
      return "";
    } catch (const engine::QueryError& error) {
      EXPECT_EQ(error.code, QueryErrorCode::kBadQuery);
      EXPECT_EQ(engine_->pose_revision(), revision) << "refused, and yet something changed";
      return error.what();
    }
  }
  ReplyInfo info() const { return engine_->start({}, {}).info(); }
  std::uint64_t counter(const std::string& name) const {
    for (const auto& [key, value] : engine_->stats())
      if (key == name) return value;
    return ~std::uint64_t{0};
  }
  /// Reloads the scene as a daemon does.
  void reload() {
    auto next = std::make_unique<engine::Engine>(three_balls(), engine::Engine::Options{.threads = 1});
    next->take_poses(*engine_);
    engine_ = std::move(next);
  }
  static std::int64_t now() {
    return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
  }

  std::unique_ptr<engine::Engine> engine_ =
      std::make_unique<engine::Engine>(three_balls(), engine::Engine::Options{.threads = 1});
};

TEST_F(Stamps, WhatIsNoTimeIsRejectedAndPoisonsNothing) {
  EXPECT_EQ(set(0, 1, 1000), "");
  std::uint64_t rejected = 0;
  for (int round = 0; round < 2; ++round) {
    for (const std::int64_t bad : {kMax, kMax - 1, now() + 3'600'000'000'000, std::int64_t{-1}, kMin}) {
      for (const std::uint32_t body : {0u, 1u}) EXPECT_NE(set(body, 9, bad), "") << bad;
      rejected += 2;
    }
    EXPECT_EQ(info().snapshot_stamp_ns, 1000);
    EXPECT_EQ(counter("engine.stamps_out_of_range"), rejected);
    reload();
  }
  EXPECT_EQ(counter("engine.stamps_out_of_range"), rejected) << "counts go on over a reload";
  EXPECT_EQ(set(0, 2, 2000), "");
  EXPECT_EQ(info().snapshot_stamp_ns, 2000);
  EXPECT_NE(set(0, 9, kMax).find("stamp_ns: 9223372036854775807 is "), std::string::npos);
  EXPECT_NE(set(0, 9, kMax).find(" s ahead of this machine's clock; 60 s may be"), std::string::npos);
  EXPECT_NE(set(0, 9, -5).find("stamp_ns: -5 is below 0"), std::string::npos);
}

TEST_F(Stamps, AClockMayBeAheadAsFarAsConfigured) {
  EXPECT_EQ(set(0, 1, now() + 37'000'000'000), "") << "TAI";
  engine::Engine::Options options{.threads = 1};
  options.max_stamp_lead = 2h;
  engine_ = std::make_unique<engine::Engine>(three_balls(), options);
  EXPECT_EQ(set(0, 1, now() + 3'600'000'000'000), "");
  EXPECT_NE(set(0, 1, now() + 3 * 3'600'000'000'000), "");
}

TEST_F(Stamps, OlderOnesOfAPublisherAreRejectedForEachBody) {
  EXPECT_EQ(set(0, 1, 100, 7), "");
  EXPECT_EQ(set(0, 2, 100, 7), "") << "parts of one update have one stamp";
  EXPECT_NE(set(0, 3, 99, 7).find("is older than 100, the last from this publisher for 'a'"), std::string::npos);
  EXPECT_EQ(set(1, 4, 50, 7), "") << "another body";
  EXPECT_EQ(set(0, 5, 60, 8), "") << "another publisher, another clock";
  EXPECT_NE(set(0, 6, 99, 7), "");
  EXPECT_NE(set(0, 6, 59, 8), "");
  reload();
  EXPECT_NE(set(0, 6, 99, 7), "") << "a reload forgets nothing";
  EXPECT_NE(set(0, 6, 59, 8), "");
  EXPECT_EQ(set(0, 7, 101, 7), "");
  EXPECT_EQ(counter("engine.stamps_late"), 5u);

  // A batch applies as a whole or not at all.
  const BodyPose both[] = {{1, Pose{{11, 0, 0}}}, {0, Pose{{12, 0, 0}}}};
  EXPECT_THROW(engine_->set_poses(both, 80, 0, 7), engine::QueryError);
  EXPECT_EQ(engine_->body_state(1).X_wb.translation.x, 4);
  EXPECT_EQ(set(1, 13, 80, 7), "") << "the refused batch has left no mark";
}

TEST_F(Stamps, WithoutOneAPublisherMayBeginAgain) {
  EXPECT_EQ(set(0, 1, 100), "");
  EXPECT_EQ(set(0, 2, 0), "");
  EXPECT_EQ(set(0, 3, 5), "");
  EXPECT_NE(set(0, 4, 4), "");
}

TEST_F(Stamps, TheNewestIsThatOfThePosesThatAreThere) {
  EXPECT_EQ(set(0, 1, 1'000'000, 1, 9), "");
  EXPECT_EQ(set(1, 1, 500, 2, 3), "");
  EXPECT_EQ(info().snapshot_stamp_ns, 1'000'000);
  EXPECT_EQ(info().snapshot_sequence, 9);
  EXPECT_EQ(set(0, 2, 600, 2, 4), "") << "a publisher of another clock has the body now";
  EXPECT_EQ(info().snapshot_stamp_ns, 600);
  EXPECT_EQ(info().snapshot_sequence, 4);
  reload();
  EXPECT_EQ(info().snapshot_stamp_ns, 600);
  EXPECT_EQ(info().snapshot_sequence, 4);
}

TEST(StampMarks, RememberSoManyPublishersOfABody) {
  StampMarks marks(1);
  for (std::uint64_t p = 1; p <= StampMarks::kMostMarks; ++p) marks.note(0, p, 100 + static_cast<std::int64_t>(p));
  marks.note(0, 1, 200);
  marks.note(0, 99, 300);
  EXPECT_EQ(marks.last(0, 1), 200);
  EXPECT_EQ(marks.last(0, 2), 0) << "silent for longest";
  EXPECT_EQ(marks.last(0, 3), 103);
  EXPECT_EQ(marks.last(0, 99), 300);
}

}  // namespace
}  // namespace clearance
