#include "engine/narrow/self_test.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "engine/base/fp_environment.h"
#include "engine/hull/shapes.h"
#include "engine/narrow/certify.h"
#include "engine/narrow/part_batch.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Quaternions of integers whose squared norms all divide kGrid. They rotate multiples of kGrid to integers.
constexpr int kTurns[][4] = {{1, 0, 0, 0}, {1, 1, 0, 0},  {1, 0, -1, 1}, {1, 1, 1, 1},
                             {2, 0, 1, 0}, {2, 1, -1, 0}, {2, 1, 1, -1}};
constexpr double kGrid = 420;
// Directions of integers, of integer length.
constexpr int kDirections[][4] = {{1, 2, 2, 3}, {2, 3, 6, 7}, {-1, 4, 8, 9}, {4, -4, 7, 9}};
constexpr double kStep = 0x1p-13;  // metres: bodies of about one metre
constexpr int kPlaces = 8;

// Numbers of this file are integers of moderate size, so that nothing is rounded.
struct Turn {
  double w, x, y, z;

  double squared() const { return w * w + x * x + y * y + z * z; }
  Mat3d times_squared() const {
    return {{{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
             {2 * (x * y + w * z), w * w + y * y - x * x - z * z, 2 * (y * z - w * x)},
             {2 * (x * z - w * y), 2 * (y * z + w * x), w * w + z * z - x * x - y * y}}};
  }
  Vec3d turned(const Vec3d& v) const { return divided(times_squared() * v); }
  Vec3d turned_back(const Vec3d& v) const { return divided(times_squared().transpose_times(v)); }
  Turn after(const Turn& b) const {
    return {w * b.w - x * b.x - y * b.y - z * b.z, w * b.x + x * b.w + y * b.z - z * b.y,
            w * b.y - x * b.z + y * b.w + z * b.x, w * b.z + x * b.y - y * b.x + z * b.w};
  }

 private:
  Vec3d divided(const Vec3d& v) const { return {v.x / squared(), v.y / squared(), v.z / squared()}; }
};

class Maker {
 public:
  explicit Maker(std::uint64_t seed) : random_(seed) {}

  double integer(int low, int high) { return low + std::floor(random_.uniform() * (high - low + 1)); }
  Vec3d point(int range) { return {integer(-range, range), integer(-range, range), integer(-range, range)}; }
  Turn turn() {
    const auto& t = kTurns[static_cast<int>(integer(0, std::size(kTurns) - 1))];
    return {double(t[0]), double(t[1]), double(t[2]), double(t[3])};
  }

  // Bodies of these vertices, in grid steps of the world, each turned and moved within its frame, in several places.
  KnownPair place(std::string_view kind, const std::vector<Vec3d>& a, double radius_a, const std::vector<Vec3d>& b,
                  double radius_b, double exact, double far) {
    const Turn turn_a = turn(), turn_b = turn();
    const Vec3d at_a = point(5) * kGrid, at_b = point(5) * kGrid;
    const auto part = [](const std::vector<Vec3d>& world, const Turn& turn, const Vec3d& at, double radius) {
      std::vector<Vec3d> v;
      for (const Vec3d& p : world) v.push_back(turn.turned_back(p * kGrid - at) * kStep);
      return make_convex_part(std::move(v), radius * kGrid * kStep);
    };
    KnownPair pair{kind, part(a, turn_a, at_a, radius_a), part(b, turn_b, at_b, radius_b), exact * kGrid * kStep, {}};
    for (int i = 0; i < kPlaces; ++i) {
      const Turn whole = turn();  // of both bodies together
      const Vec3d moved = point(9) * (kGrid * far);
      const auto pose = [&](const Turn& own, const Vec3d& at) {
        const Turn q = whole.after(own);
        return Pose{(whole.turned(at) + moved) * kStep, q.w, q.x, q.y, q.z};
      };
      pair.poses.emplace_back(pose(turn_a, at_a), pose(turn_b, at_b));
    }
    return pair;
  }

  enum Feature { kVertex, kEdge, kFace };
  // Points beyond a plane through the origin that is normal to `n`, which they touch in a feature about the origin.
  std::vector<Vec3d> beyond(const Vec3d& n, Feature feature, bool across, int count) {
    const Vec3d along{n.y, -n.x, 0}, other = cross(n, along);
    std::vector<Vec3d> v;
    if (feature == kVertex) v.push_back({0, 0, 0});
    for (const Vec3d& e : {across ? other : along, across ? along : other}) {
      if (feature == kVertex || (feature == kEdge && !v.empty())) continue;
      v.push_back(e);
      v.push_back(-e);
    }
    for (int i = 0; i < count; ++i) {
      const Vec3d p = point(24);
      if (const double side = dot(n, p); side != 0) v.push_back(side > 0 ? p : -p);
    }
    return v;
  }

