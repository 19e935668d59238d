// Clouds over LCM: complete or dropped, for any order of their parts, in bounded memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <random>
#include <vector>

#include "server/lcm/lcm_points.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using clearance_lcm::points_t;
using std::chrono::milliseconds;

constexpr std::int32_t kPart = points_t::PART_POINTS;

/// The parts of a cloud whose points count from 0.
std::vector<points_t> parts_of(std::int32_t total, std::int64_t publisher = 5, std::int64_t sequence = 1) {
  std::vector<points_t> parts;
  const std::int32_t count = std::max(1, (total + kPart - 1) / kPart);
  for (std::int32_t i = 0; i < count; ++i) {
    points_t part{};
    part.publisher_id = publisher;
    part.sequence = sequence;
    part.stamp_ns = 77;
    part.body = "cloud";
    part.radius = 0.5;
    part.total = total;
    part.part = i;
    part.parts = count;
    for (std::int32_t p = i * kPart; p < std::min(total, (i + 1) * kPart); ++p)
      part.xyz.push_back({static_cast<float>(p), 1, 2});
    part.count = static_cast<std::int32_t>(part.xyz.size());
    parts.push_back(std::move(part));
  }
  return parts;
}

class Clouds : public testing::Test {
 protected:
  std::optional<FrameBytes> add(const points_t& part) { return points_.add(part, 3, now_); }

  LcmPoints points_;
  LcmPoints::Clock::time_point now_{std::chrono::hours(1)};
};

TEST_F(Clouds, AreWholeInWhateverOrderTheirPartsCome) {
  std::mt19937 random(1);
  for (const std::int32_t total : {0, 1, kPart, kPart + 1, 5 * kPart - 1}) {
    std::vector<points_t> parts = parts_of(total, 5, total + 1);
    std::shuffle(parts.begin(), parts.end(), random);
    for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
      EXPECT_FALSE(add(parts[i])) << "a part is missing";
      EXPECT_FALSE(add(parts[i])) << "once more";
    }
    const std::optional<FrameBytes> frame = add(parts.back());
    ASSERT_TRUE(frame) << total;
    wire::FrameHeader header;
    const wire::PointsParts whole = wire::parse_points(wire::split_frame(frame->span(), header));
    EXPECT_EQ(header.type, static_cast<std::uint16_t>(wire::FrameType::kSetPoints));
    EXPECT_EQ(whole.header.count, static_cast<std::uint64_t>(total));
    EXPECT_EQ(whole.header.body, 3u);
    EXPECT_EQ(whole.header.stamp_ns, 77);
    EXPECT_EQ(whole.header.sequence, total + 1);
    EXPECT_EQ(whole.header.has_radius, 1);
    EXPECT_EQ(whole.header.radius, 0.5);
    for (std::int32_t p = 0; p < total; ++p) {
      float x;
      std::memcpy(&x, whole.xyz.data() + 12 * p, sizeof x);
      ASSERT_EQ(x, static_cast<float>(p));
    }
  }
}

TEST_F(Clouds, OfDifferentSequencesOrPublishersNeverMix) {
  const auto a = parts_of(2 * kPart, 5, 1), b = parts_of(2 * kPart, 5, 2), c = parts_of(2 * kPart, 6, 1);
  EXPECT_FALSE(add(a[0]));
  EXPECT_FALSE(add(b[1]));
  EXPECT_FALSE(add(c[1]));
  EXPECT_TRUE(add(a[1]));
  EXPECT_TRUE(add(b[0]));
}

TEST_F(Clouds, WithPartsThatDisagreeAreNotMade) {
  auto parts = parts_of(2 * kPart);
  EXPECT_FALSE(add(parts[0]));
  parts[1].body = "other";
  EXPECT_FALSE(add(parts[1]));
  parts[1].body = "cloud";
  parts[1].radius = 0.25;
  EXPECT_FALSE(add(parts[1]));
  EXPECT_EQ(points_.counts().bad, 2u);
  parts[1].radius = 0.5;
  EXPECT_TRUE(add(parts[1]));
}

TEST_F(Clouds, WithNumbersThatDoNotFitAreRejected) {
  const auto rejected = [&](auto change) {
    points_t part = parts_of(2 * kPart)[0];
    change(part);
    const std::uint64_t before = points_.counts().bad;
    EXPECT_FALSE(add(part));
    EXPECT_EQ(points_.counts().bad, before + 1);
  };
  rejected([](points_t& p) { p.parts = 3; });
  rejected([](points_t& p) { p.part = 2; });
  rejected([](points_t& p) { p.part = -1; });
  rejected([](points_t& p) { p.total = -1; });
  rejected([](points_t& p) { p.xyz.pop_back(); });
  rejected([](points_t& p) {
    p.total = static_cast<std::int32_t>(LcmPoints::kMostPoints) + 1;
    p.parts = (p.total + kPart - 1) / kPart;
  });
}

TEST_F(Clouds, OfWhichAPartIsLostAreGivenUp) {
  auto parts = parts_of(2 * kPart);
  EXPECT_FALSE(add(parts[0]));
  now_ += milliseconds(1900);
  points_.expire(now_);
  EXPECT_EQ(points_.counts().given_up, 0u);
  now_ += milliseconds(200);
  points_.expire(now_);
  EXPECT_EQ(points_.counts().given_up, 1u);
  EXPECT_FALSE(add(parts[1])) << "its first half is gone";
}

// Incomplete clouds use a bounded amount of memory.
TEST_F(Clouds, ThatNeverEndAreDroppedForOthers) {
  const auto most = static_cast<std::int32_t>(LcmPoints::kMostPoints);
  for (int i = 0; i < 9; ++i) EXPECT_FALSE(add(parts_of(most, 100 + i)[0]));
  EXPECT_EQ(points_.counts().given_up, 5u) << "four of that size are under way at most";
  const auto parts = parts_of(2 * kPart, 7);
  EXPECT_FALSE(add(parts[0]));
  EXPECT_TRUE(add(parts[1]));
}

}  // namespace
}  // namespace clearance
