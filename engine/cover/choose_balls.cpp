#include "engine/cover/choose_balls.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "engine/base/clones.h"

namespace clearance {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Simplices side by side.
constexpr std::size_t kLanes = 16;
/// Centres tried for a ball in a round.
constexpr int kTrials = 12;
/// Share of the excess of a ball's stand-out over the mean.
constexpr float kHandicap = 0.6f;

/// Simplices relative to a common point. Float32 is enough for a choice.
struct SimplexBlock {
  float corner[12][kLanes];  ///< x, y and z of each
  float growth[kLanes];
};
/// Best ball of each simplex.
struct OwnerBlock {
  std::int32_t ball[kLanes];
  float need[kLanes], second[kLanes];  ///< by which it has to stand out, and the second best one
};

struct Point {
  float x, y, z;
};

/// Radius of a ball about a point that holds a simplex.
__attribute__((always_inline)) inline float radius_about(const SimplexBlock& s, std::size_t lane, const Point& p) {
  float most = 0;
  for (int k = 0; k < 12; k += 3) {
    const float dx = s.corner[k][lane] - p.x, dy = s.corner[k + 1][lane] - p.y, dz = s.corner[k + 2][lane] - p.z;
    const float d = dx * dx + dy * dy + dz * dz;
    most = d > most ? d : most;
  }
  return __builtin_sqrtf(most) + s.growth[lane];
}

/// Offers a ball to all simplices.
CLEARANCE_CLONES void offer(const SimplexBlock* __restrict simplices, OwnerBlock* __restrict owners, std::size_t blocks,
                            const Point& centre, float inside, std::int32_t ball) {
  const Point c = centre;
  for (std::size_t b = 0; b < blocks; ++b) {
    const SimplexBlock& s = simplices[b];
    OwnerBlock& o = owners[b];
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float need = radius_about(s, k, c) - inside, least = o.need[k], other = need < least ? least : need;
      o.ball[k] = need < least ? ball : o.ball[k];
      o.need[k] = need < least ? need : least;
      o.second[k] = other < o.second[k] ? other : o.second[k];
    }
  }
}

/// Radius of a ball about a point that holds all simplices.
CLEARANCE_CLONES float greatest_radius(const SimplexBlock* __restrict simplices, std::size_t blocks,
                                       const Point& centre) {
  const Point c = centre;
  float most[kLanes] = {};
  for (std::size_t b = 0; b < blocks; ++b)
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float radius = radius_about(simplices[b], k, c);
      most[k] = radius > most[k] ? radius : most[k];
    }
  return *std::max_element(most, most + kLanes);
}

class BallChooser {
 public:
  BallChooser(const CoverShape& shape, std::span<const CoverSimplex> simplices, std::size_t most,
              PortableRandom& random);

  /// The best choice of all rounds.
  std::vector<ChosenBall> choose(int rounds);

 private:
  struct Ball {
    Vec3d centre;
    double inside;           ///< CoverShape::inside(), or 0
    double step;             ///< length of the next trials
    std::uint32_t near = 0;  ///< of CoverShape::inside()
    float stand_out = 0;
    float without = 0;                 ///< least stand-out of the other balls with its simplices
    float handicap = 0;                ///< metres, in the competition for simplices
    std::vector<std::int32_t> held{};  ///< simplices
  };

  static Point rounded(const Vec3d& c) {
    return {static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)};
  }
  static Vec3d as_float(const Vec3d& c) {
    const Point p = rounded(c);
    return {p.x, p.y, p.z};
  }
  Ball ball_about(const Vec3d& c, double step) const {
    const Vec3d centre = as_float(c);
    Ball ball{centre, 0, step};
    ball.inside = inside_of(ball, centre, 0);
    return ball;
  }
  /// CoverShape::inside(), or 0.
  double inside_of(Ball& ball, const Vec3d& c, double enough) const {
    return shape_.has_inside() ? std::max(shape_.inside(c, std::max(enough, 0.0), ball.near), 0.0) : 0;
  }
  /// Gives each simplex to the ball that holds it best. Balls that stand out most get fewer, so that all become equal
  /// sooner.
  void assign();
  /// Moves a ball to where it stands out less.
  void improve(Ball& ball);
  /// A ball between the centre of another and the farthest point that it holds.
  Ball next_to(const Ball& ball) const;
  /// Adds balls, and moves one that the others can replace.
  void spend();

  const CoverShape& shape_;
  const std::size_t most_;
  PortableRandom& random_;
  const Vec3d origin_;  ///< near the simplices
  double size_ = 0;
  const std::size_t count_;
  std::vector<SimplexBlock> all_, held_;  ///< the last lanes repeat a simplex
  std::vector<OwnerBlock> owners_;
  std::vector<Ball> balls_;
};

BallChooser::BallChooser(const CoverShape& shape, std::span<const CoverSimplex> simplices, std::size_t most,
                         PortableRandom& random)
    : shape_(shape), most_(most), random_(random), origin_(simplices[0].corner[0]), count_(simplices.size()) {
  all_.resize((count_ + kLanes - 1) / kLanes);
  owners_.resize(all_.size());
  Vec3d low{0, 0, 0}, high{0, 0, 0};
  for (std::size_t i = 0; i < all_.size() * kLanes; ++i) {
    const CoverSimplex& s = simplices[std::min(i, count_ - 1)];
    SimplexBlock& block = all_[i / kLanes];
    for (int k = 0; k < 4; ++k) {
      const Vec3d p = s.corner[static_cast<std::size_t>(k)] - origin_;
      for (int c = 0; c < 3; ++c) {
        block.corner[3 * k + c][i % kLanes] = static_cast<float>(p[c]);
        low[c] = std::min(low[c], p[c]), high[c] = std::max(high[c], p[c]);
      }
    }
    block.growth[i % kLanes] = static_cast<float>(s.growth);
  }
  size_ = norm(high - low);
  balls_.push_back(ball_about(origin_ + (low + high) * 0.5, 0.25 * size_));
}

