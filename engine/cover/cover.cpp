#include "engine/cover/cover.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "engine/base/fp_environment.h"
#include "engine/cover/choose_balls.h"
#include "engine/cover/cover_shape.h"
#include "engine/cover/cover_simplices.h"
#include "wire/types.h"

namespace clearance {

namespace {

/// How the share of a ball is divided into those of its children.
struct LevelRule {
  std::size_t children;
  double edge_of_radius;  ///< the choice sees simplices whose edges are at most this share of the parent's radius
  std::size_t simplices;  ///< by which a share may exceed its parent's
  int rounds;             ///< of the choice

  LevelRule with(double effort) const {
    return {children, edge_of_radius,
            std::max<std::size_t>(50, static_cast<std::size_t>(effort * static_cast<double>(simplices))),
            std::max(6, static_cast<int>(effort * rounds))};
  }
};
constexpr std::array<LevelRule, Cover::kLevels - 1> kRules{{{2 * BallPacket::kBalls, 0.055, 40000, 50},
                                                            {BallPacket::kBalls, 0.24, 4000, 40},
                                                            {BallPacket::kBalls, 0.24, 1000, 16}}};

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

/// Width of the bounds that a ball gives.
double width_of(double outer, double inner) {
  return outer - std::max(inner, 0.0);
}

/// A ball with its share of the body.
struct Node {
  CoverBall ball;
  std::vector<CoverSimplex> share;
  std::size_t packet = 0;  ///< its place among the packets
  int lane = 0;
};

/// The ball about `c`, rounded, for a share.
Node node_of(const CoverShape& shape, const Vec3d& c, std::vector<CoverSimplex> share) {
  Node node{{{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z)}, 0, 0}, std::move(share)};
  const Vec3d centre = centre_of(node.ball);
  double outer = 0;
  for (const CoverSimplex& s : node.share) outer = std::max(outer, radius_for(s, centre));
  node.ball.outer = up(outer * kCoverUp);
  node.ball.inner = down(shape.inside(centre));
  return node;
}

/// About the centre of the smallest ball around the simplices.
Vec3d middle_of(std::span<const CoverSimplex> simplices) {
  Vec3d c = simplices[0].corner[0];
  for (int step = 1; step < 300; ++step) {
    Vec3d far = c;
    double most = -1;
    for (const CoverSimplex& s : simplices)
      for (const Vec3d& corner : s.corner)
        if (const double d = squared_norm(corner - c); d > most) most = d, far = corner;
    c += (far - c) * (1.0 / (step + 1));
  }
  return c;
}

/// Shares for new balls.
std::vector<Node> children_of(const CoverShape& shape, const Node& parent, const LevelRule& rule,
                              PortableRandom& random) {
  const double edge = rule.edge_of_radius * parent.ball.outer;
  const std::size_t most = parent.share.size() + rule.simplices;
  const std::vector<ChosenBall> balls =
      choose_balls(shape, divided(parent.share, edge, most), rule.children, rule.rounds, random);
  auto shares = distribute(parent.share, balls, 0.03 * edge, most);
  std::vector<Node> children;
  for (std::size_t k = 0; k < balls.size(); ++k)
    if (!shares[k].empty()) children.push_back(node_of(shape, balls[k].centre, std::move(shares[k])));
  return children;
}

/// Appends balls to a cover, in packets.
void append(Cover& cover, std::span<Node> nodes) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const int lane = static_cast<int>(i % BallPacket::kBalls);
    if (lane == 0) {
      BallPacket& packet = cover.packets.emplace_back();
      packet.count = 0;
      std::fill_n(packet.x, BallPacket::kBalls, 0.0f);
      std::fill_n(packet.y, BallPacket::kBalls, 0.0f);
      std::fill_n(packet.z, BallPacket::kBalls, 0.0f);
      std::fill_n(packet.outer, BallPacket::kBalls, BallPacket::kNoRadius);
      std::fill_n(packet.inner, BallPacket::kBalls, BallPacket::kNoRadius);
      std::fill_n(packet.children, BallPacket::kBalls, kNone);
    }
    BallPacket& packet = cover.packets.back();
    const CoverBall& ball = nodes[i].ball;
    packet.x[lane] = ball.centre[0], packet.y[lane] = ball.centre[1], packet.z[lane] = ball.centre[2];
    packet.outer[lane] = ball.outer, packet.inner[lane] = ball.inner;
    ++packet.count;
    nodes[i].packet = cover.packets.size() - 1, nodes[i].lane = lane;
    cover.reach = std::max(cover.reach, norm(centre_of(ball)) * kCoverUp);
  }
}

}  // namespace

void Cover::find_spread() {
  const Vec3d middle = centre_of(root);
  spread = root.outer;
  for (const BallPacket& packet : packets)
    for (std::uint32_t i = 0; i < packet.count; ++i)
      spread = std::max(spread, norm(Vec3d{packet.x[i], packet.y[i], packet.z[i]} - middle) * (1 + 0x1p-48));
}

std::optional<Cover> make_cover(std::span<const ConvexPartPtr> parts, const std::atomic<bool>* stopped, double effort) {
  const FpEnvironment environment;
  const std::optional<CoverShape> shape = CoverShape::of(parts);
  if (!shape) return {};
  PortableRandom random(1);
  std::vector<Node> level;
  level.push_back(node_of(*shape, middle_of(shape->simplices()), shape->simplices()));
  Cover cover;
  cover.root = level[0].ball;
  cover.reach = std::max(shape->reach(), norm(centre_of(cover.root)) * kCoverUp);
  // Narrower than roundings of float32: such balls are not divided.
  const double narrow = std::max(0x1p-20 * shape->reach(), double{std::numeric_limits<float>::min()});
  for (int k = 1; k < Cover::kLevels; ++k) {
    std::vector<Node> next;
    for (Node& parent : level) {
      if (stopped && *stopped) return {};
      if (k > 1 && width_of(parent.ball.outer, parent.ball.inner) <= narrow) continue;
      std::vector<Node> children = children_of(*shape, parent, kRules[k - 1].with(effort), random);
      if (k > 1) cover.packets[parent.packet].children[parent.lane] = static_cast<std::uint32_t>(cover.packets.size());
      append(cover, children);
      std::move(children.begin(), children.end(), std::back_inserter(next));
      parent.share = {};
    }
    level = std::move(next);
    cover.level_begin[k + 1] = static_cast<std::uint32_t>(cover.packets.size());
  }
  cover.find_spread();
  return cover;
}

StandOut stand_out(const Cover& cover, int level) {
  StandOut result;
  const auto add = [&](double outer, double inner) {
    const double width = width_of(outer, inner);
    result.greatest = std::max(result.greatest, width);
    result.mean += width;
    ++result.balls;
  };
  if (level == 0)
    add(cover.root.outer, cover.root.inner);
  else
    for (const BallPacket& packet : cover.level(level))
      for (std::uint32_t i = 0; i < packet.count; ++i) add(packet.outer[i], packet.inner[i]);
  if (result.balls > 0) result.mean /= static_cast<double>(result.balls);
  return result;
}

std::vector<CoverBall> cut_at(const Cover& cover, int level) {
  if (level == 0) return {cover.root};
  std::vector<CoverBall> balls;
  for (int k = 1; k <= level; ++k)
    for (const BallPacket& packet : cover.level(k))
      for (std::uint32_t i = 0; i < packet.count; ++i)
        if (k == level || packet.children[i] == kNone)
          balls.push_back({{packet.x[i], packet.y[i], packet.z[i]}, packet.outer[i], packet.inner[i]});
  return balls;
}

}  // namespace clearance
