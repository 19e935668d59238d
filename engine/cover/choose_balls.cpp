#include "engine/cover/choose_balls.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace clearance {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

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

/// A point that a ball has to hold with all that is within `growth` of it.
struct Sample {
  Vec3d point;
  double growth;
  double rank;
};

/// Corners and face centres of simplices, most of them near the body's surface, which needs the most balls.
std::vector<Sample> sample(const CoverShape& shape, std::span<const CoverSimplex> simplices, const BallChoice& choice,
                           PortableRandom& random) {
  constexpr double kThird = 1.0 / 3;
  std::vector<Sample> samples;
  const double share = static_cast<double>(3 * choice.samples) / static_cast<double>(8 * simplices.size());
  for (std::size_t i = 0; i < simplices.size(); ++i) {
    if (i > 0 && random.uniform() > share) continue;
    const auto& c = simplices[i].corner;
    for (const Vec3d& p : {c[0], c[1], c[2], c[3], (c[0] + c[1] + c[2]) * kThird, (c[0] + c[1] + c[3]) * kThird,
                           (c[0] + c[2] + c[3]) * kThird, (c[1] + c[2] + c[3]) * kThird})
      samples.push_back({p, simplices[i].growth, std::abs(shape.inside(p)) + random.uniform(0, 0.35 * choice.edge)});
  }
  std::stable_sort(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) { return a.rank < b.rank; });
  const std::size_t kept = std::min(choice.samples, samples.size());
  // One in eight is any of the others.
  for (std::size_t i = 7; i < kept; i += 8) std::swap(samples[i], samples[i + any_below(samples.size() - i, random)]);
  samples.resize(kept);
  return samples;
}

/// Centres, and by how much a ball about each has to stand out to hold each sample. Float32 is enough for a choice.
class Candidates {
 public:
  explicit Candidates(std::span<const Sample> samples) : origin_(samples[0].point) {
    for (const Sample& s : samples) {
      const Vec3d p = s.point - origin_;
      x_.push_back(static_cast<float>(p.x));
      y_.push_back(static_cast<float>(p.y));
      z_.push_back(static_cast<float>(p.z));
      growth_.push_back(static_cast<float>(s.growth));
    }
  }

  std::size_t count() const { return centres_.size(); }
  std::size_t samples() const { return x_.size(); }
  const Vec3d& centre(std::size_t i) const { return centres_[i]; }
  double inside(std::size_t i) const { return inside_[i]; }
  const float* needs(std::size_t i) const { return needs_.data() + i * samples(); }

  void add(const CoverShape& shape, const Vec3d& c, bool must_be_inside) {
    const Vec3d centre{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)};
    const double depth = shape.inside(centre);
    if (must_be_inside && !(depth > 0)) return;
    centres_.push_back(centre);
    inside_.push_back(std::max(depth, 0.0));
    const Vec3d p = centre - origin_;
    const float x = static_cast<float>(p.x), y = static_cast<float>(p.y), z = static_cast<float>(p.z);
    const float in = static_cast<float>(inside_.back());
    needs_.resize(needs_.size() + samples());
    float* row = needs_.data() + needs_.size() - samples();
    for (std::size_t k = 0; k < samples(); ++k) {
      const float dx = x_[k] - x, dy = y_[k] - y, dz = z_[k] - z;
      row[k] = std::sqrt(dx * dx + dy * dy + dz * dz) + (growth_[k] - in);
    }
  }

 private:
  Vec3d origin_;
  std::vector<float> x_, y_, z_, growth_;
  std::vector<Vec3d> centres_;
  std::vector<double> inside_;
  std::vector<float> needs_;
};

Candidates find_candidates(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                           std::span<const Sample> samples, const BallChoice& choice, PortableRandom& random) {
  Candidates candidates(samples);
  Vec3d low = samples[0].point, high = low;
  for (const Sample& s : samples)
    for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], s.point[k]), high[k] = std::max(high[k], s.point[k]);
  for (std::size_t i = 0; i < choice.candidates; ++i) {
    candidates.add(shape, point_in(simplices[any_below(simplices.size(), random)], random), true);
    // Balls centred beyond a share may fit its part of the surface better.
    for (int more = 0; more < 2; ++more) {
      Vec3d c;
      for (int k = 0; k < 3; ++k) c[k] = 0.5 * (low[k] + high[k]) + random.uniform(-0.65, 0.65) * (high[k] - low[k]);
      candidates.add(shape, c, true);
    }
    if (i % 2 == 0) candidates.add(shape, samples[any_below(samples.size(), random)].point, false);
  }
  return candidates;
}

/// Number of samples left that need at most `limit`. Without branches: the compiler vectorizes it.
std::int32_t count_held(const float* needs, const std::int32_t* left, std::size_t samples, float limit) {
  std::int32_t count = 0;
  for (std::size_t k = 0; k < samples; ++k) count += static_cast<std::int32_t>(needs[k] <= limit) & left[k];
  return count;
}

/// Candidates that together hold all samples.
class Selection {
 public:
  Selection(const Candidates& candidates, std::size_t most) : candidates_(candidates), most_(most) {}

