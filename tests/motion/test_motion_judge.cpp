// Random and adversarial motions before a judge of 60 digits: robots of all kinds of joints, bodies beside and on them,
// moving bases, far from the origin, that graze each other by a millionth of a metre.
#include <fstream>

#include "exact_motion.h"

namespace clearance::test {
namespace {

// A tree of links, each with a ball beside its origin.
std::string random_urdf(Random& random, std::vector<ExactBalls::Ball>* balls) {
  constexpr const char* kTypes[] = {"revolute", "continuous", "prismatic", "fixed", "planar", "revolute"};
  const auto number = [&](double low, double high) { return std::to_string(random.uniform(low, high)); };
  const auto triple = [&](double size) {
    return number(-size, size) + " " + number(-size, size) + " " + number(-size, size);
  };
  std::string text = "<robot name='r'>";
  const int links = 4 + static_cast<int>(random.below(4));
  int driver = -1;
  for (int i = 0; i < links; ++i) {
    const std::string name = "l" + std::to_string(i);
    const std::string at[3] = {number(-0.1, 0.1), number(-0.1, 0.1), number(-0.1, 0.1)}, radius = number(0.02, 0.08);
    balls->push_back({{std::stod(at[0]), std::stod(at[1]), std::stod(at[2])}, std::stod(radius)});
    text += "<link name='" + name + "'><collision><origin xyz='" + at[0] + " " + at[1] + " " + at[2] +
            "'/><geometry><sphere radius='" + radius + "'/></geometry></collision></link>";
    if (i == 0) continue;
    const int from = random.below(4) ? i - 1 : static_cast<int>(random.below(static_cast<std::uint64_t>(i)));
    const std::string type = kTypes[random.below(6)];
    text += "<joint name='j" + std::to_string(i) + "' type='" + type + "'><parent link='l" + std::to_string(from) +
            "'/><child link='" + name + "'/><origin xyz='" + triple(0.4) + "' rpy='" + triple(3) + "'/><axis xyz='" +
            (type == "planar" ? "0 0 1" : triple(1)) + "'/><limit lower='-3' upper='3'/>";
    if (driver >= 0 && type == "revolute" && random.below(3) == 0)
      text += "<mimic joint='j" + std::to_string(driver) + "' multiplier='" + number(-1.5, 1.5) + "' offset='0.1'/>";
    else if (type == "revolute")
      driver = i;
    text += "</joint>";
  }
  return text + "</robot>";
}

// A robot among balls: some stand, one flies and turns, one is held; and how all of it moves.
struct Case {
  Scene scene;
  ExactBalls exact;
  Motions motions;

  Case(Random& random, int count) {
    std::vector<ExactBalls::Ball> of_links;
    const std::string path = ::testing::TempDir() + "motion_judge.urdf";
    std::ofstream(path) << random_urdf(random, &of_links);
    const double far = random.below(4) ? 0 : std::pow(10.0, random.uniform(1, 5));
    RobotOptions options;
    options.urdf = path;
    options.home.emplace();
    options.base = random.pose(0.2);
    options.base.translation.x += far;
    scene.add_robot("r", options);
    for (std::size_t i = 0; i < of_links.size(); ++i) add("r/l" + std::to_string(i), of_links[i]);
    exact.poses[scene.find_body("r")] = options.base;
    const auto add_ball = [&](const std::string& name, const std::string& parent) {
      Scene::BodyOptions body;
      body.pose = random.pose(parent.empty() ? 1 : 0.2);
      if (parent.empty()) body.pose->translation.x += far;
      body.parent = parent;
      body.radius = random.uniform(0.02, 0.15);
      const Vec3d at[] = {{random.uniform(-0.2, 0.2), 0.1, 0}};
      scene.add_hull(name, at, body);
      add(name, {at[0], body.radius});
      exact.poses[scene.find_body(name)] = *body.pose;
      if (!parent.empty()) exact.on[scene.find_body(name)] = scene.find_body(parent);
    };
    for (const char* name : {"one", "two", "three", "flies"}) add_ball(name, "");
    add_ball("held", "r/l" + std::to_string(of_links.size() - 1));
    for (std::uint32_t j = 0; j < scene.joints().size(); ++j) motions.joints.push_back(j);
    if (random.below(2)) motions.bodies.push_back(scene.find_body("flies"));
    if (random.below(3) == 0 || motions.joints.empty()) motions.bodies.push_back(scene.find_body("r"));
    for (int i = 0; i < count; ++i) add_motion(random, far);
    exact.scene = &scene;
  }

