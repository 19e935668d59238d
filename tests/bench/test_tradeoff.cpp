// The sweep's scenes match their descriptions, and its numbers match their names.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "bench/tradeoff/sweep.h"
#include "tests/source_file.h"

namespace clearance::tradeoff {
namespace {

const std::string kScenes = source_file("scenes");

double largest_extent(const MovingScene& s) {
  double size = 0;
  for (const Body& body : s.scene.bodies())
    for (const ConvexPartPtr& part : body.parts) size = std::max(size, part->spread + part->radius);
  return size;
}

TEST(Tradeoff, ScenesAreNearFarTouchingAndMoving) {
  for (const std::string& name : scene_names()) {
    SCOPED_TRACE(name);
    const MovingScene s = make_moving_scene(name, kScenes, 1, 12);
    EXPECT_GE(s.pairs.size(), 60u);
    EXPECT_FALSE(s.what.empty());
    ASSERT_EQ(s.steps.size(), 12u);
    EXPECT_NE(s.steps[0].back().pose.translation.x, s.steps[11].back().pose.translation.x);
    const ExactDistances exact_value = find_exact_distances(s, 10);
    EXPECT_GE(exact_value.checked, 4u);
    ASSERT_EQ(exact_value.exact.size(), 12u);
    double widest = 0;
    std::size_t overlapping = 0;
    for (const std::size_t step : {std::size_t{0}, exact_value.exact.size() - 1})
      for (const Interval& exact : exact_value.exact[step]) {
        widest = std::max(widest, (exact.upper - exact.lower) / std::max(exact.upper, 1e-3 * largest_extent(s)));
        overlapping += exact.upper == 0;
      }
    EXPECT_LT(widest, 1e-11);
    const double size = largest_extent(s);
    if (name == "near") {
      EXPECT_LT(exact_value.median, 0.3 * size);
      EXPECT_GT(exact_value.median, 0.01 * size);
      EXPECT_EQ(overlapping, 0u);
    } else if (name == "far") {
      EXPECT_GT(exact_value.median, 5 * size);
    } else if (name == "touching") {
      EXPECT_LT(exact_value.median, 1e-8);
      EXPECT_GT(overlapping, 3u);
    } else if (name == "dense") {
      EXPECT_GT(overlapping, s.pairs.size() / 20);
      EXPECT_LT(overlapping, s.pairs.size());
    }
  }
}

TEST(Tradeoff, TheSameSeedGivesTheSameScene) {
  for (const std::string& name : scene_names()) {
    const MovingScene a = make_moving_scene(name, kScenes, 5, 2), b = make_moving_scene(name, kScenes, 5, 2);
    EXPECT_EQ(a.scene.revision(), b.scene.revision());
    EXPECT_EQ(a.steps[1].back().pose.translation.x, b.steps[1].back().pose.translation.x);
  }
  EXPECT_THROW(make_moving_scene("nowhere", kScenes, 1, 1), std::invalid_argument);
}

TEST(Tradeoff, SpreadsAreOrderStatistics) {
  std::vector<double> values;
  for (int i = 1000; i > 0; --i) values.push_back(i);
  const Spread s = spread_of(values);
  EXPECT_EQ(s.p50, 501);
  EXPECT_EQ(s.p99, 991);
  EXPECT_EQ(s.max, 1000);
  EXPECT_EQ(spread_of({}).max, 0);
}

TEST(Tradeoff, EverySettingOnceAndTheDefaultAmongThem) {
  for (const bool brief : {false, true}) {
    const std::vector<Setting> settings = all_settings(brief);
    EXPECT_EQ(std::count(settings.begin(), settings.end(), kDefault), 1);
    for (std::size_t i = 0; i < settings.size(); ++i)
      EXPECT_EQ(std::count(settings.begin(), settings.end(), settings[i]), 1) << i;
  }
}

TEST(Tradeoff, AnswersKeepWhatTheirSettingRequests) {
  const MovingScene s = make_moving_scene("near", kScenes, 1, 2);
  const ExactDistances exact_value = find_exact_distances(s, 5);
  SweepOptions options;
  options.rounds = 1;
  options.brief = true;
  const std::vector<Point> points = sweep(s, exact_value, options);
  ASSERT_EQ(points.size(), all_settings(true).size());
  bool saw_beyond = false, saw_width = false;
  for (const Point& p : points) {
    EXPECT_EQ(p.violations, 0u);
    EXPECT_EQ(p.unconverged, 0);
    EXPECT_GT(p.ns_per_pair, 0);
    EXPECT_NEAR(p.ok + p.overlap + p.contact + p.beyond + p.unconverged, 1, 1e-12);
    EXPECT_LE(p.error.max, p.width.max + 1e-15);  // the distance and the exact distance are both in the interval
    if (p.setting.rel_tol > 0) {
      EXPECT_LE(p.rel_width.max, p.setting.rel_tol * (1 + 2 * p.setting.rel_tol));
    } else {
      EXPECT_LE(p.width.max, p.setting.abs_tol);
    }
    if (std::isinf(p.setting.reach)) {
      EXPECT_EQ(p.beyond, 0);
      EXPECT_EQ(p.evaluated, 1);
    } else {
      saw_beyond |= p.beyond > 0.2 && p.beyond < 0.8;
    }
    saw_width |= p.rel_width.max > 1e-4;
  }
  EXPECT_TRUE(saw_beyond) << "max_distance at the median should cut off about half of the pairs";
  EXPECT_TRUE(saw_width) << "no setting was loose";

  std::ostringstream csv;
  write_header(csv);
  write_rows(csv, s, exact_value, options, points);
  std::istringstream lines(csv.str());
  std::string line, header;
  std::getline(lines, header);
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_TRUE(std::getline(lines, line));
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), std::count(header.begin(), header.end(), ','));
  }
}

}  // namespace
}  // namespace clearance::tradeoff
