#include "bench/report/naive.h"

#include <cmath>
#include <limits>

#include "bench/report/triangles.h"

namespace clearance::baselines {

namespace {

std::vector<PreparedTriangle> prepare(const Mesh& mesh) {
  std::vector<PreparedTriangle> out;
  out.reserve(mesh.connections->triangles.size());
  for (const Triangle& t : mesh.connections->triangles)
    out.emplace_back(mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]);
  return out;
}

// Tests a point against the outward faces of a convex mesh: it is inside if it is below all of them.
bool holds(const Mesh& mesh, const Vec3d& x) {
  for (const Triangle& t : mesh.connections->triangles) {
    const Vec3d &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    if (dot(cross(b - a, c - a), x - a) > 0) return false;
  }
  return true;
}

// Distributes the faces of a over threads, each with its own minimum.
PairAnswer least(const Mesh& a, const Mesh& b, int threads) {
  const std::vector<PreparedTriangle> faces_a = prepare(a), faces_b = prepare(b);
  NearestPoints best{std::numeric_limits<double>::infinity(), {}, {}};
  bool crossing = false;
#pragma omp parallel num_threads(threads) if (threads > 1)
  {
    NearestPoints mine{std::numeric_limits<double>::infinity(), {}, {}};
    bool found = false;
#pragma omp for schedule(dynamic, 16) nowait
    for (std::size_t i = 0; i < faces_a.size(); ++i)
      for (std::size_t j = 0; j < faces_b.size() && !found; ++j)
        found = take_triangle_pair(faces_a[i], faces_b[j], mine);
#pragma omp critical(clearance_naive)
    {
      crossing = crossing || found;
      if (mine.squared_distance < best.squared_distance) best = mine;
    }
  }
  PairAnswer answer;
  answer.overlap = crossing;
  answer.distance = crossing ? 0 : std::sqrt(best.squared_distance);
  answer.point_a = best.a;
  answer.point_b = best.b;
  return answer;
}

PairAnswer distance_of(const Mesh& a, const Mesh& b, int threads) {
  PairAnswer answer = least(a, b, threads);
  if (!answer.overlap && (holds(a, b.vertices[0]) || holds(b, a.vertices[0]))) {
    answer.overlap = 1;
    answer.distance = 0;
  }
  return answer;
}

class Naive final : public NarrowBaseline {
 public:
  explicit Naive(int threads) : threads_(threads) {}

  void distances(const World& world, std::span<const BodyPair> pairs, std::span<PairAnswer> answers) override {
    // Runs pairs in parallel if there are enough, otherwise the faces of each.
    const bool by_pair = pairs.size() >= 4 * static_cast<std::size_t>(threads_);
    const int inner = by_pair ? 1 : threads_;
#pragma omp parallel for schedule(dynamic, 4) num_threads(threads_) if (by_pair && threads_ > 1)
    for (std::size_t i = 0; i < pairs.size(); ++i)
      answers[i] = distance_of(world.mesh(pairs[i].a), world.mesh(pairs[i].b), inner);
  }

 private:
  int threads_;
};

}  // namespace

PairAnswer least_triangle_distance(const Mesh& a, const Mesh& b) {
  return least(a, b, 1);
}

std::unique_ptr<NarrowBaseline> make_naive(int threads) {
  return std::make_unique<Naive>(threads);
}

}  // namespace clearance::baselines
