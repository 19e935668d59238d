#include "engine/cover/choose_balls.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace clearance {

namespace {

Vec3d point_in(const CoverSimplex& s, PortableRandom& random) {
  // Sorted, three random numbers divide [0, 1] into four weights of a uniform distribution.
  double at[3];
  for (double& a : at) a = random.uniform();
  std::sort(at, at + 3);
  return s.corner[0] * at[0] + s.corner[1] * (at[1] - at[0]) + s.corner[2] * (at[2] - at[1]) +
         s.corner[3] * (1 - at[2]);
}

Vec3d rounded(const Vec3d& p) {
  return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
}

template <class T>
const T& any_of(std::span<const T> all, PortableRandom& random) {
  return all[static_cast<std::size_t>(random.uniform() * static_cast<double>(all.size()))];
}

/// Corners and face centres of simplices, above all those near the body's surface, which need the largest balls.
std::vector<Vec3d> sample(const CoverShape& shape, std::span<const CoverSimplex> simplices, const BallChoice& choice,
                          PortableRandom& random) {
  struct Sample {
    Vec3d point;
    double rank;
  };
  std::vector<Sample> samples;
  const double share =
      std::min(1.0, 3.0 * static_cast<double>(choice.samples) / (8.0 * static_cast<double>(simplices.size())));
  for (const CoverSimplex& s : simplices) {
    if (random.uniform() > share) continue;
    const auto& c = s.corner;
    for (const Vec3d& p : {c[0], c[1], c[2], c[3], (c[0] + c[1] + c[2]) * (1.0 / 3), (c[0] + c[1] + c[3]) * (1.0 / 3),
                           (c[0] + c[2] + c[3]) * (1.0 / 3), (c[1] + c[2] + c[3]) * (1.0 / 3)})
      samples.push_back({p, std::abs(shape.inside(p)) + random.uniform(0, 0.35 * choice.edge)});
  }
  if (samples.empty()) samples.push_back({simplices[0].corner[0], 0});
  std::stable_sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.rank < b.rank; });
  const std::size_t kept = std::min(choice.samples, samples.size());
  std::vector<Vec3d> points;
  for (std::size_t i = 0; i < kept; ++i) {
    // One in eight from the rest, the interior.
    const std::size_t at =
        i % 8 == 7 ? i + static_cast<std::size_t>(random.uniform() * static_cast<double>(samples.size() - i)) : i;
    points.push_back(samples[at].point);
  }
  return points;
}

/// Candidates, and by how much a ball about each has to stand out to hold each sample.
struct Candidates {
  std::vector<Vec3d> centres;
  std::vector<double> inside;
  std::size_t samples = 0;
  std::vector<float> stand_out;  ///< of candidate i for sample k: at [i * samples + k]

  void add(const CoverShape& shape, std::span<const Vec3d> points, const Vec3d& c, bool must_be_inside) {
    const Vec3d centre = rounded(c);
    const double depth = shape.inside(centre);
    if (must_be_inside && !(depth > 0)) return;
    centres.push_back(centre);
    inside.push_back(std::max(depth, 0.0));
    for (const Vec3d& p : points) stand_out.push_back(static_cast<float>(norm(p - centre) - inside.back()));
  }
  const float* row(std::size_t i) const { return stand_out.data() + i * samples; }
};

Candidates find_candidates(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                           std::span<const Vec3d> points, const BallChoice& choice, PortableRandom& random) {
  Candidates candidates;
  candidates.samples = points.size();
  Vec3d low = points[0], high = points[0];
  for (const Vec3d& p : points)
    for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  for (std::size_t i = 0; i < choice.candidates; ++i) {
    candidates.add(shape, points, point_in(any_of(simplices, random), random), true);
    // Balls centred beyond a share may fit its part of the surface better.
    for (int more = 0; more < 2; ++more) {
      Vec3d c;
      for (int k = 0; k < 3; ++k) c[k] = 0.5 * (low[k] + high[k]) + random.uniform(-0.65, 0.65) * (high[k] - low[k]);
      candidates.add(shape, points, c, true);
    }
    if (i % 2 == 0) candidates.add(shape, points, any_of(points, random), false);
  }
  return candidates;
}

/// Candidates that hold all samples with a stand-out of at most `limit`, greedily, or nothing with more than `most`.
class GreedyCover {
 public:
  explicit GreedyCover(const Candidates& candidates)
      : candidates_(candidates), words_((candidates.samples + 63) / 64), held_(candidates.centres.size() * words_) {}

  std::vector<std::size_t> choose(float limit, std::size_t most) {
    mark(limit);
    std::vector<std::uint64_t> left(words_, ~std::uint64_t{0});
    if (const std::size_t last = candidates_.samples % 64) left.back() = (std::uint64_t{1} << last) - 1;
    std::vector<std::size_t> chosen;
    while (std::any_of(left.begin(), left.end(), [](std::uint64_t w) { return w != 0; })) {
      if (chosen.size() == most) return {};
      const std::size_t best = most_useful(left);
      if (best == candidates_.centres.size()) return {};
      chosen.push_back(best);
      for (std::size_t w = 0; w < words_; ++w) left[w] &= ~held_[best * words_ + w];
    }
    return chosen;
  }

 private:
  void mark(float limit) {
    std::fill(held_.begin(), held_.end(), 0);
    for (std::size_t i = 0; i < candidates_.centres.size(); ++i) {
      const float* row = candidates_.row(i);
      for (std::size_t k = 0; k < candidates_.samples; ++k)
        held_[i * words_ + k / 64] |= std::uint64_t{row[k] <= limit} << (k % 64);
    }
  }
  std::size_t most_useful(std::span<const std::uint64_t> left) const {
    std::size_t best = candidates_.centres.size();
    int most = 0;
    for (std::size_t i = 0; i < candidates_.centres.size(); ++i) {
      int count = 0;
      for (std::size_t w = 0; w < words_; ++w) count += std::popcount(held_[i * words_ + w] & left[w]);
      if (count > most) most = count, best = i;
    }
    return best;
  }

  const Candidates& candidates_;
  std::size_t words_;
  std::vector<std::uint64_t> held_;
};

}  // namespace

std::vector<ChosenBall> choose_balls(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                                     const BallChoice& choice, PortableRandom& random) {
  const std::vector<Vec3d> points = sample(shape, simplices, choice, random);
  const Candidates candidates = find_candidates(shape, simplices, points, choice, random);
  GreedyCover cover(candidates);
  // One ball about some candidate holds everything at the greatest stand-out.
  float low = 0, high = 0;
  for (const float width : candidates.stand_out) high = std::max(high, width);
  std::vector<std::size_t> chosen = cover.choose(high, choice.most);
  for (int step = 0; step < 12; ++step) {
    const float middle = 0.5f * (low + high);
    std::vector<std::size_t> better = cover.choose(middle, choice.most);
    (better.empty() ? low : high) = middle;
    if (!better.empty()) chosen = std::move(better);
  }
  std::vector<ChosenBall> balls;
  for (const std::size_t i : chosen)
    balls.push_back({candidates.centres[i], candidates.inside[i] + high + 0.05 * choice.edge});
  return balls;
}

}  // namespace clearance
