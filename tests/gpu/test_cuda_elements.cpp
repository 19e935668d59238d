// Clouds and meshes on a device: intervals that agree with the CPU's, for the current points.
#include <array>

#include "tests/engine/cuda/mesh_case.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

class CudaElements : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

bool is_within(std::uint8_t status) {
  const auto s = static_cast<Status>(status);
  return s == Status::kOk || s == Status::kOverlap || s == Status::kContact;
}

struct Found {
  std::uint64_t apart = 0, overlap = 0, beyond = 0, rows = 0;
};

// Runs a query on both. Intervals are as narrow as requested and contain the same distance, and decisions do not
// contradict each other.
// \param share of the pairs that may be left to the CPU
void compare(const engine::Engine& device, const engine::Engine& cpu, const QueryView& q, const std::string& what,
             Found& found, double share = 0.05) {
  const std::uint64_t before = counter(device, "cuda.pairs_finished_on_cpu");
  const Answer rows = evaluate(device, q), expected = evaluate(cpu, q);
  EXPECT_LE(static_cast<double>(counter(device, "cuda.pairs_finished_on_cpu") - before),
            share * static_cast<double>(q.configuration_count * q.pairs.size()))
      << what << ", precision " << static_cast<int>(q.precision) << ": left to the CPU";
  EXPECT_EQ(rows.info.backend, "cuda") << what;
  ASSERT_EQ(rows.info.rows, expected.info.rows) << what;
  const ReplyView &a = rows.view, &b = expected.view;
  for (std::uint64_t i = 0; i < rows.info.rows; ++i, ++found.rows) {
    const auto status = static_cast<Status>(a.status[i]);
    found.apart += status == Status::kOk;
    found.overlap += status == Status::kOverlap;
    found.beyond += status == Status::kBeyond;
    EXPECT_EQ(std::isnan(a.distance[i]), std::isnan(b.distance[i])) << what << ", row " << i;
    EXPECT_LE(a.lower[i], a.upper[i]) << what << ", row " << i;
    if (q.reduce == Reduce::kAny) {
      EXPECT_FALSE(status == Status::kBeyond && is_within(b.status[i])) << what << ", row " << i;
      EXPECT_FALSE(static_cast<Status>(b.status[i]) == Status::kBeyond && is_within(a.status[i]))
          << what << ", row " << i;
    } else if (!std::isnan(a.distance[i])) {
      EXPECT_TRUE(a.lower[i] <= b.upper[i] && b.lower[i] <= a.upper[i])
          << what << ", row " << i << ": [" << a.lower[i] << ", " << a.upper[i] << "] and [" << b.lower[i] << ", "
          << b.upper[i] << "]";
      if (status == Status::kOk) {
        EXPECT_LE(a.upper[i] - a.lower[i], tolerance_at(a.upper[i], q.abs_tol, default_rel_tol(q.precision)));
      }
    }
  }
}

TEST_F(CudaElements, HoldWhatTheCpuHolds) {
  for (const ElementKind kind : {ElementKind::kPoints, ElementKind::kGrown, ElementKind::kVoxels, ElementKind::kSurface,
                                 ElementKind::kSolid, ElementKind::kGrownSolid})
    for (const std::size_t size :
         is_mesh(kind) ? std::array<std::size_t, 3>{1, 4, 40} : std::array<std::size_t, 3>{1, 30, 20000}) {
      Found least, any;
      std::uint64_t converged = 0, left = 0;
      for (const double room : {0.6, 1.2, 3.0}) {
        ElementCase c(kind, size, room, 400, 3, room == 1.2, 0.05, room == 0.6);
        c.poses[7].translation.y = std::numeric_limits<double>::quiet_NaN();
        const engine::Engine cpu(c.scene, {.backend = "cpu", .covers = engine::Covers::kOff}),
            device(std::move(c.scene), {"cuda"});
        const std::string name = "size " + std::to_string(size) + ", kind " + std::to_string(static_cast<int>(kind)) +
                                 ", room " + std::to_string(room);
        for (const Precision precision : {Precision::kF64, Precision::kF32}) {
          c.q.precision = precision;
          for (const double distance : {kInf, 0.1}) {
            c.q.max_distance = distance;
            for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest, Reduce::kWithin}) {
              c.q.reduce = reduce;
              compare(device, cpu, c.q, name + ", reduce " + std::to_string(static_cast<int>(reduce)), least);
            }
          }
          c.q.max_distance = kInf;
          c.q.reduce = Reduce::kAny;
          for (const double margin : {0.0, 0.02, 0.3}) {
            c.q.margin = margin;
            compare(device, cpu, c.q, name + ", margin " + std::to_string(margin), any);
          }
          c.q.margin = 0;
        }
        converged += counter(device, "cuda.pairs_converged");
        left += counter(device, "cuda.pairs_finished_on_cpu");
        EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u) << name;
      }
      EXPECT_GT(least.apart, 100u);
      EXPECT_GT(any.beyond, 100u);
      if (size > 1 || is_mesh(kind)) {
        EXPECT_GT(least.overlap, 30u);
        EXPECT_GT(any.overlap, 30u);
      }
      EXPECT_GT(converged, 2000u);
      EXPECT_LT(left, converged / 20) << "kind " << static_cast<int>(kind) << ", size " << size;
    }
}

