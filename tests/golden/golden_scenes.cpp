#include "tests/golden/golden_scenes.h"

#include <cmath>
#include <limits>
#include <utility>

namespace clearance::golden {

namespace {

// Numbers with few bits, from a xorshift generator (S. Vigna, "An experimental exploration of Marsaglia's xorshift
// generators, scrambled", 2016).
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15ull | 1) {}
  int integer(int low, int high) {
    state_ ^= state_ >> 12;
    state_ ^= state_ << 25;
    state_ ^= state_ >> 27;
    const std::uint64_t bits = state_ * 0x2545F4914F6CDD1Dull;
    return low + static_cast<int>((bits >> 33) % static_cast<unsigned>(high - low + 1));
  }
  /// A multiple of 2^-20.
  double number(double low, double high) { return low + (high - low) * (integer(0, 1 << 20) * 0x1p-20); }
  Vec3d vector(double size) { return {number(-size, size), number(-size, size), number(-size, size)}; }
  /// Rotated by a quaternion of integers, which the engine normalises.
  Pose pose(double room) {
    Pose p{vector(room), 0, 0, 0, 0};
    while (p.qw * p.qw + p.qx * p.qx + p.qy * p.qy + p.qz * p.qz == 0)
      p.qw = integer(-9, 9), p.qx = integer(-9, 9), p.qy = integer(-9, 9), p.qz = integer(-9, 9);
    return p;
  }
  std::vector<Vec3d> points(int count, Vec3d size) {
    std::vector<Vec3d> v;
    for (int i = 0; i < count; ++i)
      v.push_back({number(-size.x, size.x), number(-size.y, size.y), number(-size.z, size.z)});
    return v;
  }
  /// Points on a sphere, up to rounding.
  std::vector<Vec3d> shell(int count, double radius) {
    std::vector<Vec3d> v = points(count, {1, 1, 1});
    for (Vec3d& p : v) p = p * (radius / std::sqrt(dot(p, p) + 0x1p-40));
    return v;
  }

 private:
  std::uint64_t state_;
};

using ConvexParts = std::vector<ConvexPartPtr>;

// Bodies at random poses, in configurations that move two thirds of them; every seventh is static.
template <class MakeParts>
GoldenScene scene_of(const std::string& name, int count, double room, double cut_off, const MakeParts& parts,
                     std::uint64_t seed) {
  GoldenScene g;
  g.name = name;
  g.cut_off = cut_off;
  Dice dice(seed);
  for (int i = 0; i < count; ++i) {
    Body body;
    body.name = "b" + std::to_string(i);
    body.parts = parts(dice, i);
    body.pose = dice.pose(room);
    body.is_static = i % 7 == 6;
    if (!body.is_static && i % 3 != 0) g.moved.push_back(static_cast<std::uint32_t>(i));
    g.scene.add_body(std::move(body));
  }
  for (std::size_t i = 0; i < kConfigurations * g.moved.size(); ++i) {
    g.configurations.push_back(dice.pose(room));
    Pose next = g.configurations.back();
    next.translation += dice.vector(0x1p-7 * room);
    next.qw += 0x1p-5 * dice.integer(-4, 4);
    g.next.push_back(next);
  }
  return g;
}

ConvexPartPtr box(Vec3d half, Vec3d at = {0, 0, 0}) {
  std::vector<Vec3d> v;
  for (int i = 0; i < 8; ++i)
    v.push_back(at + Vec3d{i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z});
  return make_convex_part(std::move(v));
}

ConvexParts clouds(Dice& d, int i) {
  return {make_convex_part(d.points(4 + 3 * i, {0.5, 0.4, 0.3}))};
}

ConvexParts boxes(Dice& d, int) {
  return {box({d.integer(1, 4) * 0.125, d.integer(1, 4) * 0.125, d.integer(1, 4) * 0.125})};
}

ConvexParts rounded(Dice& d, int i) {
  const double radius = d.integer(1, 8) * 0.0625;
  if (i % 3 == 0) return {make_convex_part({{0, 0, 0}}, radius)};
  if (i % 3 == 1) return {make_convex_part({{0, 0, -0.375}, {0, 0, 0.375}}, radius)};
  return {make_convex_part(d.points(9, {0.4, 0.4, 0.4}), radius)};
}

// Needles and plates, with a thickness down to 2^-30 of their length.
ConvexParts slender(Dice& d, int i) {
  const double thin = std::ldexp(1.0, -d.integer(3, 30));
  return {i % 2 ? make_convex_part(d.points(10, {0.8, thin, thin})) : make_convex_part(d.points(10, {0.8, 0.8, thin}))};
}

