#include "tests/oracle/stops/approaches.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>
#include <vector>

#include "engine/api/engine.h"
#include "planner/stop_check.h"
#include "tests/oracle/stops/exact_arm.h"
#include "tests/temporary_folder.h"

namespace clearance::stops {
namespace {

constexpr int kMoments = 16;          // of an approach, at which it is checked
constexpr int kCompareEach = 8;       // approaches: one is compared with capsules
constexpr double kModelError = 2e-4;  // metres: above that of the engine's cylinders in motions

/// An arm in an engine, and persons, who are balls.
struct World {
  ExactArm arm;
  Engine engine;
  Joints joints;
  std::array<std::uint32_t, 2> persons;

  static Scene scene(const ExactArm& arm, const std::array<double, 2>& radii) {
    const TemporaryFolder folder;
    Scene scene;
    scene.add_robot("arm", {.urdf = folder.write("arm.urdf", arm.urdf()), .home = std::map<std::string, double>{}});
    for (std::size_t i = 0; i < radii.size(); ++i) scene.add_sphere("person" + std::to_string(i), radii[i]);
    scene.ignore("arm", "arm");
    scene.ignore("person0", "person1");
    return scene;
  }
  World(const ExactArm& made, const std::array<double, 2>& radii, bool covers)
      : arm(made),
        engine(scene(made, radii), {.threads = 1, .covers = covers ? "background" : "off"}),
        joints(engine.joints("arm")),
        persons{engine.body("person0"), engine.body("person1")} {}
};

/// How persons move: towards the nearest of some points of the robot, or straight on.
enum class Manner { kChase, kToRest, kStraight };

struct Approach {
  std::vector<double> q, v, deceleration;
  double reaction = 0, margin = 0;
  bool together = true;
  double harder = 1;  ///< at least 1: the brakes' actual deceleration by that of the law
  struct Person {
    Point at;
    double radius, speed;
    Manner manner;
    Point heading;
  };
  std::array<Person, 2> persons;
  double step = 0;  ///< seconds between moments