// Meshes with meshes; the same among pairs that are left to the CPU one by one.
TEST_F(CudaElements, HoldWhatTheCpuHoldsOfMeshes) {
  for (const bool all : {false, true}) {
    Found least, any;
    for (const double room : {0.6, 1.5}) {
      MeshCase c(300, room, 5);
      c.request_about(all ? c.pairs_of_all() : c.pairs_of_meshes());
      const engine::Engine cpu(c.scene, {.backend = "cpu", .covers = engine::Covers::kOff}),
          device(std::move(c.scene), {"cuda"});
      const std::string name = std::string(all ? "all" : "meshes") + ", room " + std::to_string(room);
      for (const double distance : {kInf, 0.1})
        for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest, Reduce::kWithin}) {
          c.q.max_distance = distance;
          c.q.reduce = reduce;
          compare(device, cpu, c.q, name + ", reduce " + std::to_string(static_cast<int>(reduce)), least,
                  all ? 0.61 : 0.05);
        }
      c.q.max_distance = kInf;
      c.q.reduce = Reduce::kAny;
      for (const double margin : {0.0, 0.02, 0.3}) {
        c.q.margin = margin;
        compare(device, cpu, c.q, name + ", margin " + std::to_string(margin), any, all ? 0.61 : 0.05);
      }
      EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u) << name;
      EXPECT_GT(counter(device, "cuda.pairs_converged"), 2000u) << name;
    }
    EXPECT_GT(least.apart, 500u);
    EXPECT_GT(least.overlap, 100u);
    EXPECT_GT(any.overlap, 100u);
    EXPECT_GT(any.beyond, all ? 0u : 20u);
  }
}

// The same query gives the same bits, regardless of thread order.
void expect_repeated(engine::Scene scene, QueryView q) {
  const engine::Engine device(std::move(scene), {"cuda"});
  for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest, Reduce::kAny}) {
    q.reduce = reduce;
    q.margin = reduce == Reduce::kAny ? 0.05 : 0;
    const Answer first = evaluate(device, q);
    for (int i = 0; i < 5; ++i) expect_same(evaluate(device, q), first, "again", true);
  }
}

TEST_F(CudaElements, RepeatThemselves) {
  for (const ElementKind kind : {ElementKind::kGrown, ElementKind::kSolid}) {
    ElementCase c(kind, is_mesh(kind) ? 20 : 20000, 1.2, 300, 3, true);
    expect_repeated(std::move(c.scene), c.q);
  }
}

TEST_F(CudaElements, RepeatThemselvesOfMeshes) {
  MeshCase c(300, 0.8, 3);
  c.request_about(c.pairs_of_meshes());
  expect_repeated(std::move(c.scene), c.q);
}

// Points are replaced, in the memory of the previous ones and during a query of these; bodies are emptied.
TEST_F(CudaElements, FollowTheirPoints) {
  ElementCase c(ElementKind::kPoints, 3000, 1.2, 200, 3, true);
  engine::Engine cpu(c.scene, {.backend = "cpu", .covers = engine::Covers::kOff}), device(std::move(c.scene), {"cuda"});
  c.q.reduce = Reduce::kMin;
  Random random(5);
  Found found;
  for (const std::size_t count : {3000u, 10u, 100000u, 1u, 0u, 500u}) {
    std::vector<CloudPoint> points;
    const float shift = static_cast<float>(random.uniform(-0.5, 0.5));
    for (std::size_t i = 0; i < count; ++i) {
      const auto x = [&] { return static_cast<float>(random.uniform(-1, 1)); };
      points.push_back({shift + x(), x(), 0.3f * x()});
    }
    for (engine::Engine* engine : {&cpu, &device}) engine->set_points(0, points);
    for (int i = 0; i < 2; ++i) {
      if (count > 0) {
        compare(device, cpu, c.q, std::to_string(count) + " points", found);
      } else {
        expect_same(evaluate(device, c.q), evaluate(cpu, c.q), "no points", true);
      }
    }
  }
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
  EXPECT_GT(found.apart, 200u);
  EXPECT_GT(found.overlap, 200u);
}

// The CPU answers a query whose pairs the device cannot evaluate.
TEST_F(CudaElements, LeaveToTheCpuWhatTheyDoNotAnswer) {
  MeshCase c(20, 0.8, 3);
  std::vector<BodyPair> pairs;
  for (const std::uint32_t link : c.links)
    for (const std::uint32_t other : {c.cloud, c.nothing, c.several}) pairs.push_back({other, link});
  c.request_about(pairs);
  c.q.reduce = Reduce::kMin;
  const engine::Engine cpu(c.scene, {.backend = "cpu", .covers = engine::Covers::kOff}),
      device(std::move(c.scene), {"cuda"});
  expect_same(evaluate(device, c.q), evaluate(cpu, c.q), "clouds before meshes", false);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 1u);
}

}  // namespace
}  // namespace clearance::test