  void add_motion(Random& random, double far) {
    const double size = random.below(5) ? std::pow(10.0, random.uniform(-2, 0.5)) : 0;
    const double turns = random.below(3) ? 0 : random.uniform(-6e5, 6e5);  // far around: times are rounded more
    const RobotModel& robot = scene.robots()[0]->model;
    const auto turned = [&](std::size_t j) {
      const JointKind kind = robot.joints[robot.columns[scene.joints()[motions.joints[j]].column].joint].kind;
      return kind == JointKind::kRevolute || kind == JointKind::kContinuous ? turns : 0;
    };
    for (const int end : {0, 1})
      for (std::size_t j = 0; j < motions.joints.size(); ++j) {
        const std::size_t before = motions.positions.size() - motions.joints.size();
        motions.positions.push_back(end ? motions.positions[before] + size * random.uniform(-1, 1)
                                        : turned(j) + random.uniform(-1.5, 1.5));
      }
    for (const int end : {0, 1})
      for (std::size_t b = 0; b < motions.bodies.size(); ++b) {
        Pose X = random.pose(0.8);
        X.translation.x += far;
        if (end && random.below(3) == 0) {  // half a turn, or nearly
          const Pose& from = motions.poses[motions.poses.size() - motions.bodies.size()];
          X.qw = -from.qx, X.qx = from.qw, X.qy = from.qz, X.qz = -from.qy;
          if (random.below(2)) X.qw += from.qw * 1e-6;
        }
        motions.poses.push_back(X);
      }
  }

 private:
  void add(const std::string& name, const ExactBalls::Ball& ball) { exact.balls[scene.find_body(name)] = ball; }
};

struct Tally {
  int judged = 0, beyond = 0, hits = 0, open = 0, grazes = 0;
};

class MotionJudge : public ::testing::Test {
 protected:
  // Times at which a motion is looked at: evenly, and beside those that are named.
  static std::vector<double> times(std::initializer_list<double> named) {
    std::vector<double> times;
    for (int i = 0; i <= 12; ++i) times.push_back(i / 12.0);
    for (const double t : named)
      if (t >= 0 && t <= 1)
        for (const double by : {-1e-2, -1e-4, 0.0, 1e-4, 1e-2}) times.push_back(std::clamp(t + by, 0.0, 1.0));
    return times;
  }

  void judge_distances(const Case& c, const Engine& engine, const std::vector<BodyPair>& pairs, Tally* tally) {
    const Answer min = ask(engine, c.motions.view(Reduce::kMin)), none = ask(engine, c.motions.view(Reduce::kNone));
    ASSERT_EQ(none.info.rows, min.info.rows * pairs.size());
    for (std::uint32_t m = 0; m < c.motions.count(); ++m) {
      const double time = min.view.time[m];
      if (min.view.status[m] == static_cast<std::uint8_t>(Status::kOk)) {
        EXPECT_LE(min.view.upper[m] - min.view.lower[m], 1.0001e-3);
      }
      for (const double t : times({time})) {
        const auto centres = c.exact.at(c.motions, m, t);
        Real least = 1e9;
        for (std::size_t p = 0; p < pairs.size(); ++p) {
          const Real d = c.exact.distance(centres, pairs[p]);
          least = std::min(least, d);
          const std::size_t row = m * pairs.size() + p;
          EXPECT_GE(std::max(d, Real(0)), none.view.lower[row]);
          if (t == none.view.time[row]) {
            EXPECT_LE(std::max(d, Real(0)), none.view.upper[row]);
          }
        }
        EXPECT_GE(std::max(least, Real(0)), min.view.lower[m]);
        if (t != time) continue;
        EXPECT_LE(std::max(least, Real(0)), min.view.upper[m]);
        if (min.view.status[m] == static_cast<std::uint8_t>(Status::kOverlap)) {
          EXPECT_LE(least, 0);
        }
        ++tally->judged;
      }
    }
  }