void BallChooser::assign() {
  float mean = 0;
  for (const Ball& ball : balls_) mean += std::max(ball.stand_out, 0.0f) / static_cast<float>(balls_.size());
  for (Ball& ball : balls_) ball.handicap = ball.stand_out > 0 ? kHandicap * (ball.stand_out - mean) : 0;
  for (OwnerBlock& block : owners_) {
    std::fill_n(block.need, kLanes, kInfinity);
    std::fill_n(block.second, kLanes, kInfinity);
  }
  for (std::size_t b = 0; b < balls_.size(); ++b) {
    Ball& ball = balls_[b];
    offer(all_.data(), owners_.data(), all_.size(), rounded(ball.centre - origin_),
          static_cast<float>(ball.inside) - ball.handicap, static_cast<std::int32_t>(b));
    ball.held.clear();
    ball.stand_out = ball.without = -kInfinity;
  }
  for (std::size_t i = 0; i < count_; ++i) {
    const OwnerBlock& owner = owners_[i / kLanes];
    Ball& ball = balls_[static_cast<std::size_t>(owner.ball[i % kLanes])];
    ball.held.push_back(static_cast<std::int32_t>(i));
    ball.stand_out = std::max(ball.stand_out, owner.need[i % kLanes] - ball.handicap);
    ball.without = std::max(ball.without, owner.second[i % kLanes]);
  }
}

void BallChooser::improve(Ball& ball) {
  if (ball.held.empty()) return;
  held_.resize((ball.held.size() + kLanes - 1) / kLanes);
  for (std::size_t i = 0; i < held_.size() * kLanes; ++i) {
    const auto from = static_cast<std::size_t>(ball.held[std::min(i, ball.held.size() - 1)]);
    const SimplexBlock& block = all_[from / kLanes];
    for (int c = 0; c < 12; ++c) held_[i / kLanes].corner[c][i % kLanes] = block.corner[c][from % kLanes];
    held_[i / kLanes].growth[i % kLanes] = block.growth[from % kLanes];
  }
  for (int trial = 0; trial < kTrials; ++trial) {
    Vec3d to;
    for (int c = 0; c < 3; ++c) to[c] = ball.centre[c] + ball.step * random_.uniform(-1, 1);
    to = as_float(to);
    const float radius = greatest_radius(held_.data(), held_.size(), rounded(to - origin_));
    const double inside = inside_of(ball, to, double{radius} - ball.stand_out);
    const float stand_out = radius - static_cast<float>(inside);
    ball.step *= stand_out < ball.stand_out ? 1.4 : 0.88;
    if (stand_out < ball.stand_out) ball.stand_out = stand_out, ball.centre = to, ball.inside = inside;
  }
  ball.step = std::max(ball.step, 0x1p-10 * size_);
}

BallChooser::Ball BallChooser::next_to(const Ball& ball) const {
  const Vec3d c = ball.centre - origin_;
  Vec3d far = c;
  double most = -1;
  for (const std::int32_t held : ball.held) {
    const auto i = static_cast<std::size_t>(held);
    const auto& corner = all_[i / kLanes].corner;
    for (int k = 0; k < 12; k += 3) {
      const Vec3d p{corner[k][i % kLanes], corner[k + 1][i % kLanes], corner[k + 2][i % kLanes]};
      if (const double d = squared_norm(p - c); d > most) most = d, far = p;
    }
  }
  return ball_about(ball.centre + (far - c) * 0.6, 0.3 * std::sqrt(std::max(most, 0.0)));
}

void BallChooser::spend() {
  std::vector<std::size_t> order;
  for (std::size_t b = 0; b < balls_.size(); ++b)
    if (!balls_[b].held.empty()) order.push_back(b);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return balls_[a].stand_out > balls_[b].stand_out; });
  std::vector<Ball> next;
  for (const std::size_t b : order) next.push_back(balls_[b]);
  const std::size_t had = next.size();
  for (std::size_t k = 0; k < had && next.size() < most_; ++k)
    if (next[k].held.size() > 1) next.push_back(next_to(next[k]));
  if (had == most_) {
    const auto least = std::min_element(next.begin() + 1, next.end(),
                                        [](const Ball& a, const Ball& b) { return a.without < b.without; });
    if (least->without < 0.95f * next[0].stand_out) *least = next_to(next[0]);
  }
  balls_ = std::move(next);
}

std::vector<ChosenBall> BallChooser::choose(int rounds) {
  std::vector<ChosenBall> best;
  float least = kInfinity;
  for (int round = 0; round < rounds; ++round) {
    assign();
    float greatest = -kInfinity, sum = 0;
    for (Ball& ball : balls_) {
      improve(ball);
      greatest = std::max(greatest, ball.stand_out);
      sum += ball.held.empty() ? 0 : ball.stand_out;
    }
    if (const float width = greatest + sum / static_cast<float>(balls_.size()); width < least) {
      least = width;
      best.clear();
      for (const Ball& ball : balls_)
        if (!ball.held.empty()) best.push_back({ball.centre, ball.inside + greatest});
    }
    spend();
  }
  return best;
}

}  // namespace

std::vector<ChosenBall> choose_balls(const CoverShape& shape, std::span<const CoverSimplex> simplices, std::size_t most,
                                     int rounds, PortableRandom& random) {
  return BallChooser(shape, simplices, most, random).choose(rounds);
}

}  // namespace clearance
