// Motions on a device: the CPU's verdicts. Skips without one.
#include <gtest/gtest.h>

#include <cstdio>

#include "arm_edges.h"
#include "same_answer.h"
#include "skip_without_device.h"

namespace clearance::test {
namespace {

TEST(CudaMotions, HaveTheCpusVerdicts) {
  SKIP_WITHOUT_DEVICE();
  for (const double margin : {0.0, 0.02}) {
    for (const double size : {0.2, 1.5}) {
      const ArmEdges edges(11, 20000, size);
      const Engine device(Scene(edges.scene), {.backend = "cuda"}), cpu(Scene(edges.scene), {.backend = "cpu"});
      const QueryView q = edges.query(margin);
      const Answer found = ask(device, q), wanted = ask(cpu, q);
      ASSERT_EQ(found.info.backend, "cuda");
      int free = 0, hits = 0, undecided = 0;
      for (std::uint32_t i = 0; i < edges.motions.count(); ++i) {
        const auto ours = static_cast<Status>(found.view.status[i]),
                   theirs = static_cast<Status>(wanted.view.status[i]);
        EXPECT_LE(found.view.lower[i], found.view.upper[i]);
        undecided += ours == Status::kUnconverged;
        if (theirs == Status::kUnconverged || ours == Status::kUnconverged) continue;
        EXPECT_EQ(ours == Status::kBeyond, theirs == Status::kBeyond) << i;
        (ours == Status::kBeyond ? free : hits) += 1;
        EXPECT_TRUE(ours == Status::kBeyond || found.view.upper[i] <= margin) << i;
      }
      EXPECT_GT(free, 500);
      EXPECT_GT(hits, 500);
      const auto on_cpu = counter(device, "cuda.motions_finished_on_cpu");
      std::printf("margin %g, size %g: %d free, %d hit, %d undecided, %llu finished by the CPU\n", margin, size, free,
                  hits, undecided, static_cast<unsigned long long>(on_cpu));
      EXPECT_LT(on_cpu, 4000u);
    }
  }
}

}  // namespace
}  // namespace clearance::test