ConvexParts degenerate(Dice& d, int i) {
  const int kind = i % 4;
  if (kind == 0) return {make_convex_part({d.vector(0.5)})};
  if (kind == 1) return {make_convex_part({{-0.5, 0, 0}, {0.25, 0, 0}, {0.5, 0, 0}, {0.25, 0, 0}})};
  if (kind == 2) return {make_convex_part(d.points(7, {0.6, 0.6, 0}))};
  std::vector<Vec3d> v = d.points(8, {0.4, 0.4, 0.4});
  v.insert(v.end(), v.begin(), v.begin() + 4);  // repeated
  return {make_convex_part(std::move(v))};
}

ConvexParts sizes(Dice& d, int i) {
  const double size = std::ldexp(1.0, -2 * i);
  return {make_convex_part(d.points(12, {size, size, size}), i % 4 == 3 ? size / 8 : 0)};
}

// Parts with more than 64 vertices have a direction table.
ConvexParts large(Dice& d, int i) {
  return {make_convex_part(d.shell(48 << i % 4, 0.5))};
}

ConvexParts several(Dice& d, int i) {
  ConvexParts all;
  for (int p = 0; p < 1 + i % 6 * 3; ++p) {
    const Vec3d at = d.vector(0.6);
    if (p % 2) {
      all.push_back(box({0.125, 0.0625, 0.25}, at));
    } else {
      std::vector<Vec3d> v = d.points(8 + (p == 4 ? 70 : p), {0.2, 0.2, 0.2});
      for (Vec3d& x : v) x += at;
      all.push_back(make_convex_part(std::move(v), p % 4 == 2 ? 0.03125 : 0));
    }
  }
  return all;
}

// Axis-aligned boxes in a row: faces touch exactly, are 2^-40 apart, or overlap by as much.
GoldenScene contacts() {
  GoldenScene g = scene_of("contacts", 14, 1, 0.5, [](Dice&, int) { return ConvexParts{box({0.25, 0.25, 0.25})}; }, 71);
  Dice dice(72);
  const auto in_row = [&](std::vector<Pose>& poses) {
    for (Pose& p : poses) {
      const double off = dice.integer(-1, 1) * 0x1p-40;
      p = Pose{{0.5 * dice.integer(-3, 3) + off, 0.5 * dice.integer(-1, 1), 0.25 * dice.integer(0, 1)}};
    }
  };
  in_row(g.configurations);
  in_row(g.next);
  return g;
}

// Parents, invalid or missing poses, and a quaternion far from unit length.
GoldenScene family() {
  GoldenScene g;
  g.name = "family";
  g.cut_off = 1;
  Dice dice(81);
  for (int i = 0; i < 14; ++i) {
    Body body;
    body.name = "b" + std::to_string(i);
    body.parts = clouds(dice, i);
    body.pose = dice.pose(i >= 8 ? 0.5 : 1.5);
    if (i >= 8) body.parent = static_cast<std::uint32_t>(i - 7);
    if (i == 6) body.pose.reset();
    if (i == 7) body.is_static = true;
    if (i < 4) g.moved.push_back(static_cast<std::uint32_t>(i));
    g.scene.add_body(std::move(body));
  }
  for (std::size_t i = 0; i < kConfigurations * g.moved.size(); ++i) {
    g.configurations.push_back(dice.pose(1.5));
    g.next.push_back(dice.pose(1.5));
  }
  g.configurations[5].qx = std::numeric_limits<double>::quiet_NaN();
  g.next[9].qw = std::numeric_limits<double>::infinity();
  return g;
}

}  // namespace

std::vector<GoldenScene> golden_scenes() {
  std::vector<GoldenScene> all;
  all.push_back(scene_of("clouds", 14, 1.5, 1, clouds, 1));
  all.push_back(scene_of("boxes", 14, 1, 0.75, boxes, 2));
  all.push_back(scene_of("rounded", 14, 1.5, 1, rounded, 3));
  all.push_back(scene_of("slender", 14, 0.75, 0.5, slender, 4));
  all.push_back(scene_of("degenerate", 14, 1, 0.75, degenerate, 5));
  all.push_back(scene_of("sizes", 14, 1, 0.75, sizes, 6));
  all.push_back(scene_of("deep", 14, 0.125, 0.0625, clouds, 7));
  all.push_back(scene_of("far", 14, 0x1p24, 0x1p23, clouds, 8));
  all.push_back(scene_of("large", 14, 1.25, 1, large, 9));
  all.push_back(scene_of("several", 12, 1.75, 1, several, 10));
  all.push_back(scene_of("clouds_apart", 14, 5, 3, clouds, 11));
  all.push_back(scene_of("several_apart", 12, 6, 3, several, 12));
  all.push_back(contacts());
  all.push_back(family());
  return all;
}

}  // namespace clearance::golden