  /// Chooses at most `most` candidates whose greatest stand-out is small, and returns that.
  float choose() {
    // Some candidate has to hold each sample, and one can hold all of them.
    const std::size_t samples = candidates_.samples();
    std::vector<float> least(samples, kInfinity);
    float high = kInfinity;
    for (std::size_t i = 0; i < candidates_.count(); ++i) {
      const float* needs = candidates_.needs(i);
      float greatest = -kInfinity;
      for (std::size_t k = 0; k < samples; ++k) {
        greatest = std::max(greatest, needs[k]);
        least[k] = std::min(least[k], needs[k]);
      }
      if (greatest < high) high = greatest, chosen = {i};
    }
    float low = *std::max_element(least.begin(), least.end());
    for (int step = 0; step < 7 && low < high; ++step) {
      const float middle = 0.5f * (low + high);
      (cover_greedily(middle) ? high : low) = middle;
    }
    for (int step = 0; step < 4; ++step)
      if (!improve()) break;
    return greatest_need();
  }

  std::vector<std::size_t> chosen;

 private:
  /// Chooses candidates that hold all samples with a stand-out of at most `limit`, if few enough do.
  bool cover_greedily(float limit);
  /// Replaces each candidate by the one that holds its samples best. Returns false if that gains nothing.
  bool improve();
  /// Adds candidates while there may be more, each the best one for the sample that is held worst.
  void spend(std::vector<std::size_t>& selected) const;
  /// The selected candidate that holds each sample best, and the greatest stand-out for any sample.
  std::vector<std::size_t> owners(std::span<const std::size_t> selected, float* greatest, std::size_t* worst) const;
  float greatest_need() const {
    float greatest = 0;
    std::size_t worst = 0;
    owners(chosen, &greatest, &worst);
    return greatest;
  }

  const Candidates& candidates_;
  std::size_t most_;
};

bool Selection::cover_greedily(float limit) {
  const std::size_t samples = candidates_.samples();
  std::vector<std::int32_t> left(samples, 1);
  const auto gain_of = [&](std::size_t i) { return count_held(candidates_.needs(i), left.data(), samples, limit); };
  // Gains only fall: one that is up to date and greater than the outdated others is the greatest.
  std::vector<std::pair<std::int32_t, std::size_t>> heap;
  for (std::size_t i = 0; i < candidates_.count(); ++i) heap.emplace_back(gain_of(i), i);
  std::make_heap(heap.begin(), heap.end());
  std::vector<std::size_t> selected;
  for (std::size_t held = 0; held < samples;) {
    if (selected.size() == most_) return false;
    for (;;) {
      std::pop_heap(heap.begin(), heap.end());
      heap.back().first = gain_of(heap.back().second);
      if (heap.size() == 1 || heap.back() >= heap.front()) break;
      std::push_heap(heap.begin(), heap.end());
    }
    const auto [gain, best] = heap.back();
    heap.pop_back();
    if (gain == 0 || heap.empty()) return false;
    held += static_cast<std::size_t>(gain);
    selected.push_back(best);
    const float* needs = candidates_.needs(best);
    for (std::size_t k = 0; k < samples; ++k) left[k] = needs[k] <= limit ? 0 : left[k];
  }
  chosen = std::move(selected);
  return true;
}

std::vector<std::size_t> Selection::owners(std::span<const std::size_t> selected, float* greatest,
                                           std::size_t* worst) const {
  std::vector<std::size_t> owner(candidates_.samples(), 0);
  *greatest = -kInfinity;
  for (std::size_t k = 0; k < owner.size(); ++k) {
    float least = kInfinity;
    for (std::size_t c = 0; c < selected.size(); ++c)
      if (const float need = candidates_.needs(selected[c])[k]; need < least) least = need, owner[k] = c;
    if (least > *greatest) *greatest = least, *worst = k;
  }
  return owner;
}

void Selection::spend(std::vector<std::size_t>& selected) const {
  while (selected.size() < most_) {
    float greatest = 0, least = kInfinity;
    std::size_t worst = 0, best = 0;
    owners(selected, &greatest, &worst);
    for (std::size_t i = 0; i < candidates_.count(); ++i)
      if (const float need = candidates_.needs(i)[worst]; need < least) least = need, best = i;
    if (!(least < greatest)) return;
    selected.push_back(best);
  }
}

bool Selection::improve() {
  std::vector<std::size_t> selected = chosen;
  spend(selected);
  float before = 0, after = 0;
  std::size_t worst = 0;
  const std::vector<std::size_t> owner = owners(selected, &before, &worst);
  std::vector<std::vector<std::size_t>> held(selected.size());
  for (std::size_t k = 0; k < owner.size(); ++k) held[owner[k]].push_back(k);
  std::vector<float> least(selected.size(), kInfinity);
  for (std::size_t i = 0; i < candidates_.count(); ++i) {
    const float* needs = candidates_.needs(i);
    for (std::size_t c = 0; c < held.size(); ++c) {
      float greatest = -kInfinity;
      for (const std::size_t k : held[c])
        if ((greatest = std::max(greatest, needs[k])) >= least[c]) break;
      if (greatest < least[c]) least[c] = greatest, selected[c] = i;
    }
  }
  owners(selected, &after, &worst);
  if (!(after < greatest_need())) return false;
  chosen = std::move(selected);
  return true;
}

}  // namespace

std::vector<ChosenBall> choose_balls(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                                     const BallChoice& choice, PortableRandom& random) {
  const std::vector<Sample> samples = sample(shape, simplices, choice, random);
  const Candidates candidates = find_candidates(shape, simplices, samples, choice, random);
  Selection selection(candidates, choice.most);
  const double stand_out = selection.choose();
  std::vector<ChosenBall> balls;
  for (const std::size_t i : selection.chosen)
    balls.push_back({candidates.centre(i), candidates.inside(i) + stand_out});
  return balls;
}

}  // namespace clearance
