// check_stop(): a cart before a wall and persons, in closed form.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <string>
#include <thread>

#include "engine/api/engine.h"
#include "planner/stop_check.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

constexpr double kStep = 1.0 / (1 << stop_check::kHalvings);
constexpr double kWall = 2;  // metres from the cart

/// A ball of 0.1 m that slides along x and y, a wall, and persons, all of them balls.
struct Yard {
  Engine engine{scene(), {.backend = "cpu", .threads = 1}};
  Joints joints = engine.joints("r");
  std::uint32_t person = engine.body("person"), hand = engine.body("hand"), cart = engine.body("r/cart");
  std::array<IdPair, 2> with_persons{IdPair{cart, person}, IdPair{cart, hand}};

  static Scene scene() {
    const TemporaryFolder folder;
    const std::string slide = "<limit lower='-99' upper='99' effort='1' velocity='1'/></joint>";
    const std::string urdf = folder.write(
        "r.urdf",
        "<robot name='r'><link name='base'/><link name='post'/><link name='cart'><collision><geometry>"
        "<sphere radius='0.1'/></geometry></collision></link><joint name='x' type='prismatic'><parent link='base'/>"
        "<child link='post'/><axis xyz='1 0 0'/>" +
            slide + "<joint name='y' type='prismatic'><parent link='post'/><child link='cart'/><axis xyz='0 1 0'/>" +
            slide + "</robot>");
    Scene scene;
    scene.add_robot("r", {.urdf = urdf, .home = std::map<std::string, double>{}});
    scene.add_sphere("wall", 0.1, {.is_static = true, .X_parent_body = Pose7{kWall + 0.2, 0, 0, 1, 0, 0, 0}});
    scene.add_sphere("person", 0.1);
    scene.add_sphere("hand", 0.1, {.parent = "person", .X_parent_body = Pose7{0, 0, 0, 1, 0, 0, 0}});
    scene.add_group("people", std::array<std::string, 2>{"person", "hand"});
    return scene;
  }

  void put(double x, double y) {
    engine.set_poses({{"person", {x, y, 0, 1, 0, 0, 0}}, {"hand", {0, 0, 0, 1, 0, 0, 0}}});
  }
  StopCheck stop(std::array<double, 2> v, const Braking& law, std::span<const IdPair> pairs = {}, double margin = 0) {
    const std::array<double, 2> q{};
    return check_stop(engine, {.pairs = pairs, .joints = joints.ids, .positions = q, .margin = margin, .velocities = v},
                      law);
  }
};

/// The share s with s v reaction + (s v)^2 / (2 a) = free_way.
double greatest(double free_way, double reaction, double v, double a) {
  return a / v * (std::sqrt(reaction * reaction + 2 * free_way / a) - reaction);
}

TEST(StopCheck, StopsBeforeAWall) {
  Yard yard;
  yard.put(0, 50);
  for (const auto& [v, a, reaction] :
       {std::array{2.0, 1.0, 0.5}, {3.0, 2.0, 0.0}, {5.0, 20.0, 0.1}, {1.0, 1.0, 4.0}, {2.0, 1.0, 0.25}}) {
    const std::array brakes{a, 9.0};
    for (const bool together : {true, false}) {
      const double share = greatest(kWall, reaction, v, a), margin = 0.25;
      const StopCheck stop = yard.stop({v, 0}, {brakes, reaction, {}, together});
      EXPECT_NEAR(stop.seconds, reaction + v / a, 1e-12);
      EXPECT_EQ(stop.check.free, share > 1);
      EXPECT_LE(stop.speed_scale, share);
      EXPECT_GE(stop.speed_scale, std::min(share, 1.0) - kStep);
      EXPECT_NEAR(stop.path[stop.path.size() - 2], v * reaction + v * v / (2 * a), 1e-12);
      const double kept = yard.stop({v, 0}, {brakes, reaction, {}, together}, {}, margin).speed_scale,
                   less = std::min(greatest(kWall - margin, reaction, v, a), 1.0);
      EXPECT_TRUE(less - kStep <= kept && kept <= less) << kept << ' ' << less;
    }
  }
}

