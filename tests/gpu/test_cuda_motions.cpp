// Motions on a device, compared with the CPU's results. Skipped without a device.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>

#include "tests/engine/cuda/arm_edges.h"
#include "tests/engine/cuda/box_mesh.h"
#include "tests/engine/cuda/motion_comparison.h"
#include "tests/engine/cuda/same_answer.h"
#include "tests/gpu/skip_without_device.h"

namespace clearance::test {
namespace {

// A row for each of 20,000 edges.
void request_both(double margin, double size, bool when) {
  const ArmEdges edges(11, 20000, size);
  const engine::Engine device(engine::Scene(edges.scene), {.backend = "cuda"}),
      cpu(engine::Scene(edges.scene), {.backend = "cpu"});
  const QueryView q = edges.query(margin, when);
  const Answer found = evaluate(device, q), wanted = evaluate(cpu, q);
  ASSERT_EQ(found.info.backend, "cuda");
  const MotionComparison v = compare_motions(found, wanted, q);
  EXPECT_GT(v.free, 500);
  EXPECT_GT(v.hits, 500);
  const auto on_cpu = counter(device, "cuda.motions_finished_on_cpu");
  std::printf("margin %g, size %g, first contact %d: %d free, %d hit, %d undecided, %llu finished by the CPU\n", margin,
              size, when, v.free, v.hits, v.undecided, static_cast<unsigned long long>(on_cpu));
  EXPECT_LT(on_cpu, 4000u);
}

TEST(CudaMotions, HaveTheCpusVerdicts) {
  SKIP_WITHOUT_DEVICE();
  for (const double margin : {0.0, 0.02})
    for (const double size : {0.2, 1.5})
      for (const bool when : {false, true}) request_both(margin, size, when);
}

// Whether the bits are the same each time: those of the device, and of the CPU where it finishes a motion.
bool is_same(const Answer& p, const Answer& q) {
  const auto same = [&](const auto* a, const auto* b, std::size_t count) {
    return std::memcmp(a, b, count * sizeof *a) == 0;
  };
  const std::size_t n = p.info.rows;
  return same(p.view.lower, q.view.lower, n) && same(p.view.upper, q.view.upper, n) &&
         same(p.view.time, q.view.time, n) && same(p.view.pair, q.view.pair, n) &&
         same(p.view.point_a, q.view.point_a, 3 * n) && same(p.view.steps, q.view.steps, n) &&
         (!p.view.first_contact || same(p.view.first_contact, q.view.first_contact, 2 * n));
}

TEST(CudaMotions, FindLeastDistances) {
  SKIP_WITHOUT_DEVICE();
  for (const double margin : {0.0, 0.02})
    for (const double size : {0.2, 1.5})
      for (const bool when : {false, true}) {
        const ArmEdges edges(13, 20000, size);
        const engine::Engine device(engine::Scene(edges.scene), {.backend = "cuda"}),
            cpu(engine::Scene(edges.scene), {.backend = "cpu"});
        const QueryView q = edges.least(margin, when);
        const Answer found = evaluate(device, q), wanted = evaluate(cpu, q);
        ASSERT_EQ(found.info.backend, "cuda");
        const auto on_cpu = counter(device, "cuda.motions_finished_on_cpu");
        const LeastRows v = compare_least(found, wanted, q);
        std::printf(
            "margin %g, size %g, first contact %d: %d apart, %d touch, %d undecided, %llu finished by the CPU\n",
            margin, size, when, v.apart, v.touching, v.undecided, static_cast<unsigned long long>(on_cpu));
        EXPECT_GT(v.apart, 500);
        EXPECT_GT(v.touching, 500);
        EXPECT_LT(on_cpu, 4000u);
        EXPECT_TRUE(is_same(found, evaluate(device, q)));
      }
}

// A search that ends early reports no unproved part as free, and no proved part as contact.
TEST(CudaMotions, OutOfStepsIsNeverFree) {
  SKIP_WITHOUT_DEVICE();
  const ArmEdges edges(17, 3000, 1.0);
  const engine::Engine device(engine::Scene(edges.scene), {.backend = "cuda"}),
      cpu(engine::Scene(edges.scene), {.backend = "cpu"});
  const Answer exact_value = evaluate(cpu, edges.query(0, true));
  int free = 0, hits = 0, unconverged = 0, narrow = 0;
  for (std::uint32_t steps = 1; steps <= 256; steps = steps < 8 ? steps + 1 : 2 * steps)
    for (const double abs_tol : {0.0, 1e-3}) {
      QueryView query = edges.query(0, true);
      query.max_evaluations = steps;
      query.abs_tol = abs_tol;
      const Answer any = evaluate(device, query);
      query = edges.least(0, true);
      query.max_evaluations = steps;
      const Answer least = evaluate(device, query);
      ASSERT_EQ(any.info.backend, "cuda");
      for (std::uint64_t i = 0; i < any.info.rows; ++i) {
        const auto status = static_cast<Status>(any.view.status[i]);
        ASSERT_EQ(status == Status::kBeyond, any.view.first_contact[2 * i] == kInf) << i << " " << steps;
        if (status == Status::kBeyond) {
          ASSERT_GT(static_cast<Status>(exact_value.view.status[i]), Status::kContact) << i << " " << steps;
        }
        free += status == Status::kBeyond;
        hits += status <= Status::kContact;
        unconverged += status == Status::kUnconverged;
        if (least.view.first_contact[2 * i] != kInf) continue;
        ASSERT_NE(static_cast<Status>(least.view.status[i]), Status::kContact) << i << " " << steps;
        ASSERT_GT(least.view.lower[i], 0) << i << " " << steps;
        narrow += least.view.upper[i] < 1e-3;
      }
    }
  std::printf("%d free, %d hit, %d unconverged, %d free by less than 1 mm\n", free, hits, unconverged, narrow);
  EXPECT_GT(free, 500);
  EXPECT_GT(hits, 500);
  EXPECT_GT(unconverged, 500);
  EXPECT_GT(narrow, 0);
}

TEST(CudaMotions, FlagEndsBeyondLimits) {
  SKIP_WITHOUT_DEVICE();
  ArmEdges edges(12, 4000, 0.8);
  edges.end_beyond_limits();
  const engine::Engine device(engine::Scene(edges.scene), {.backend = "cuda"}),
      cpu(engine::Scene(edges.scene), {.backend = "cpu"});
  const QueryView q = edges.query(0, true);
  const Answer found = evaluate(device, q), wanted = evaluate(cpu, q);
  ASSERT_EQ(found.info.backend, "cuda");
  EXPECT_GT(compare_motions(found, wanted, q).beyond_limits, 100);
  EXPECT_LT(counter(device, "cuda.motions_finished_on_cpu"), 400u);
  const QueryView least = edges.least(0, true);
  const Answer nearest = evaluate(device, least);
  ASSERT_EQ(nearest.info.backend, "cuda");
  EXPECT_GT(compare_least(nearest, evaluate(cpu, least), least).hits, 100);
}

// Its kernels support hulls only.
TEST(CudaMotions, LeaveMeshesToTheCpu) {
  SKIP_WITHOUT_DEVICE();
  ArmEdges edges(13, 200, 0.8);
  BoxMesh board;
  board.add_box({0.5, 0, 0.4}, {0.3, 0.02, 0.3}, 3, false);
  edges.scene.add_mesh("board", board.vertices, board.triangles, MeshAs::kSolid, {.is_static = true, .pose = Pose()});
  edges.motions.pairs = {{edges.scene.find_body("tool"), edges.scene.find_body("board")}};
  const engine::Engine device(engine::Scene(edges.scene), {.backend = "cuda"}),
      cpu(engine::Scene(edges.scene), {.backend = "cpu"});
  const QueryView q = edges.query(0, true);
  const MotionComparison v = compare_motions(evaluate(device, q), evaluate(cpu, q), q);
  EXPECT_GT(v.free, 20);
  EXPECT_GT(v.hits, 5);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 1u);
}

}  // namespace
}  // namespace clearance::test
