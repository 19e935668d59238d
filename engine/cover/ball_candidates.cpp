#include "engine/cover/ball_candidates.h"

#include <algorithm>
#include <cmath>

namespace clearance {

namespace {

std::size_t any_below(std::size_t count, PortableRandom& random) {
  return static_cast<std::size_t>(random.uniform() * static_cast<double>(count));
}

Vec3d point_in(const CoverSimplex& s, PortableRandom& random) {
  // Sorted, three random numbers divide [0, 1] into four weights of a uniform distribution.
  double at[3];
  for (double& a : at) a = random.uniform();
  std::sort(at, at + 3);
  return s.corner[0] * at[0] + s.corner[1] * (at[1] - at[0]) + s.corner[2] * (at[2] - at[1]) +
         s.corner[3] * (1 - at[2]);
}

}  // namespace

std::vector<CoverSample> sample_shares(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                                       const BallChoice& choice, PortableRandom& random) {
  struct Ranked {
    CoverSample sample;
    double rank;
  };
  constexpr double kThird = 1.0 / 3;
  std::vector<Ranked> all;
  const double share = static_cast<double>(3 * choice.samples) / static_cast<double>(8 * simplices.size());
  for (std::size_t i = 0; i < simplices.size(); ++i) {
    if (i > 0 && random.uniform() > share) continue;
    const auto& c = simplices[i].corner;
    for (const Vec3d& p : {c[0], c[1], c[2], c[3], (c[0] + c[1] + c[2]) * kThird, (c[0] + c[1] + c[3]) * kThird,
                           (c[0] + c[2] + c[3]) * kThird, (c[1] + c[2] + c[3]) * kThird})
      all.push_back({{p, simplices[i].growth}, std::abs(shape.inside(p)) + random.uniform(0, 0.35 * choice.edge)});
  }
  std::stable_sort(all.begin(), all.end(), [](const Ranked& a, const Ranked& b) { return a.rank < b.rank; });
  const std::size_t kept = std::min(choice.samples, all.size());
  std::vector<CoverSample> samples;
  for (std::size_t i = 0; i < kept; ++i) {
    // One in four is any of the others.
    if (i % 4 == 3) std::swap(all[i], all[i + any_below(all.size() - i, random)]);
    samples.push_back(all[i].sample);
  }
  return samples;
}

BallCandidates::BallCandidates(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                               const BallChoice& choice, PortableRandom& random)
    : origin_(simplices[0].corner[0]) {
  Vec3d low = origin_, high = low;
  for (const CoverSimplex& s : simplices)
    for (const Vec3d& p : s.corner)
      for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  for (std::size_t i = 0; i < choice.candidates; ++i) {
    const CoverSimplex& any = simplices[any_below(simplices.size(), random)];
    add(shape, point_in(any, random), true);
    // Balls centred beyond a share may fit its part of the surface better.
    for (int more = 0; more < 2; ++more) {
      Vec3d c;
      for (int k = 0; k < 3; ++k) c[k] = 0.5 * (low[k] + high[k]) + random.uniform(-0.65, 0.65) * (high[k] - low[k]);
      add(shape, c, true);
    }
    if (i % 2 == 0) add(shape, any.corner[any_below(4, random)], false);
  }
}

void BallCandidates::add(const CoverShape& shape, const Vec3d& c, bool must_be_inside) {
  if (must_be_inside && !shape.has_inside()) return;
  const Vec3d centre{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)};
  const double depth = shape.inside(centre);
  if (must_be_inside && !(depth > 0)) return;
  centres_.push_back(centre);
  inside_.push_back(std::max(depth, 0.0));
}

void BallCandidates::add(std::span<const CoverSample> samples) {
  const std::size_t before = x_.size(), after = before + samples.size();
  for (const CoverSample& s : samples) {
    const Vec3d p = s.point - origin_;
    x_.push_back(static_cast<float>(p.x));
    y_.push_back(static_cast<float>(p.y));
    z_.push_back(static_cast<float>(p.z));
    growth_.push_back(static_cast<float>(s.growth));
  }
  std::vector<float> needs(count() * after);
  for (std::size_t i = 0; i < count(); ++i) {
    float* row = needs.data() + i * after;
    std::copy_n(this->needs(i), before, row);
    const Vec3d p = centres_[i] - origin_;
    const float x = static_cast<float>(p.x), y = static_cast<float>(p.y), z = static_cast<float>(p.z);
    const float in = static_cast<float>(inside_[i]);
    for (std::size_t k = before; k < after; ++k) {
      const float dx = x_[k] - x, dy = y_[k] - y, dz = z_[k] - z;
      row[k] = std::sqrt(dx * dx + dy * dy + dz * dz) + (growth_[k] - in);
    }
  }
  needs_ = std::move(needs);
  stride_ = after;
}

}  // namespace clearance