  KnownPair facing(std::string_view kind, Feature of_a, Feature of_b, int vertices, double distance, double radius = 0,
                   double far = 1) {
    const auto& d = kDirections[static_cast<int>(integer(0, std::size(kDirections) - 1))];
    const Vec3d n{double(d[0]), double(d[1]), double(d[2])};
    std::vector<Vec3d> a = beyond(-n, of_a, false, vertices), b = beyond(n, of_b, true, vertices);
    for (Vec3d& p : b) p += n * distance;
    return place(kind, a, radius, b, 2 * radius, distance * d[3] - 3 * radius, far);
  }

  // Aligned boxes that overlap, with the shortest way out along an edge.
  KnownPair boxes(double radius) {
    const auto box = [](const Vec3d& h, const Vec3d& at) {
      std::vector<Vec3d> v;
      for (int i = 0; i < 8; ++i) v.push_back(at + Vec3d{i & 1 ? h.x : -h.x, i & 2 ? h.y : -h.y, i & 4 ? h.z : -h.z});
      return v;
    };
    const Vec3d half_a{integer(4, 9), integer(4, 9), integer(4, 9)},
        half_b{integer(4, 9), integer(4, 9), integer(4, 9)};
    const Vec3d at{integer(-6, 6), integer(-6, 6), integer(-6, 6)};
    double depth = kInf;
    for (int k = 0; k < 3; ++k) depth = std::min(depth, half_a[k] + half_b[k] - std::abs(at[k]));
    return place("overlapping boxes", box(half_a, {0, 0, 0}), radius, box(half_b, at), radius, -depth - 2 * radius, 1);
  }

 private:
  PortableRandom random_;
};

std::vector<KnownPair> make_known_pairs() {
  Maker make(2026);
  std::vector<KnownPair> pairs;
  for (const double distance : {1.0, 4.0}) {
    pairs.push_back(make.facing("vertex before vertex", Maker::kVertex, Maker::kVertex, 8, distance));
    pairs.push_back(make.facing("edge across edge", Maker::kEdge, Maker::kEdge, 8, distance));
    pairs.push_back(make.facing("vertex before face", Maker::kVertex, Maker::kFace, 8, distance));
    pairs.push_back(make.facing("face before face", Maker::kFace, Maker::kFace, 6, distance));
    pairs.push_back(make.facing("edge before face", Maker::kEdge, Maker::kFace, 20, distance));
    pairs.push_back(make.facing("rounded", Maker::kFace, Maker::kEdge, 8, distance, 0.5));
    pairs.push_back(make.facing("far from the origin", Maker::kEdge, Maker::kVertex, 8, distance, 0, 1024));
  }
  pairs.push_back(make.facing("many vertices", Maker::kFace, Maker::kVertex, 90, 1));
  pairs.push_back(make.facing("touching in a point", Maker::kVertex, Maker::kFace, 8, 0));
  pairs.push_back(make.facing("touching in a face", Maker::kFace, Maker::kFace, 8, 0));
  pairs.push_back(make.boxes(0));
  pairs.push_back(make.boxes(0));
  pairs.push_back(make.boxes(1));
  return pairs;
}

// Queries all pairs in a number of their places at once. Pairs of the same two parts run in parallel if they fill the
// lanes.
void run(SelfTest& test, const NarrowOptions& given, int places) {
  std::atomic<std::uint64_t> contradictions{0};
  NarrowOptions options = given;
  options.contradictions = &contradictions;
  const std::vector<KnownPair>& pairs = known_pairs();
  std::vector<std::pair<PoseMatrix, PoseMatrix>> placed;
  std::vector<PartTask> tasks;
  placed.reserve(pairs.size() * static_cast<std::size_t>(places));  // tasks point to them
  for (std::uint32_t p = 0; p < pairs.size(); ++p)
    for (int i = 0; i < places; ++i) {
      const auto& [X_wa, X_wb] = pairs[p].poses[static_cast<std::size_t>(i)];
      placed.push_back({{rotation_of(X_wa), X_wa.translation, X_wa}, {rotation_of(X_wb), X_wb.translation, X_wb}});
      tasks.push_back({pairs[p].a.get(), pairs[p].b.get(), &placed.back().first, &placed.back().second, kInf, p});
    }
  const auto take = [&](const PartTask& task, const NarrowAnswer& answer) {
    test.count(error_of(pairs[task.id], answer, options.limits));
  };
  PartBatch batch(options);
  batch.run(
      tasks,
      [&](const PartTask& task, const LaneAnswer& lane, const CoreWitness& witness) {
        take(task, batch.converged_answer(task, lane, witness));
      },
      take);
  if (contradictions > 0) test.count(std::to_string(contradictions) + " pairs of bounds contradict each other");
}

template <class Evaluate>
SelfTest timed(std::string_view name, Evaluate evaluate) {
  const FpEnvironment environment;
  const auto begin = std::chrono::steady_clock::now();
  SelfTest test{std::string(name)};
  evaluate(test);
  test.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return test;
}

}  // namespace

