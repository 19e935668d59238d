// Warm-started reductions: their intervals intersect those of a cold start.
#include <algorithm>
#include <limits>

#include "tests/engine/cuda/reduced_scene.h"
#include "tests/engine/cuda/same_answer.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// A trajectory of half of a scene's bodies, with or without space for most of them to be apart.
struct Trajectory {
  static constexpr std::uint32_t kConfigurations = 200;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose> poses;
  QueryView q;

  Trajectory(const Scene& scene, double room) {
    Random random(21);
    for (std::uint32_t b = 0; b < scene.bodies().size(); b += 2)
      if (!scene.bodies()[b].is_static) bodies.push_back(b);
    for (std::size_t i = 0; i < kConfigurations * bodies.size(); ++i) poses.push_back(random.pose(room));
  }
  void step(Random& random) {
    for (Pose& p : poses) {
      p.translation = p.translation + Vec3d{random.normal(), random.normal(), random.normal()} * 0.003;
      p.qw += 0.005 * random.normal();
      p.qz += 0.005 * random.normal();
    }
  }
  const QueryView& evaluate_for(Reduce reduce, std::uint64_t client) {
    q.reduce = reduce;
    q.max_distance = reduce == Reduce::kWithin ? 0.4 : kInf;
    q.fields = kAllFields;
    q.bodies = bodies;
    q.configurations = poses;
    q.configuration_count = kConfigurations;
    q.warm_slot = client;
    return q;
  }
};

struct Compared {
  std::uint64_t rows = 0, different = 0;  // in their bits
};

// Rows of the same query, cold and warm: their intervals intersect.
Compared expect_to_meet(const Answer& warm, const Answer& cold, const std::string& what) {
  Compared c;
  EXPECT_EQ(warm.info.rows, cold.info.rows) << what;
  for (std::uint64_t i = 0; i < std::min(warm.info.rows, cold.info.rows); ++i, ++c.rows) {
    const auto &a = warm.view, &b = cold.view;
    EXPECT_TRUE(a.lower[i] <= b.upper[i] && b.lower[i] <= a.upper[i])
        << what << ", row " << i << ": [" << a.lower[i] << ", " << a.upper[i] << "] and [" << b.lower[i] << ", "
        << b.upper[i] << ']';
    EXPECT_EQ(a.status[i], b.status[i]) << what << ", row " << i;
    EXPECT_EQ(a.configuration[i], b.configuration[i]) << what << ", row " << i;
    c.different += !same_bits(a.distance[i], b.distance[i]) || !same_bits(a.point_a[3 * i], b.point_a[3 * i]);
  }
  return c;
}

class CudaWarm : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

TEST_F(CudaWarm, BeginsAlongATrajectory) {
  for (const double room : {1.5, 6.0})
    for (const Precision precision : {Precision::kF64, Precision::kF32}) {
      const Engine device(simple_scene(40, 2, 3), {"cuda"}), cpu(simple_scene(40, 2, 3), {"cpu"});
      for (const Reduce reduce : kReductions) {
        const std::string what = "room " + std::to_string(room) + ", reduction " + std::to_string(int(reduce));
        Trajectory t(device.scene(), room);
        t.q.precision = precision;
        Random random(22);
        const auto client = 1 + static_cast<std::uint64_t>(reduce);  // each with its own state
        Compared sum;
        std::uint64_t allocations = 0;
        for (int i = 0; i < 6; ++i) {
          const Answer cold = evaluate(cpu, t.evaluate_for(reduce, 0));
          expect_same(evaluate(device, t.evaluate_for(reduce, 0)), cold, what + ", cold", true);
          const Answer warm = evaluate(device, t.evaluate_for(reduce, client));
          ASSERT_EQ(warm.info.backend, "cuda");
          if (i == 0 && precision == Precision::kF64) {  // float64 starts where float32 ended
            expect_same(warm, cold, what + ", nothing to begin from", true);
          } else {
            const Compared c = expect_to_meet(warm, cold, what + ", step " + std::to_string(i));
            sum = {sum.rows + c.rows, sum.different + c.different};
          }
          if (i == 2) allocations = counter(device, "cuda.allocations");
          if (i < 5) t.step(random);
        }
        EXPECT_EQ(counter(device, "cuda.allocations"), allocations) << what;
        // A different start shows in the last bits.
        EXPECT_GT(sum.rows, 500u) << what;
        EXPECT_GT(sum.different, 10u) << what;
        // With all bodies elsewhere.
        std::reverse(t.poses.begin(), t.poses.end());
        expect_to_meet(evaluate(device, t.evaluate_for(reduce, client)), evaluate(cpu, t.evaluate_for(reduce, 0)),
                       what + ", elsewhere");
      }
      EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
    }
}

TEST_F(CudaWarm, BeginsWhereBodiesStand) {
  for (const double room : {2.0, 12.0}) {
    Engine device(simple_scene(300, room, 3), {"cuda"}), cpu(simple_scene(300, room, 3), {"cpu"});
    Random random(23);
    std::vector<BodyPose> poses;
    for (std::uint32_t b = 0; b < 300; ++b)
      if (b % 7 != 3) poses.push_back({b, random.pose(room)});
    for (const Reduce reduce : kReductions) {
      QueryView q;
      q.reduce = reduce;
      q.fields = kAllFields;
      if (reduce == Reduce::kWithin) q.max_distance = 0.5;
      Compared sum;
      for (int i = 0; i < 5; ++i) {
        for (BodyPose& p : poses) {
          p.pose.translation = p.pose.translation + Vec3d{random.normal(), random.normal(), random.normal()} * 0.003;
          p.pose.qx += 0.005 * random.normal();
        }
        for (Engine* e : {&device, &cpu}) e->set_poses(poses);
        q.warm_slot = 0;
        const Answer cold = evaluate(cpu, q);
        const std::string what = "room " + std::to_string(room) + ", reduction " + std::to_string(int(reduce)) +
                                 ", step " + std::to_string(i);
        expect_same(evaluate(device, q), cold, what + ", cold", true);
        q.warm_slot = 1 + static_cast<std::uint64_t>(reduce);
        const Answer warm = evaluate(device, q);
        ASSERT_EQ(warm.info.backend, "cuda");
        const Compared c = expect_to_meet(warm, cold, what);
        if (i == 0) {
          expect_same(warm, cold, what, true);
        } else {
          sum = {sum.rows + c.rows, sum.different + c.different};
        }
      }
      if (reduce != Reduce::kMin) {
        EXPECT_GT(sum.different, sum.rows / 100) << room << ' ' << int(reduce);
      }
    }
  }
}

}  // namespace
}  // namespace clearance::test
