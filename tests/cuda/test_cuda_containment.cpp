// A million pairs on the device, dense and reduced, against intervals that the oracle proves for the same pairs: brute force in
// double-double, wider than the exact distance by its own rounding alone (some 1e-28 of the bodies' size).
#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "same_answer.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kBodies = 48, kBatch = 100;

Scene bodies_of_all_kinds() {
  Random random(31);
  Scene scene;
  for (std::uint32_t i = 0; i < kBodies; ++i) {
    const std::string name = "b" + std::to_string(i);
    switch (i % 6) {
      case 0: scene.add_box(name, {random.uniform(0.2, 1), random.uniform(0.2, 1), random.uniform(0.2, 1)}, {}); break;
      case 1: scene.add_capsule(name, 0.2, 0.5, {}); break;
      case 2: scene.add_uv_sphere(name, 0.4, 5, {}); break;
      case 3: scene.add_hull(name, cloud_on_sphere(120, 0.5, i), {}); break;
      case 4: scene.add_hull(name, random.cloud(20, {0.5, 0.5, 0.01}), {}); break;
      default: scene.add_hull(name, random.cloud(6, {0.4, 0.4, 0.4}), {});
    }
  }
  return scene;
}

// Most poses are anywhere in a box; of some, bodies stand square to each other at round places, so that faces and edges lie
// side by side and touch exactly.
std::vector<Pose> poses_of(Random& random) {
  std::vector<Pose> poses;
  for (std::uint32_t k = 0; k < kBatch; ++k)
    for (std::uint32_t i = 0; i < kBodies; ++i) {
      Pose p = random.pose(k % 2 == 0 ? 2.5 : 1.2);
      if (k % 10 == 9) {
        p = {{std::round(4 * p.translation.x) / 4, std::round(4 * p.translation.y) / 4, std::round(4 * p.translation.z) / 4}};
        if (i % 2) p.qw = p.qx = 0.5, p.qy = p.qz = 0.5;
      }
      poses.push_back(p);
    }
  return poses;
}

TEST(CudaContainment, OfAMillionPairsTheExactDistanceIsInTheInterval) {
  SKIP_WITHOUT_DEVICE();
  const char* wanted = std::getenv("CLEARANCE_CONTAINMENT_PAIRS");
  const std::uint64_t pairs_wanted = wanted ? std::strtoull(wanted, nullptr, 10) : 1'000'000;
  const Engine device(bodies_of_all_kinds(), {"cuda"}), oracle(bodies_of_all_kinds(), {"reference"});
  std::vector<std::uint32_t> bodies(kBodies);
  std::iota(bodies.begin(), bodies.end(), 0u);
  Random random(32);
  QueryView q;
  q.bodies = bodies;
  q.configuration_count = kBatch;
  q.fields = kDefaultFields;
  std::uint64_t pairs = 0, apart = 0, near = 0, overlapping = 0, outside = 0;
  while (pairs < pairs_wanted) {
    const std::vector<Pose> poses = poses_of(random);
    q.configurations = poses;
    q.reduce = Reduce::kNone;
    const Answer truth = ask(oracle, q);
    const auto hold = [&](std::uint64_t row, double lower, double upper, const char* what) {
      const double exact_low = truth.view.lower[row], exact_high = truth.view.upper[row];
      if (lower <= exact_low && exact_high <= upper) return;
      // Where the answer is double-double's, too, neither needs to hold the other.
      const bool as_fine = upper - lower <= 8 * (exact_high - exact_low);
      if (as_fine && lower <= exact_high && exact_low <= upper) return;
      if (++outside <= 5)
        ADD_FAILURE() << what << ": [" << lower << ", " << upper << "] does not hold [" << exact_low << ", " << exact_high << ']';
    };
    for (const std::uint64_t warm : {0, 1, 1}) {  // the second warm query begins where the first has ended
      q.warm_slot = warm;
      const Answer answer = ask(device, q);
      ASSERT_EQ(answer.info.backend, "cuda");
      for (std::uint64_t i = 0; i < answer.size.rows; ++i) {
        ASSERT_TRUE(answer.view.lower[i] <= answer.view.upper[i]);
        hold(i, answer.view.lower[i], answer.view.upper[i], warm ? "warm" : "cold");
      }
    }
    q.warm_slot = 0;
    for (std::uint64_t i = 0; i < truth.size.rows; ++i) {
      const double upper = truth.view.upper[i];
      overlapping += !(upper > 0);
      apart += truth.view.lower[i] > 0;
      near += truth.view.lower[i] > 0 && upper < 1e-2;
    }
    pairs += truth.size.rows;

    q.reduce = Reduce::kMin;
    const Answer least = ask(device, q);
    ASSERT_EQ(least.info.backend, "cuda");
    const std::uint64_t P = truth.size.rows / kBatch;
    for (std::uint64_t k = 0; k < kBatch; ++k) {
      const auto row = std::min_element(truth.view.upper + k * P, truth.view.upper + (k + 1) * P) - truth.view.upper;
      hold(static_cast<std::uint64_t>(row), least.view.lower[k], least.view.upper[k], "least");
    }
  }
  EXPECT_EQ(outside, 0u);
  EXPECT_GT(apart, pairs / 4);
  EXPECT_GT(overlapping, pairs / 50);
  EXPECT_GT(near, pairs / 1000);
  std::printf("%zu pairs: %zu apart, %zu of them by less than 0.01, %zu overlapping\n", std::size_t{pairs}, std::size_t{apart},
              std::size_t{near}, std::size_t{overlapping});
}

}  // namespace
}  // namespace clearance::test