  // A margin beside the least distance: by some micrometres, in either direction.
  void judge_decisions(const Case& c, const Engine& engine, const std::vector<BodyPair>& pairs, Random& random,
                       Tally* tally) {
    const Answer min = ask(engine, c.motions.view(Reduce::kMin, 2048));
    for (std::uint32_t m = 0; m < c.motions.count(); ++m) {
      const double graze = std::pow(10.0, random.uniform(-6, -4)) * (random.below(2) ? 1 : -1);
      Motions one = c.motions;
      const std::size_t joints = one.joints.size(), bodies = one.bodies.size();
      one.positions.assign(c.motions.positions.begin() + 2 * m * joints,
                           c.motions.positions.begin() + 2 * (m + 1) * joints);
      one.poses.assign(c.motions.poses.begin() + 2 * m * bodies, c.motions.poses.begin() + 2 * (m + 1) * bodies);
      QueryView query = one.view(Reduce::kAny, 512);
      query.margin = std::max(min.view.upper[m] + graze, 0.0);
      const Answer any = ask(engine, query);
      const auto status = static_cast<Status>(any.view.status[0]);
      const double time = any.view.time[0], unproved = any.view.first_contact[0], hit = any.view.first_contact[1];
      tally->grazes += query.margin > 0;
      tally->beyond += status == Status::kBeyond;
      tally->open += status == Status::kUnconverged;
      const bool is_hit = status != Status::kBeyond && status != Status::kUnconverged;
      tally->hits += is_hit;
      EXPECT_EQ(is_hit, hit < kInf);
      EXPECT_EQ(status == Status::kBeyond, unproved == kInf);
      EXPECT_LE(unproved, hit);
      for (const double t : times({time, min.view.time[m], hit})) {
        const auto centres = c.exact.at(c.motions, m, t);
        Real least = 1e9;
        for (const BodyPair pair : pairs) least = std::min(least, c.exact.distance(centres, pair));
        EXPECT_GE(std::max(least, Real(0)), any.view.lower[0]);
        if (t < unproved) {
          EXPECT_GT(least, query.margin);
        }
        if (is_hit && t == time) {
          EXPECT_LE(c.exact.distance(centres, any.view.pair[0]), query.margin);
        }
        if (is_hit && t == hit) {
          EXPECT_LE(least, query.margin);
        }
      }
    }
  }
};

TEST_F(MotionJudge, NothingIsNearerThanIsSaidNorFarther) {
  Random random(11);
  Tally tally;
  for (int k = 0; k < 12; ++k) {
    Case c(random, 4);
    Scene copy = c.scene;
    const Engine engine(std::move(copy), {.backend = "cpu", .threads = 1});
    QueryView all = c.motions.view(Reduce::kNone);
    const std::vector<BodyPair> pairs = engine.pairs(all);
    judge_distances(c, engine, pairs, &tally);
    judge_decisions(c, engine, pairs, random, &tally);
    if (HasFatalFailure()) return;
  }
  std::printf("%d motions; %d margins: %d beyond, %d hits, %d open\n", tally.judged, tally.grazes, tally.beyond,
              tally.hits, tally.open);
  EXPECT_GT(tally.judged, 40);
  EXPECT_GT(tally.beyond, 5);
  EXPECT_GT(tally.hits, 10);
}

}  // namespace
}  // namespace clearance::test