const std::vector<KnownPair>& known_pairs() {
  static const auto& pairs = *new std::vector<KnownPair>([] {  // engines may outlast main()
    const FpEnvironment environment;
    return make_known_pairs();
  }());
  return pairs;
}

void SelfTest::count(const std::string& error) {
  ++answers;
  if (error.empty()) return;
  if (wrong++ == 0) first_wrong = error;
}

std::string error_of(const KnownPair& pair, const NarrowAnswer& answer, const NarrowLimits& limits) {
  const auto [lower, upper] = answer.bounds;
  const bool as_depth = limits.signed_distance || pair.exact > 0;
  const double low = as_depth ? lower : std::max(lower, 0.0), high = as_depth ? upper : std::max(upper, 0.0);
  const double exact = as_depth ? pair.exact : 0, wanted = limits.rel_tol * std::abs(high) + 1e-9;
  const char* what = nullptr;
  if (!(low <= exact && exact <= high))
    what = "misses it";
  else if (!(high - low <= wanted))
    what = "is wider than it has to be";
  else if (pair.exact < 0 && !(upper <= 0))
    what = "does not show that they overlap";
  if (!what) return {};
  char text[200];
  std::snprintf(text, sizeof text, "%.*s: the distance is %.17g m, and [%.17g, %.17g] %s",
                static_cast<int>(pair.kind.size()), pair.kind.data(), pair.exact, lower, upper, what);
  return text;
}

SelfTest self_test_lanes(const LaneKernel& kernel) {
  return timed(kernel.name, [&](SelfTest& test) {
    NarrowOptions options;
    options.lanes = &kernel;
    for (const bool f32 : {false, true}) {
      options.f32 = f32;
      options.limits.rel_tol = f32 ? 1e-4 : 1e-6;
      for (const int places : {kPlaces, 1}) run(test, options, places);
    }
  });
}

SelfTest self_test_alone(bool reference) {
  return timed(reference ? "reference" : "scalar", [&](SelfTest& test) {
    NarrowOptions options;
    options.reference = reference;
    for (const bool depth : {false, true}) {
      options.limits.signed_distance = depth;
      run(test, options, kPlaces / 2);
    }
  });
}

const std::vector<SelfTest>& self_tests() {
  static const auto& tests = *new std::vector<SelfTest>([] {  // likewise
    std::vector<SelfTest> all{self_test_alone(true), self_test_alone(false)};
    for (const LaneKernel& kernel : lane_kernels()) all.push_back(self_test_lanes(kernel));
    return all;
  }());
  return tests;
}

const LaneKernel& passed_lane_kernel(std::string_view name, std::span<const LaneKernel> kernels,
                                     std::span<const SelfTest> tests) {
  const auto failure = [&](std::string_view of) -> const SelfTest* {
    const auto found =
        std::find_if(tests.begin(), tests.end(), [&](const SelfTest& t) { return t.name == of && !t.passed(); });
    return found == tests.end() ? nullptr : &*found;
  };
  const std::string wrongly = " fails the self-test on this machine (";
  for (const char* base : {"reference", "scalar"})
    if (const SelfTest* test = failure(base))
      throw std::runtime_error("the engine does not start: its " + test->name + " arithmetic" + wrongly +
                               test->first_wrong + ")");
  const LaneKernel* first = nullptr;
  std::string passed;
  for (const LaneKernel& kernel : kernels) {
    if (failure(kernel.name)) continue;
    if (!first) first = &kernel;
    passed.append(passed.empty() ? "" : ", ").append(kernel.name);
  }
  if (!first)
    throw std::runtime_error("the engine does not start: every instruction set" + wrongly +
                             failure(kernels[0].name)->first_wrong + ")");
  if (name == "auto") return *first;
  if (const SelfTest* test = failure(name))
    throw std::runtime_error("instruction set '" + test->name + "'" + wrongly + test->first_wrong +
                             "); those that pass: " + passed);
  return lane_kernel(name);
}

}  // namespace clearance