  Braking law(std::span<const Mover> others) const { return {deceleration, reaction, others, together}; }
};

/// Positions at a time after braking was commanded. By its definition: speeds fall to 0.
std::vector<double> braking(const Approach& a, double t) {
  std::vector<double> q = a.q;
  double last = 0;
  for (std::size_t j = 0; j < q.size(); ++j) last = std::max(last, std::abs(a.v[j]) / a.deceleration[j]);
  for (std::size_t j = 0; j < q.size(); ++j) {
    const double stop = (a.together ? last : std::abs(a.v[j]) / a.deceleration[j]) / a.harder;
    const double since = std::clamp(t - a.reaction, 0.0, stop);
    q[j] += a.v[j] * std::min(t, a.reaction);
    if (stop > 0) q[j] += a.v[j] * (since - since * since / (2 * stop));
  }
  return q;
}

double standstill(const Approach& a) {
  double last = 0;
  for (std::size_t j = 0; j < a.q.size(); ++j) last = std::max(last, std::abs(a.v[j]) / a.deceleration[j]);
  return a.reaction + last / a.harder;
}

/// Moves a person for a time towards a point of the arm, or straight on, at full speed.
void walk(const ExactArm& arm, const std::vector<ExactArm::Placed>& goal, Approach::Person& person, double seconds) {
  Point towards = person.heading;
  if (person.manner != Manner::kStraight) {
    // Down the slope of the distance to the arm.
    constexpr double kStep = 1e-5;
    const double here = arm.distance(goal, person.at, false);
    for (std::size_t i = 0; i < 3; ++i) {
      Point moved = person.at;
      moved[i] += kStep;
      towards[i] = here - arm.distance(goal, moved, false);
    }
    const double slope = length(towards);
    towards = slope > 0 ? (1 / slope) * towards : person.heading;
  }
  person.at = person.at + seconds * person.speed * towards;
}

/// Brakes, while persons go on, and returns the least distance until standstill.
double brake(const ExactArm& arm, Approach a) {
  const double end = standstill(a), fastest = arm.speed(a.v);
  const auto rest = arm.place(braking(a, end));
  double least = 1e300;
  for (double t = 0;;) {
    const auto now = arm.place(braking(a, t));
    double step = end;
    for (const Approach::Person& person : a.persons) {
      const double d = arm.distance(now, person.at, false) - person.radius;
      least = std::min(least, d);
      step = std::min(step, d / (fastest + person.speed + 1e-9));  // no contact before
    }
    if (t >= end || least < 0) return least;
    step = std::min(std::max(step, end / 128), end - t);
    for (Approach::Person& person : a.persons) walk(arm, person.manner == Manner::kToRest ? rest : now, person, step);
    t = t + step >= end ? end : t + step;
  }
}

/// The greatest share of the speed by the same law for capsules around the links, with no bounds between 65 states.
/// \param age seconds since the poses of the persons
/// \param more metres that it keeps in addition
double capsule_scale(const ExactArm& arm, const Approach& a, double age, double more) {
  const auto is_free = [&](double scale) {
    Approach slower = a;
    slower.harder = 1;
    for (double& v : slower.v) v *= scale;
    const double end = standstill(slower);
    for (int k = 0; k <= 64; ++k) {
      const auto placed = arm.place(braking(slower, end * k / 64));
      for (const Approach::Person& person : a.persons)
        if (!(arm.distance(placed, person.at, true) - person.radius > person.speed * (end + age) + a.margin + more))
          return false;
    }
    return true;
  };
  return is_free(1) ? 1 : stop_check::greatest_scale(is_free);
}

Approach make(const ExactArm& arm, const std::array<double, 2>& radii, Random& random) {
  Approach a;
  for (std::size_t j = 0; j < arm.joints(); ++j) {
    a.q.push_back(between(random, -2, 2));
    a.v.push_back(between(random, -2, 2));
    a.deceleration.push_back(between(random, 2, 15));
  }
  a.reaction = between(random, 0, 1) < 0.1 ? 0 : between(random, 0.005, 0.3);
  a.margin = between(random, 0, 1) < 0.7 ? 0 : between(random, 0, 0.05);
  a.together = between(random, 0, 1) < 0.75;
  a.harder = a.together && between(random, 0, 1) < 0.5 ? between(random, 1, 4) : 1;
  const double until = between(random, 0.3, 1.5);
  a.step = until / (kMoments - 2);
  std::vector<double> met = a.q;
  for (std::size_t j = 0; j < met.size(); ++j) met[j] += until * a.v[j];
  const auto placed = arm.place(met);
  for (std::size_t i = 0; i < radii.size(); ++i) {
    Approach::Person& person = a.persons[i];
    person.radius = radii[i];
    person.speed = i == 1 && between(random, 0, 1) < 0.3 ? 0 : between(random, 0, 1.6);
    person.manner = static_cast<Manner>(std::uniform_int_distribution(0, 2)(random));
    const auto link = std::uniform_int_distribution<std::size_t>(0, arm.joints() - 1)(random);
    const Point away = direction(random);
    const double far = person.radius + until * person.speed * between(random, 0.2, 1.2) + between(random, 0, 0.1);
    person.at = arm.point_of(placed, link, random) + far * away;
    person.heading = -1.0 * away;
  }
  return a;
}

/// \param age set to a bound on the age of the poses, in seconds, as the engine counts it
/// \param compares whether `speed_scale` is searched if full speed is not proved, which takes ten queries
StopCheck check(World& world, const Approach& a, bool compares, double& age) {
  const auto begun = std::chrono::steady_clock::now();
  std::array<std::pair<std::uint32_t, Pose7>, 2> poses;
  std::array<Mover, 2> others;
  for (std::size_t i = 0; i < 2; ++i) {
    const Point& p = a.persons[i].at;
    poses[i] = {world.persons[i], {p[0], p[1], p[2], 1, 0, 0, 0}};
    others[i] = {world.persons[i], a.persons[i].speed};
  }
  world.engine.set_poses(poses);
  const Query state{.joints = world.joints.ids, .positions = a.q, .margin = a.margin, .velocities = a.v};
  const Braking law = a.law(others);
  StopCheck stop = compares ? check_stop(world.engine, state, law)
                            : stop_check::StopQueries(world.engine, state, law).at_full_speed();
  age = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return stop;
}

void compare(const ExactArm& arm, const Approach& a, double age, const StopCheck& stop, Findings& findings) {
  constexpr double kResolution = 1.5 / (1 << stop_check::kHalvings);  // of both searches
  const double capsules = capsule_scale(arm, a, age, 0);
  ++findings.compared;
  if (capsules > stop.speed_scale + kResolution) {
    ++findings.slower;
    findings.slower_still += capsule_scale(arm, a, age, kModelError) > stop.speed_scale + kResolution;
  }
  findings.speed += stop.speed_scale;
  findings.capsule_speed += capsules;
}

/// Drives at constant speed from moment to moment, and brakes from the last one that is proved.
void run(World& world, Approach a, Findings& findings) {
  std::optional<Approach> proved;
  for (int k = 0; k < kMoments; ++k) {
    double age = 0;
    const bool compares = proved && findings.approaches % kCompareEach == 0 && a.together;
    const StopCheck stop = check(world, a, compares, age);
    if (!stop.check.free) {
      if (compares) compare(world.arm, a, age, stop, findings);
      break;
    }
    proved = a;
    if (k + 1 == kMoments) return;  // nothing came near
    const auto placed = world.arm.place(a.q);
    for (Approach::Person& person : a.persons) walk(world.arm, placed, person, a.step);
    for (std::size_t j = 0; j < a.q.size(); ++j) a.q[j] += a.step * a.v[j];
  }
  if (!proved) return;
  const double least = brake(world.arm, *proved);
  ++findings.approaches;
  findings.contacts += least < -1e-12;
  findings.close += least < 0.01;
  findings.harder += proved->harder > 1;
  findings.apart += !proved->together;
  findings.least = std::min(findings.least, least);
}

}  // namespace

void Findings::add(const Findings& other) {
  approaches += other.approaches;
  contacts += other.contacts;
  close += other.close;
  harder += other.harder;
  apart += other.apart;
  compared += other.compared;
  slower += other.slower;
  slower_still += other.slower_still;
  least = std::min(least, other.least);
  speed += other.speed;
  capsule_speed += other.capsule_speed;
}

std::string Findings::text() const {
  std::ostringstream text;
  text << approaches << " approaches: " << contacts << " contacts, " << close << " within 10 mm, least " << least
       << " m; " << harder << " braked harder, " << apart << " joint by joint; of " << compared << " compared, "
       << slower << " slower than capsules, mean speed " << speed / static_cast<double>(compared) << " and "
       << capsule_speed / static_cast<double>(compared);
  return text.str();
}

Findings approach(std::uint64_t seed, std::int64_t count) {
  Random random(seed);
  const ExactArm arm(random);
  const std::array radii{between(random, 0.05, 0.3), between(random, 0.05, 0.3)};
  World world(arm, radii, seed % 2 == 1);
  if (seed % 2 == 1) world.engine.wait_covers();
  Findings findings;
  for (std::int64_t tries = 0; findings.approaches < count && tries < 20 * count; ++tries)
    run(world, make(arm, radii, random), findings);
  return findings;
}

}  // namespace clearance::stops
