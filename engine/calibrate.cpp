#include "engine/calibrate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <random>
#include <span>
#include <type_traits>

namespace clearance::cuda {

namespace {

using Clock = std::chrono::steady_clock;

constexpr int kResolution[kHullSizes] = {5, 13};  // of add_uv_sphere(): 42 and 314 vertices
constexpr int kRepeats = 2;                       // of which the fastest counts
constexpr double kRadius = 0.5;
constexpr int kManyPieces = 4;  // of a body of several: spheres in a square

// So many spheres, as close as bodies in a crowd, for each sample.
struct Size {
  int bodies;
  std::uint32_t configurations;  // 0: the current poses
};
constexpr Size kDenseSizes[kCostSamples] = {{5, 0}, {15, 0}, {33, 0}, {64, 0}, {200, 0}},
               kTableSizes[kCostSamples] = {{5, 0}, {15, 0}, {64, 0}, {128, 0}, {300, 0}},
               kConfigurationSizes[kCostSamples] = {{12, 1}, {12, 4}, {12, 16}, {12, 64}, {12, 300}};
const Size* sizes_of(QueryKind kind) {
  switch (kind) {
    case QueryKind::kNear:  // CPUs compare boxes fast: the device wins later, if at all
    case QueryKind::kTable:
    case QueryKind::kWithin:
      return kTableSizes;
    case QueryKind::kConfigurations:
      return kConfigurationSizes;
    default:
      return kDenseSizes;
  }
}
constexpr double kNearDistance = 0.5;  // of crowd()'s spheres: a few for each body

Scene crowd(int bodies, const std::vector<PiecePtr>& pieces) {
  Scene scene;
  std::mt19937_64 bits(1);
  std::uniform_real_distribution<double> place(-0.5, 0.5), turn(-1, 1);
  const double side = 2.0 * std::cbrt(bodies);
  for (int i = 0; i < bodies; ++i) {
    const Pose pose{
        {side * place(bits), side * place(bits), side * place(bits)}, 1, turn(bits), turn(bits), turn(bits)};
    Body body;
    body.name = "s" + std::to_string(i);
    body.pieces = pieces;
    body.pose = pose;
    scene.add_body(std::move(body));
  }
  return scene;
}

// Spheres in a square of the size of one sphere.
std::vector<PiecePtr> spheres(int resolution, Bodies bodies) {
  Scene scene;
  if (bodies == Bodies::kOfOnePiece) {
    scene.add_uv_sphere("one", kRadius, resolution, {});
    return scene.bodies()[0].pieces;
  }
  scene.add_uv_sphere("small", kRadius / 2, resolution, {});
  std::vector<PiecePtr> pieces;
  for (int i = 0; i < kManyPieces; ++i) {
    std::vector<Vec3d> vertices = scene.bodies()[0].pieces[0]->vertices;
    for (Vec3d& v : vertices) v += Vec3d{i % 2 - 0.5, i / 2 - 0.5, 0} * kRadius;
    pieces.push_back(scene.bodies()[scene.add_hull("piece " + std::to_string(i), vertices, {})].pieces[0]);
  }
  return pieces;
}

struct Timed {
  double pairs, ns;
};

Timed time_query(const Scene& scene, const Engine::Options& options, QueryKind kind, std::uint32_t configurations) {
  const Engine engine(scene, options);
  QueryView q;
  if (kind == QueryKind::kTable) q.reduce = Reduce::kNearest;
  if (kind == QueryKind::kWithin) q.reduce = Reduce::kWithin;
  if (kind == QueryKind::kConfigurations) q.reduce = Reduce::kMin;
  if (kind == QueryKind::kNear || kind == QueryKind::kWithin) q.max_distance = kNearDistance;
  q.signed_distance = kind == QueryKind::kDepth;
  q.warm_slot = kind == QueryKind::kWarm ? 1 : 0;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose> poses;
  if (configurations > 0) {
    std::mt19937_64 bits(2);
    std::uniform_real_distribution<double> step(-0.5, 0.5);
    for (std::uint32_t b = 0; b < scene.bodies().size(); ++b) bodies.push_back(b);
    for (std::uint32_t k = 0; k < configurations; ++k)
      for (const std::uint32_t b : bodies) {
        Pose pose = *scene.bodies()[b].pose;
        for (int i = 0; i < 3; ++i) pose.translation[i] += step(bits);
        poses.push_back(pose);
      }
    q.bodies = bodies;
    q.configurations = poses;
    q.configuration_count = configurations;
  }
  const QuerySize size = engine.size(q);
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  std::vector<std::byte> memory(bytes + kColumnAlignment);
  const auto misaligned = reinterpret_cast<std::uintptr_t>(memory.data()) % kColumnAlignment;
  const ReplyView reply =
      reply_view_over(memory.data() + (kColumnAlignment - misaligned) % kColumnAlignment, size.rows, size.fields);
  double best = INFINITY;
  for (int i = 0; i <= kRepeats; ++i) {
    const auto begin = Clock::now();
    Job job = engine.start(q, reply);
    while (!job.advance()) {
    }
    const std::chrono::duration<double, std::nano> taken = Clock::now() - begin;
    if (i > 0) best = std::min(best, taken.count());  // the first one makes room
  }
  return {static_cast<double>(size.configurations * size.pairs), best};
}

constexpr const char* kVersion = "3";  // of the samples and of what is measured

std::string entry_of(const std::string& key) {
  return CacheKey("calibration", kVersion).add(key).name();
}

}  // namespace

Bodies bodies_of(const Scene& scene) {
  const auto& all = scene.bodies();
  const auto several = std::ranges::count_if(all, [](const Body& b) { return b.pieces.size() > 1; });
  return 2 * static_cast<std::size_t>(several) >= all.size() ? Bodies::kOfSeveral : Bodies::kOfOnePiece;
}

Calibration calibrate(const Engine::Options& like, Bodies bodies) {
  Calibration c;
  const std::vector<PiecePtr> pieces[kHullSizes] = {spheres(kResolution[0], bodies), spheres(kResolution[1], bodies)};
  Engine::Options cpu = like, device = like;
  cpu.backend = "cpu";
  cpu.devices.clear();
  device.backend = "cuda";
  for (std::size_t kind = 0; kind < kQueryKinds; ++kind)
    for (std::size_t hulls = 0; hulls < kHullSizes; ++hulls)
      for (std::size_t i = 0; i < kCostSamples; ++i) {
        const Size& size = sizes_of(static_cast<QueryKind>(kind))[i];
        const Scene scene = crowd(size.bodies, pieces[hulls]);
        const Timed on_cpu = time_query(scene, cpu, static_cast<QueryKind>(kind), size.configurations),
                    on_device = time_query(scene, device, static_cast<QueryKind>(kind), size.configurations);
        c.samples[kind][hulls][i] = {on_cpu.pairs, on_cpu.ns, on_device.ns};
      }
  return c;
}

std::string calibration_key(const std::string& device_name, int threads, std::string_view instruction_set,
                            Bodies bodies) {
  return device_name + ", clearance " CLEARANCE_VERSION ", " + std::to_string(threads) + " threads, " +
         std::string(instruction_set) + (bodies == Bodies::kOfSeveral ? ", bodies of several pieces" : "");
}

std::optional<Calibration> load_calibration(const Cache& cache, const std::string& key) {
  const auto kept = cache.read(entry_of(key));
  Calibration c;
  if (!kept || kept->size() != sizeof c.samples) return std::nullopt;
  std::memcpy(&c.samples, kept->data(), sizeof c.samples);
  for (const auto& kind : c.samples)
    for (const auto& hulls : kind) {
      double pairs = 0;
      for (const CostSample& s : hulls) {
        if (!(s.pairs > pairs) || !(s.cpu_ns > 0) || !(s.device_ns > 0)) return std::nullopt;
        pairs = s.pairs;
      }
    }
  return c;
}

void save_calibration(const Cache& cache, const std::string& key, const Calibration& calibration) {
  static_assert(std::is_trivially_copyable_v<decltype(calibration.samples)>);
  cache.write(entry_of(key), std::as_bytes(std::span(&calibration.samples, 1)));
}

}  // namespace clearance::cuda
