// Motions through the engine: proved bounds hold at each time, and reported contacts exist.
#include <gtest/gtest.h>

#include <array>

#include "tests/engine/arm_scene.h"
#include "tests/engine/motion/motion_test.h"

namespace clearance::test {
namespace {

TEST(Motions, LeastDistanceOfABallThatFliesPast) {
  Flight flight;
  Random random(1);
  std::vector<double> exact, times;
  for (int i = 0; i < 200; ++i) {
    const Vec3d from{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    const Vec3d to{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    flight.add(from, to);
    const Vec3d d = to - from;
    const double t = std::clamp(-dot(from, d) / dot(d, d), 0.0, 1.0);
    times.push_back(t);
    exact.push_back(norm(from + d * t) - 0.15);
  }
  const engine::Engine engine = engine_of(std::move(flight.scene));
  const Answer min = evaluate(engine, flight.motions.view(Reduce::kMin, 100000));
  const Answer any = evaluate(engine, flight.motions.view(Reduce::kAny));
  const Answer none = evaluate(engine, flight.motions.view(Reduce::kNone, 100000));
  ASSERT_EQ(min.info.rows, 200u);
  int hits = 0, free = 0;
  for (std::size_t i = 0; i < 200; ++i) {
    const double least = std::max(exact[i], 0.0);
    EXPECT_LE(min.view.lower[i], least + 1e-12);
    EXPECT_GE(min.view.upper[i], least - 1e-12);
    EXPECT_LE(min.view.upper[i] - min.view.lower[i], 1e-3);
    EXPECT_EQ(none.view.lower[i], min.view.lower[i]);
    EXPECT_EQ(none.view.upper[i], min.view.upper[i]);
    const auto status = static_cast<Status>(any.view.status[i]);
    if (exact[i] > 1e-9) {
      EXPECT_EQ(status, Status::kBeyond) << exact[i];
      EXPECT_TRUE(std::isnan(any.view.time[i]));
      EXPECT_EQ(any.view.first_contact[2 * i], kInf);
      EXPECT_EQ(any.view.first_contact[2 * i + 1], kInf);
      ++free;
    } else if (exact[i] < -1e-6) {
      EXPECT_EQ(status, Status::kOverlap) << exact[i];
      const Vec3d from = flight.motions.poses[2 * i].translation, to = flight.motions.poses[2 * i + 1].translation;
      EXPECT_LE(norm(from + (to - from) * any.view.time[i]), 0.15);
      EXPECT_LE(any.view.first_contact[2 * i], any.view.first_contact[2 * i + 1]);
      ++hits;
    }
    EXPECT_EQ(any.view.configuration[i], i);
  }
  EXPECT_GT(hits, 10);
  EXPECT_GT(free, 100);
}

// Flights past a ball, with exact gaps that are positive and negative, small and large.
std::vector<double> add_flights_by_gap(Flight& flight, std::size_t count) {
  Random random(11);
  std::vector<double> gaps;
  while (gaps.size() < count) {
    const double size = std::pow(10.0, random.uniform(-7, -1)), gap = gaps.size() % 2 ? size : -size;
    flight.add({random.uniform(-2, -0.5), 0.15 + gap, 0}, {random.uniform(0.5, 2), 0.15 + gap, 0});
    gaps.push_back(gap);
  }
  return gaps;
}

// A search that ends early proves no unexamined part free.
TEST(Motions, OutOfStepsIsNeverFree) {
  Flight flight;
  const std::vector<double> gaps = add_flights_by_gap(flight, 60);
  const engine::Engine engine = engine_of(std::move(flight.scene));
  int free = 0, hits = 0, unconverged = 0;
  for (const double margin : {0.0, 1e-9, 1e-3})
    for (const double abs_tol : {0.0, 1e-3})
      for (std::uint32_t steps = 1; steps <= 256; steps = steps < 12 ? steps + 1 : 2 * steps) {
        QueryView query = flight.motions.view(Reduce::kAny, steps);
        query.margin = margin;
        query.abs_tol = abs_tol;
        const Answer any = evaluate(engine, query);
        query.fields &= ~kFieldFirstContact;
        const Answer without = evaluate(engine, query);
        for (std::size_t i = 0; i < gaps.size(); ++i) {
          const auto status = static_cast<Status>(any.view.status[i]);
          ASSERT_EQ(status == Status::kBeyond, any.view.first_contact[2 * i] == kInf) << i << " " << steps;
          if (status == Status::kBeyond || static_cast<Status>(without.view.status[i]) == Status::kBeyond) {
            ASSERT_GT(gaps[i], margin) << i << " " << steps << " steps, abs_tol " << abs_tol;
          }
          if (status <= Status::kContact) {
            ASSERT_LE(gaps[i], margin) << i;
          }
          free += status == Status::kBeyond;
          hits += status <= Status::kContact;
          unconverged += status == Status::kUnconverged;
        }
      }
  EXPECT_GT(free, 500);
  EXPECT_GT(hits, 500);
  EXPECT_GT(unconverged, 500);
}

TEST(Motions, VerdictIsTheStatusWithoutTheKindOfAHit) {
  Flight flight;
  const std::size_t count = add_flights_by_gap(flight, 60).size();
  const std::uint32_t person = flight.scene.add_sphere("person", 0.3, {.pose = Pose{{0, 9, 0}}});
  engine::Engine engine = engine_of(std::move(flight.scene));
  std::array<int, 9> seen{};
  const auto compare = [&](double margin, std::uint32_t steps) {
    QueryView query = flight.motions.view(Reduce::kAny, steps);
    query.margin = margin;
    for (const std::uint32_t contact : {0u, kFieldFirstContact | 0u}) {  // has a search of its own
      query.fields = kFieldStatus | contact;
      const Answer known = evaluate(engine, query);
      for (const std::uint32_t others : {0u, kFieldPair | kFieldTime}) {
        query.fields = kFieldVerdict | others | contact;
        const Answer answer = evaluate(engine, query);
        ASSERT_EQ(answer.size.fields, query.fields) << "no other column is forced";
        for (std::size_t i = 0; i < count; ++i) {
          const auto status = static_cast<Status>(known.view.status[i]);
          const bool is_hit = status <= Status::kContact;
          ASSERT_EQ(static_cast<Status>(answer.view.verdict[i]), is_hit ? Status::kOk : status) << i;
          ++seen[static_cast<std::size_t>(status)];
        }
      }
    }
  };
  for (const double margin : {0.0, 1e-3})
    for (const std::uint32_t steps : {1u, 256u}) compare(margin, steps);
  engine.set_poses(std::vector<BodyPose>{{person, Pose{{std::nan(""), 0, 1}}}});
  compare(0, 256);
  for (const Status status :
       {Status::kOk, Status::kContact, Status::kOverlap, Status::kBeyond, Status::kUnconverged, Status::kBadPose})
    EXPECT_GT(seen[static_cast<std::size_t>(status)], 3) << static_cast<int>(status);
}

// A least distance below the tolerance is no contact if the same row proves the motion free.
TEST(Motions, AMotionThatIsProvedFreeIsNoContact) {
  Flight flight;
  const std::vector<double> gaps = add_flights_by_gap(flight, 60);
  const engine::Engine engine = engine_of(std::move(flight.scene));
  for (const Reduce reduce : {Reduce::kMin, Reduce::kNone}) {
    const Answer answer = evaluate(engine, flight.motions.view(reduce));
    int narrow = 0, contacts = 0;
    for (std::size_t i = 0; i < gaps.size(); ++i) {
      const auto status = static_cast<Status>(answer.view.status[i]);
      contacts += status == Status::kContact || status == Status::kOverlap;
      EXPECT_LE(answer.view.lower[i], std::max(gaps[i], 0.0));
      EXPECT_GE(answer.view.upper[i], std::max(gaps[i], 0.0));
      if (answer.view.first_contact[2 * i] != kInf) continue;
      EXPECT_GT(gaps[i], 0) << i;
      EXPECT_EQ(status, Status::kOk) << i << " " << gaps[i];
      EXPECT_GT(answer.view.lower[i], 0) << i;
      narrow += gaps[i] < 1e-3;
    }
    EXPECT_GT(narrow, 10);
    EXPECT_GT(contacts, 10);
  }
}

// A body without a usable pose may be anywhere, so that only an overlap of other bodies is certain.
TEST(Motions, ABodyWithoutAPoseIsNotPassedOver) {
  Flight flight;
  flight.add({-1, 1, 0}, {1, 1, 0});
  flight.add({-1, 0, 0}, {1, 0, 0});
  const std::uint32_t person = flight.scene.add_sphere("person", 0.3, {});
  engine::Engine engine = engine_of(std::move(flight.scene));
  const auto expect_status = [&](Status expected) {
    for (const Reduce reduce : {Reduce::kMin, Reduce::kAny}) {
      QueryView query = flight.motions.view(reduce);
      for (const std::uint32_t fields : {kMotionAnswer, std::uint32_t{kFieldStatus | kFieldLower | kFieldUpper}}) {
        query.fields = fields;
        const Answer answer = evaluate(engine, query);
        EXPECT_EQ(static_cast<Status>(answer.view.status[0]), expected);
        EXPECT_EQ(answer.view.lower[0], -kInf);
        EXPECT_EQ(answer.view.upper[0], kInf);
        EXPECT_EQ(static_cast<Status>(answer.view.status[1]), Status::kOverlap);
        EXPECT_LE(answer.view.lower[1], 0);
      }
      query.fields = kMotionAnswer;
      const Answer answer = evaluate(engine, query);
      EXPECT_EQ(answer.view.pair[0].b, person);
      EXPECT_EQ(answer.view.first_contact[0], 0);
      EXPECT_TRUE(answer.view.flags[0] & kFlagIncomplete);
      EXPECT_TRUE(answer.view.flags[1] & kFlagIncomplete);
    }
  };
  expect_status(Status::kNoPose);
  engine.set_poses(std::vector<BodyPose>{{person, Pose{{std::nan(""), 0, 1}}}});
  expect_status(Status::kBadPose);
  engine.set_poses(std::vector<BodyPose>{{person, Pose{{0, 5, 0}}}});
  EXPECT_EQ(static_cast<Status>(evaluate(engine, flight.motions.view(Reduce::kMin)).view.status[0]), Status::kOk);
}

// A rod that rotates by nearly half a turn sweeps over a peg that it touches neither at the ends nor in the middle.
TEST(Motions, ARodThatTurnsSweepsOverAPeg) {
  engine::Scene scene;
  scene.add_sphere("peg", 0.01, {.is_static = true, .pose = Pose{{0.3, 0.3, 0}}});
  Motions motions;
  motions.bodies = {scene.add_box("rod", {1, 0.002, 0.002}, {.pose = Pose{}})};
  const auto turned = [](double angle) { return Pose{{0, 0, 0}, std::cos(angle / 2), 0, 0, std::sin(angle / 2)}; };
  motions.poses = {turned(0), turned(3.1), turned(0), turned(-3.1 + 2 * M_PI), turned(0), turned(0.7)};
  const engine::Engine engine = engine_of(std::move(scene));
  const Answer answer = evaluate(engine, motions.view(Reduce::kAny));
  EXPECT_EQ(answer.view.status[0], static_cast<std::uint8_t>(Status::kOverlap));
  EXPECT_NEAR(answer.view.time[0] * 3.1, M_PI / 4, 0.06);
  // In the other direction the rod's other half passes, from below.
  EXPECT_EQ(answer.view.status[1], static_cast<std::uint8_t>(Status::kOverlap));
  EXPECT_NEAR(-answer.view.time[1] * 3.1, M_PI / 4 - M_PI, 0.06);
  EXPECT_EQ(answer.view.status[2], static_cast<std::uint8_t>(Status::kBeyond));
}

Motions random_edges(const engine::Scene& scene, const std::vector<std::uint32_t>& joints, int count, double longest,
                     std::uint64_t seed) {
  Random random(seed);
  Motions motions;
  motions.joints = joints;
  for (int i = 0; i < count; ++i) {
    std::vector<double> start, end;
    const double size = random.uniform(0, longest);
    for (const std::uint32_t j : joints) {
      const SceneJoint& joint = scene.joints()[j];
      start.push_back(random.uniform(joint.lower, joint.upper));
      end.push_back(std::clamp(start.back() + size * random.uniform(-1, 1), joint.lower, joint.upper));
    }
    motions.positions.insert(motions.positions.end(), start.begin(), start.end());
    motions.positions.insert(motions.positions.end(), end.begin(), end.end());
  }
  return motions;
}

// Pairs of the arm's links with the world and each other that are not always in contact.
std::vector<BodyPair> pairs_of(const engine::Scene& scene) {
  const std::uint32_t arm = scene.find_group("arm") | kGroupBit;
  std::vector<BodyPair> pairs = {{scene.find_body("table"), arm}, {scene.find_body("ball"), arm}};
  const auto add = [&](const char* a, const char* b) {
    pairs.push_back({scene.find_body(std::string("arm/") + a), scene.find_body(std::string("arm/") + b)});
  };
  for (const char* link : {"wrist", "palm", "flange", "left_finger", "right_finger"}) {
    add("base", link);
    add("upper", link);
  }
  return pairs;
}

constexpr double kRounding = 1e-12;  // of samples' times and kinematics

// Edges of an arm, including its own links: no sample is nearer than the lower bound, and witnesses are found at the
// reported times.
TEST(Motions, EdgesOfAnArmHoldAtEachSample) {
  engine::Scene scene = arm_scene(at_home());
  Motions motions = random_edges(scene, joints_of(scene, "arm"), 60, 1.0, 2);
  motions.pairs = pairs_of(scene);
  const engine::Engine engine = engine_of(std::move(scene));
  const std::uint32_t rows = motions.count();
  QueryView decides = motions.view(Reduce::kAny);
  decides.margin = 0.005;
  const Answer any = evaluate(engine, decides), min = evaluate(engine, motions.view(Reduce::kMin, 4096));
  int free = 0, hits = 0, undecided = 0;
  for (std::uint32_t i = 0; i < rows; ++i) {
    const Samples samples(motions, i, 100u);
    const Answer at = evaluate(engine, samples.view(motions, Reduce::kMin));
    const double nearest = *std::min_element(at.view.upper, at.view.upper + samples.count);
    EXPECT_LE(min.view.lower[i], nearest + kRounding);
    if (min.view.status[i] != static_cast<std::uint8_t>(Status::kUnconverged)) {
      // The base's prism protrudes from its cylinder by 0.12 mm.
      const double slack = min.view.flags[i] & kFlagUncertaintyLimited ? 1.3e-4 : 0;
      EXPECT_LE(min.view.upper[i] - min.view.lower[i], 1.001e-3 + slack);
    }
    const Answer witness = evaluate(engine, Samples(motions, i, min.view.time[i]).view(motions, Reduce::kMin));
    EXPECT_NEAR(witness.view.upper[0], min.view.upper[i], 1.001e-3);
    EXPECT_LE(any.view.lower[i], nearest + kRounding);
    const auto status = static_cast<Status>(any.view.status[i]);
    if (status == Status::kBeyond) {
      EXPECT_GT(nearest, 0.005 - kRounding);
      ++free;
    } else if (status == Status::kUnconverged) {
      ++undecided;
    } else {
      const Answer hit = evaluate(engine, Samples(motions, i, any.view.time[i]).view(motions, Reduce::kMin));
      EXPECT_LE(hit.view.lower[0], 0.005);
      EXPECT_LE(any.view.upper[i], 0.005);
      ++hits;
    }
  }
  EXPECT_GT(free, 5);
  EXPECT_GT(hits, 2);
  EXPECT_LE(undecided, 1);
}

// Rows of single pairs agree with the row of all pairs.
TEST(Motions, PairsByThemselvesAndAllTogetherAgree) {
  engine::Scene scene = arm_scene(at_home());
  Motions motions = random_edges(scene, joints_of(scene, "arm"), 5, 0.5, 3);
  motions.pairs = pairs_of(scene);
  const engine::Engine engine = engine_of(std::move(scene));
  const Answer none = evaluate(engine, motions.view(Reduce::kNone, 100000)),
               min = evaluate(engine, motions.view(Reduce::kMin, 100000));
  const std::uint64_t pairs = none.size.pairs;
  ASSERT_EQ(none.info.rows, 5 * pairs);
  for (std::uint64_t i = 0; i < 5; ++i) {
    const double* const lower = none.view.lower + i * pairs;
    const double* const upper = none.view.upper + i * pairs;
    EXPECT_NEAR(*std::min_element(lower, lower + pairs), min.view.lower[i], 1.001e-3);
    EXPECT_NEAR(*std::min_element(upper, upper + pairs), min.view.upper[i], 1.001e-3);
    for (std::uint64_t p = 0; p < pairs; ++p) EXPECT_EQ(none.view.configuration[i * pairs + p], i);
  }
}

// Slices of any size and any number of threads give the same rows.
TEST(Motions, SlicesAndThreadsChangeNothing) {
  engine::Scene scene = arm_scene(at_home());
  Motions motions = random_edges(scene, joints_of(scene, "arm"), 150, 0.6, 4);
  motions.pairs = pairs_of(scene);
  const engine::Engine one = engine_of(arm_scene(at_home()), 1), three = engine_of(std::move(scene), 3);
  for (const Reduce reduce : {Reduce::kAny, Reduce::kMin}) {
    const QueryView query = motions.view(reduce, 64);
    const Answer whole = evaluate(one, query), sliced = evaluate(three, query, std::chrono::nanoseconds(1));
    for (std::uint64_t i = 0; i < whole.info.rows; ++i) {
      EXPECT_EQ(whole.view.lower[i], sliced.view.lower[i]);
      EXPECT_EQ(whole.view.upper[i], sliced.view.upper[i]);
      EXPECT_EQ(whole.view.status[i], sliced.view.status[i]);
      EXPECT_EQ(whole.view.steps[i], sliced.view.steps[i]);
    }
  }
}

TEST(Motions, AMotionThatGoesNowhereIsAConfiguration) {
  engine::Scene scene = arm_scene(at_home());
  Motions motions = random_edges(scene, joints_of(scene, "arm"), 20, 0.5, 5);
  motions.pairs = pairs_of(scene);
  const std::size_t joints = motions.joints.size();
  for (std::uint32_t i = 0; i < motions.count(); ++i)
    std::copy_n(motions.positions.begin() + 2 * i * joints, joints, motions.positions.begin() + (2 * i + 1) * joints);
  const engine::Engine engine = engine_of(std::move(scene));
  const Answer min = evaluate(engine, motions.view(Reduce::kMin)), any = evaluate(engine, motions.view(Reduce::kAny));
  for (std::uint32_t i = 0; i < motions.count(); ++i) {
    const Answer at = evaluate(engine, Samples(motions, i, 0.0).view(motions, Reduce::kMin));
    EXPECT_EQ(min.view.steps[i], 1u);
    EXPECT_NEAR(min.view.upper[i], at.view.upper[0], 1e-3);
    EXPECT_LE(min.view.lower[i], at.view.upper[0]);
    EXPECT_EQ(any.view.steps[i], 1u);
    EXPECT_EQ(any.view.status[i] == static_cast<std::uint8_t>(Status::kBeyond), at.view.lower[0] > 0);
  }
}

// Both ends belong to the motion.
TEST(Motions, ContactAtEitherEndIsFound) {
  Flight flight;
  flight.add({1, 0, 0}, {0.1499, 0, 0});
  flight.add({0.1499, 0, 0}, {1, 0, 0});
  flight.add({1, 0, 0}, {0.1501, 0, 0});
  const engine::Engine engine = engine_of(std::move(flight.scene));
  const Answer any = evaluate(engine, flight.motions.view(Reduce::kAny));
  EXPECT_EQ(any.view.status[0], static_cast<std::uint8_t>(Status::kOverlap));
  EXPECT_EQ(any.view.status[1], static_cast<std::uint8_t>(Status::kOverlap));
  EXPECT_EQ(any.view.status[2], static_cast<std::uint8_t>(Status::kBeyond));
  EXPECT_GT(any.view.time[0], 0.99);
  EXPECT_LT(any.view.time[1], 0.01);
}

// One evaluation of all pairs is not divided into slices.
TEST(Motions, TooManyPairsAreRejectedByName) {
  engine::Scene scene;
  Motions motions;
  for (int i = 0; i < 364; ++i)
    motions.bodies.push_back(scene.add_sphere("s" + std::to_string(i), 0.1, {.pose = Pose{{1.0 * i, 0, 0}}}));
  motions.poses.assign(2 * motions.bodies.size(), Pose{});
  const engine::Engine engine = engine_of(std::move(scene));
  try {
    evaluate(engine, motions.view(Reduce::kAny));
    FAIL() << "66,066 pairs were answered";
  } catch (const engine::QueryError& error) {
    EXPECT_EQ(error.code, QueryErrorCode::kTooLarge);
    EXPECT_NE(std::string(error.what()).find("66066 pairs"), std::string::npos) << error.what();
  }
}

TEST(Motions, NoPoseAndBadPositionsAreReported) {
  engine::RobotOptions options;
  options.urdf = kArm;  // without a home
  engine::Scene scene = arm_scene(options);
  Motions motions;
  motions.joints = {0};
  motions.positions = {0, 1};
  const engine::Engine engine = engine_of(std::move(scene));
  EXPECT_EQ(evaluate(engine, motions.view(Reduce::kAny)).view.status[0], static_cast<std::uint8_t>(Status::kNoPose));
  engine::Scene placed = arm_scene(at_home());
  Motions bad = random_edges(placed, joints_of(placed, "arm"), 3, 0.3, 6);
  bad.positions[0] = std::nan("");
  bad.positions[bad.joints.size() * 3] = 2e6;
  const engine::Engine other = engine_of(std::move(placed));
  const Answer any = evaluate(other, bad.view(Reduce::kAny)), min = evaluate(other, bad.view(Reduce::kMin));
  for (const Answer* answer : {&any, &min}) {
    EXPECT_EQ(answer->view.status[0], static_cast<std::uint8_t>(Status::kBadPose));
    EXPECT_EQ(answer->view.status[1], static_cast<std::uint8_t>(Status::kBadPose));
    EXPECT_NE(answer->view.status[2], static_cast<std::uint8_t>(Status::kBadPose));
  }
}

// Planes along the axes and oblique, which are unbounded: bounds for bodies moving above them hold as for any body.
TEST(Motions, EdgesOfAnArmHoldAboveHalfSpaces) {
  engine::Scene scene = arm_scene(at_home());
  const std::vector<std::uint32_t> planes{
      scene.add_half_space("floor", {.pose = Pose{{0, 0, -0.05}}}),
      scene.add_half_space("wall", {.pose = Pose{{-0.6, 0, 0}, 0.9, 0.1, 0.8, 0.05}})};
  Motions motions = random_edges(scene, joints_of(scene, "arm"), 40, 0.6, 3);
  for (const std::uint32_t plane : planes)
    for (const char* link : {"upper", "wrist", "palm", "flange", "left_finger"})
      motions.pairs.push_back({plane, scene.find_body(std::string("arm/") + link)});
  const engine::Engine engine = engine_of(std::move(scene));
  const Answer any = evaluate(engine, motions.view(Reduce::kAny, 4096)),
               min = evaluate(engine, motions.view(Reduce::kMin, 4096));
  int free = 0, hits = 0;
  for (std::uint32_t i = 0; i < motions.count(); ++i) {
    const Samples samples(motions, i, 100u);
    const Answer at = evaluate(engine, samples.view(motions, Reduce::kMin));
    const double nearest = *std::min_element(at.view.upper, at.view.upper + samples.count);
    EXPECT_LE(min.view.lower[i], nearest + kRounding);
    EXPECT_LE(min.view.upper[i] - min.view.lower[i], 1.001e-3);
    const auto status = static_cast<Status>(any.view.status[i]);
    if (status == Status::kBeyond) {
      EXPECT_GT(nearest, 0);
    }
    free += status == Status::kBeyond;
    hits += status == Status::kOverlap;
  }
  EXPECT_GT(free, 10);
  EXPECT_GT(hits, 3);
}

}  // namespace
}  // namespace clearance::test