TEST(StopCheck, FollowsJointsThatStopByThemselves) {
  Yard yard;
  yard.put(0, 50);
  // Braking for 2 s along x and 0.25 s along y begins at (0.4, 0.8).
  const std::array brakes{0.5, 8.0};
  const StopCheck stop = yard.stop({1, -2}, {brakes, 0.4, {}, false});
  const std::array<double, 18> expected{0,        0,     0.2,   -0.4,  0.4,      -0.8,    // the reaction
                                        0.4,      -0.8,  0.525, -1.05, 0.634375, -1.05,   // until y stops
                                        0.634375, -1.05, 1.4,   -1.05, 1.4,      -1.05};  // until x stops
  ASSERT_EQ(stop.control_points, 3u);
  ASSERT_EQ(stop.path.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(stop.path[i], expected[i], 1e-12) << i;
}

TEST(StopCheck, OthersReachAsFarAsTheyCan) {
  Yard yard;
  const std::array brakes{0.5, 0.5};
  const std::array<Mover, 1> slow{Mover{yard.person, 0.01}}, fast{Mover{yard.person, 0.9}};
  yard.put(3, 0);  // the cart stops at 1 m after 2 s, and 1.8 m are left
  EXPECT_TRUE(yard.stop({1, 0}, {brakes, 0, slow}, yard.with_persons).check.free);
  const auto scale = [](double age) { return -0.9 + std::sqrt(0.81 + std::max(2.8 - 0.9 * age, 0.0)); };
  const auto begun = std::chrono::steady_clock::now();
  yard.put(3, 0);
  const StopCheck stop = yard.stop({1, 0}, {brakes, 0, fast}, yard.with_persons);
  const double age = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  EXPECT_FALSE(stop.check.free);
  EXPECT_LE(stop.speed_scale, scale(0));
  EXPECT_GE(stop.speed_scale, scale(age) - kStep);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_LE(yard.stop({1, 0}, {brakes, 0, fast}, yard.with_persons).speed_scale, scale(0.1));
  // A person who reaches the cart at rest before its brakes act.
  yard.put(0, 0.5);
  const std::array<Mover, 1> there{Mover{yard.person, 0.4}};
  EXPECT_EQ(yard.stop({1, 0}, {brakes, 1, there}, yard.with_persons).speed_scale, 0);
}

TEST(StopCheck, KeepsItsMarginFromAll) {
  Yard yard;
  yard.put(3, 0);
  const std::array brakes{0.5, 0.5};
  const std::array<Mover, 1> still{Mover{yard.person, 0}};
  const double margin = 0.5;
  const auto expect_near = [](double found, double exact) {
    EXPECT_TRUE(exact - kStep <= found && found <= exact) << found << ' ' << exact;
  };
  expect_near(yard.stop({4, 0}, {brakes, 0.1, still}, {}, margin).speed_scale, greatest(kWall - margin, 0.1, 4, 0.5));
  expect_near(yard.stop({4, 0}, {brakes, 0.1, still}, yard.with_persons, margin).speed_scale,
              greatest(2.8 - margin, 0.1, 4, 0.5));
}

TEST(StopCheck, FollowersMoveWithThoseTheyFollow) {
  Yard yard;
  yard.put(0, 0.6);  // both are 0.4 m from the cart, which stops after 10 s: ages hardly matter
  const std::array brakes{0.01, 0.01};
  const std::array<IdPair, 1> of_hand{IdPair{yard.cart, yard.hand}};
  const auto free = [&](std::uint32_t body, double speed) {
    const std::array<Mover, 1> others{Mover{body, speed}};
    return yard.stop({0.1, 0}, {brakes, 0, others}, of_hand).check.free;
  };
  EXPECT_TRUE(free(yard.person, 0.021));
  EXPECT_TRUE(free(yard.hand, 0.021));
  EXPECT_FALSE(free(yard.person, 0.045));
  EXPECT_FALSE(free(yard.engine.group("people"), 0.021)) << "its own movement, and that of the person";
}

TEST(StopCheck, CountsBothOfTwoThatMove) {
  Yard yard;
  yard.engine.add_body({.name = "other", .sphere = 0.1});
  yard.put(0, 5);
  yard.engine.set_poses({{"other", {1, 5, 0, 1, 0, 0, 0}}});  // 0.8 m from the person
  const std::uint32_t other = yard.engine.body("other");
  const std::array brakes{0.01, 0.01};
  const auto free = [&](IdPair pair, std::span<const Mover> others) {  // the cart stops after 10 s
    return yard.stop({0.1, 0}, {brakes, 0, others}, std::span(&pair, 1)).check.free;
  };
  const std::array both{Mover{yard.person, 0.05}, Mover{other, 0.05}};
  EXPECT_TRUE(free({yard.person, other}, std::span(both).first(1)));
  EXPECT_TRUE(free({yard.person, other}, std::span(both).last(1)));
  EXPECT_FALSE(free({yard.person, other}, both));
  yard.engine.set_poses({{"hand", {0.5, 0, 0, 1, 0, 0, 0}}});
  EXPECT_TRUE(free({yard.person, yard.hand}, std::span(both).first(1))) << "the person moves both";
}

TEST(StopCheck, RejectsWhatDoesNotFit) {
  Yard yard;
  const std::array brakes{1.0, 1.0}, none{1.0, 0.0};
  const auto text = [&](const Braking& law, double v = 1) -> std::string {
    try {
      yard.stop({v, 0}, law);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "nothing was thrown";
  };
  const std::array<Mover, 1> person{Mover{yard.person, 1}}, back{Mover{yard.person, -1}}, unknown{Mover{99, 1}},
      every{Mover{kEveryBody, 1}};
  EXPECT_EQ(text({none}), "check_stop: deceleration: expected finite numbers above 0");
  EXPECT_EQ(text({std::span(brakes).first(1)}), "check_stop: deceleration: expected one for each joint");
  EXPECT_EQ(text({brakes, -1}), "check_stop: reaction_s: expected a finite number >= 0");
  EXPECT_EQ(text({brakes}, std::nan("")), "check_stop: velocities: expected finite numbers");
  EXPECT_EQ(text({brakes, 0, person}), "check_stop: others: no pose of 'person' has been received");
  EXPECT_EQ(text({brakes, 0, back}), "check_stop: others: expected speeds >= 0, got -1.000000");
  EXPECT_EQ(text({brakes, 0, unknown}), "check_stop: others: no body or group has the id 99");
  EXPECT_EQ(text({brakes, 0, every}), "check_stop: others: no body or group has the id 4294967295");
}

}  // namespace
}  // namespace clearance
