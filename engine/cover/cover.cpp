#include "engine/cover/cover.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/fp_environment.h"
#include "engine/cover/choose_balls.h"
#include "engine/cover/cover_shape.h"

namespace clearance {

namespace {

constexpr double kUp = 1 + 0x1p-48;

/// How the shares of one level are divided into those of the next.
struct LevelRule {
  std::size_t children;
  double edge_of_parent;  ///< simplices are divided until their edges are at most this share of the parent's radius
  std::size_t candidates, samples;
};
constexpr std::array<LevelRule, Cover::kLevels - 1> kRules{
    {{16, 0.18, 1500, 2600}, {8, 0.3, 700, 1500}, {8, 0.3, 280, 600}}};

double longest_edge(const CoverSimplex& s, int* from = nullptr, int* to = nullptr) {
  double most = -1;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j)
      if (const double d = squared_norm(s.corner[i] - s.corner[j]); d > most) {
        most = d;
        if (from) *from = i, *to = j;
      }
  return std::sqrt(most);
}

/// Halves a simplex at its longest edge. The rounding of the midpoint is charged to the growth of both.
std::array<CoverSimplex, 2> halves(const CoverSimplex& s) {
  int i = 0, j = 1;
  longest_edge(s, &i, &j);
  const Vec3d middle = (s.corner[i] + s.corner[j]) * 0.5;
  std::array<CoverSimplex, 2> two{s, s};
  two[0].corner[i] = two[1].corner[j] = middle;
  for (CoverSimplex& half : two) half.growth = (s.growth + 0x1p-50 * norm(middle)) * kUp;
  return two;
}

std::vector<CoverSimplex> divided(std::vector<CoverSimplex> pending, double edge) {
  std::vector<CoverSimplex> done;
  while (!pending.empty()) {
    const CoverSimplex s = pending.back();
    pending.pop_back();
    if (longest_edge(s) <= edge) {
      done.push_back(s);
      continue;
    }
    for (const CoverSimplex& half : halves(s)) pending.push_back(half);
  }
  return done;
}

/// Radius that a ball about `c` needs to hold the body around a simplex.
double radius_for(const CoverSimplex& s, const Vec3d& c) {
  double most = 0;
  for (const Vec3d& corner : s.corner) most = std::max(most, squared_norm(corner - c));
  return std::sqrt(most) * kUp + s.growth;
}

Vec3d centre_of(const CoverBall& ball) {
  return {ball.centre[0], ball.centre[1], ball.centre[2]};
}

float up(double value) {
  const float rounded = static_cast<float>(value);
  return rounded < value ? std::nextafterf(rounded, std::numeric_limits<float>::infinity()) : rounded;
}
float down(double value) {
  return -up(-value);
}

/// A ball with its share of the body.
struct Node {
  CoverBall ball;
  std::vector<CoverSimplex> share;
};

/// The ball about `c`, rounded, for a share.
Node node_of(const CoverShape& shape, const Vec3d& c, std::vector<CoverSimplex> share) {
  Node node{{{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)}, 0, 0}, std::move(share)};
  const Vec3d centre = centre_of(node.ball);
  double outer = 0;
  for (const CoverSimplex& s : node.share) outer = std::max(outer, radius_for(s, centre));
  node.ball.outer = up(outer * kUp);
  node.ball.inner = down(shape.inside(centre));
  return node;
}

/// About the centre of the smallest ball around the simplices.
Vec3d middle_of(std::span<const CoverSimplex> simplices) {
  Vec3d c = simplices[0].corner[0];
  for (int step = 1; step < 1000; ++step) {
    Vec3d far = c;
    double most = -1;
    for (const CoverSimplex& s : simplices)
      for (const Vec3d& corner : s.corner)
        if (const double d = squared_norm(corner - c); d > most) most = d, far = corner;
    c += (far - c) * (1.0 / (step + 1));
  }
  return c;
}

/// Distributes simplices over balls, dividing those that no ball holds. Small ones go to the ball that grows least.
std::vector<std::vector<CoverSimplex>> distribute(std::vector<CoverSimplex> pending, std::span<const ChosenBall> balls,
                                                  double least_edge) {
  std::vector<std::vector<CoverSimplex>> shares(balls.size());
  while (!pending.empty()) {
    const CoverSimplex s = pending.back();
    pending.pop_back();
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < balls.size(); ++k)
      if (const double lack = radius_for(s, balls[k].centre) - balls[k].radius; lack < least) least = lack, best = k;
    if (least <= 0 || longest_edge(s) <= least_edge) {
      shares[best].push_back(s);
      continue;
    }
    for (const CoverSimplex& half : halves(s)) pending.push_back(half);
  }
  return shares;
}

std::vector<Node> children_of(const CoverShape& shape, const Node& parent, const LevelRule& rule,
                              PortableRandom& random) {
  const double edge = rule.edge_of_parent * parent.ball.outer;
  std::vector<CoverSimplex> pieces = divided(parent.share, edge);
  const std::vector<ChosenBall> balls =
      choose_balls(shape, pieces, {rule.children, rule.candidates, rule.samples, edge}, random);
  std::vector<std::vector<CoverSimplex>> shares = distribute(std::move(pieces), balls, edge / 3);
  std::vector<Node> children;
  for (std::size_t k = 0; k < balls.size(); ++k)
    if (!shares[k].empty()) children.push_back(node_of(shape, balls[k].centre, std::move(shares[k])));
  return children;
}

}  // namespace

std::optional<Cover> make_cover(std::span<const ConvexPartPtr> parts) {
  const FpEnvironment environment;
  const std::optional<CoverShape> shape = CoverShape::of(parts);
  if (!shape) return {};
  PortableRandom random(1);
  std::vector<Node> level;
  level.push_back(node_of(*shape, middle_of(shape->simplices()), shape->simplices()));
  Cover cover;
  cover.balls.push_back(level[0].ball);
  cover.level_begin = {0, 1};
  for (int k = 1; k < Cover::kLevels; ++k) {
    std::vector<Node> next;
    for (const Node& parent : level) {
      cover.first_child.push_back(static_cast<std::uint32_t>(cover.balls.size()));
      for (Node& child : children_of(*shape, parent, kRules[k - 1], random)) {
        cover.balls.push_back(child.ball);
        next.push_back(std::move(child));
      }
    }
    level = std::move(next);
    cover.level_begin[k + 1] = static_cast<std::uint32_t>(cover.balls.size());
  }
  cover.first_child.resize(cover.balls.size() + 1, static_cast<std::uint32_t>(cover.balls.size()));
  return cover;
}

StandOut stand_out(const Cover& cover, int level) {
  StandOut result;
  for (const CoverBall& ball : cover.level(level)) {
    const double width = double{ball.outer} - std::max(double{ball.inner}, 0.0);
    result.greatest = std::max(result.greatest, width);
    result.mean += width / static_cast<double>(cover.level(level).size());
  }
  return result;
}

std::uint64_t Cover::resident_bytes() const {
  return sizeof *this + balls.capacity() * sizeof(CoverBall) + first_child.capacity() * sizeof(std::uint32_t);
}

}  // namespace clearance
