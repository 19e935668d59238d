#include "tests/oracle/cases/mesh_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "tests/oracle/cases/case_shapes.h"

namespace clearance::exact {

namespace {

constexpr double kPi = std::numbers::pi;

/// Two triangles, counterclockwise seen from outside; none with a repeated vertex.
void add_quad(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  if (a != b && b != c && c != a) mesh.triangles.push_back({a, b, c});
  if (a != c && c != d && d != a) mesh.triangles.push_back({a, c, d});
}

std::size_t pick(Random& random, std::size_t count) {
  return static_cast<std::size_t>(random.integer(0, static_cast<int>(count) - 1));
}

/// Rotated around x by a right angle: z upward becomes -y.
Mesh upright(Mesh mesh) {
  for (Vec3d& v : mesh.vertices) v = {v.x, -v.z, v.y};
  return mesh;
}

}  // namespace

SolidPtr solid(Mesh mesh, bool is_solid, double radius) {
  return std::make_shared<const Solid>(Solid{std::move(mesh.vertices), radius, std::move(mesh.triangles), is_solid});
}

SolidPtr cloud(std::vector<CloudPoint> points, float voxel, double radius) {
  Mesh mesh;
  for (const auto& [x, y, z] : points) {
    const double half = 0.5 * double{voxel};
    if (voxel > 0) {
      append(mesh, moved(box_mesh({half, half, half}), {x, y, z}));
      continue;
    }
    const auto at = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back({x, y, z});
    mesh.triangles.push_back({at, at, at});
  }
  return std::make_shared<const Solid>(
      Solid{std::move(mesh.vertices), radius, std::move(mesh.triangles), voxel > 0, std::move(points), voxel});
}

Mesh scaled(Mesh mesh, Vec3d s) {
  mesh.vertices = scaled(std::move(mesh.vertices), s);
  return mesh;
}
Mesh moved(Mesh mesh, Vec3d t) {
  for (Vec3d& v : mesh.vertices) v += t;
  return mesh;
}
Mesh flipped(Mesh mesh) {
  for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
  return mesh;
}

void append(Mesh& mesh, const Mesh& part) {
  const auto before = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const Triangle& t : part.triangles) mesh.triangles.push_back({t[0] + before, t[1] + before, t[2] + before});
}

void split(Random& random, Mesh& mesh, int count, double off) {
  for (int i = 0; i < count; ++i) {
    const std::size_t at = pick(random, mesh.triangles.size());
    const Triangle t = mesh.triangles[at];
    const double along = random.uniform(0.1, 0.9);
    const Vec3d &p = mesh.vertices[t[0]], &q = mesh.vertices[t[1]], &r = mesh.vertices[t[2]];
    const Vec3d middle = off * p + (1 - off) * (along * q + (1 - along) * r);
    const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back(middle);
    mesh.triangles[at] = {t[0], t[1], n};
    mesh.triangles.push_back({t[1], t[2], n});
    mesh.triangles.push_back({t[2], t[0], n});
  }
}

void shake(Random& random, Mesh& mesh, double length) {
  for (Vec3d& v : mesh.vertices) v += random.direction() * (length * random.uniform());
}

Mesh cracked(Random& random, const Mesh& mesh, double length) {
  Mesh out;
  for (const Triangle& t : mesh.triangles) {
    if (random.chance(0.1)) continue;
    const auto n = static_cast<std::uint32_t>(out.vertices.size());
    for (const std::uint32_t i : t)
      out.vertices.push_back(mesh.vertices[i] + random.direction() * (length * random.uniform()));
    out.triangles.push_back({n, n + 1, n + 2});
  }
  return out.triangles.empty() ? mesh : out;
}

Mesh box_mesh(Vec3d half) {
  Mesh mesh{box(half), {}};
  add_quad(mesh, 0, 4, 6, 2);
  add_quad(mesh, 1, 3, 7, 5);
  add_quad(mesh, 0, 1, 5, 4);
  add_quad(mesh, 2, 6, 7, 3);
  add_quad(mesh, 0, 2, 3, 1);
  add_quad(mesh, 4, 5, 7, 6);
  return mesh;
}

Mesh band(std::span<const Point2> left, std::span<const Point2> right, double height) {
  Mesh mesh;
  for (std::size_t i = 0; i < left.size(); ++i)
    for (const double z : {0.0, height}) {
      mesh.vertices.push_back({left[i].x, left[i].y, z});
      mesh.vertices.push_back({right[i].x, right[i].y, z});
    }
  const auto last = static_cast<std::uint32_t>(4 * (left.size() - 1));
  // At each point: left and right below, left and right above.
  for (std::uint32_t i = 0; i < last; i += 4) {
    add_quad(mesh, i + 3, i + 7, i + 6, i + 2);
    add_quad(mesh, i, i + 4, i + 5, i + 1);
    add_quad(mesh, i, i + 2, i + 6, i + 4);
    add_quad(mesh, i + 1, i + 5, i + 7, i + 3);
  }
  add_quad(mesh, 0, 1, 3, 2);
  add_quad(mesh, last + 1, last, last + 2, last + 3);
  return mesh;
}

Mesh bent_bar(std::span<const Point2> path, double width, double height) {
  const auto normal = [&](std::size_t i) {  // of the stretch from i to i + 1, to the left
    const Point2 d{path[i + 1].x - path[i].x, path[i + 1].y - path[i].y};
    const double length = std::hypot(d.x, d.y);
    return Point2{-d.y / length, d.x / length};
  };
  std::vector<Point2> left, right;
  for (std::size_t i = 0; i < path.size(); ++i) {
    Point2 n = normal(i == 0 ? 0 : i - 1);
    if (i > 0 && i + 1 < path.size()) n = {n.x + normal(i).x, n.y + normal(i).y};
    left.push_back({path[i].x + 0.5 * width * n.x, path[i].y + 0.5 * width * n.y});
    right.push_back({path[i].x - 0.5 * width * n.x, path[i].y - 0.5 * width * n.y});
  }
  return band(left, right, height);
}

Mesh revolved(std::span<const Point2> profile, int sides) {
  Mesh mesh;
  std::vector<std::vector<std::uint32_t>> rings;
  for (const Point2& p : profile) {
    std::vector<std::uint32_t>& ring = rings.emplace_back();
    for (int k = 0; k <= sides; ++k) {
      if (k == sides || (p.x == 0 && k > 0)) {
        ring.push_back(ring.front());
        continue;
      }
      ring.push_back(static_cast<std::uint32_t>(mesh.vertices.size()));
      mesh.vertices.push_back({p.x * std::cos(2 * kPi * k / sides), p.x * std::sin(2 * kPi * k / sides), p.y});
    }
  }
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const auto &low = rings[i], &high = rings[(i + 1) % profile.size()];
    if (profile[i].x == 0 && profile[(i + 1) % profile.size()].x == 0) continue;  // along the axis
    for (std::size_t k = 0; k < static_cast<std::size_t>(sides); ++k)
      add_quad(mesh, low[k], low[k + 1], high[k + 1], high[k]);
  }
  return mesh;
}

Mesh bent(Random& random) {
  const double width = random.uniform(0.1, 0.3), height = random.uniform(0.1, 0.5), x = random.uniform(0.5, 1),
               y = random.uniform(0.5, 1);
  std::vector<Point2> path{{0, y}, {0, 0}, {x, 0}};
  if (random.chance(0.6)) path.push_back({x, random.uniform(0.3, 1)});
  if (path.size() == 4 && random.chance(0.3)) path.push_back({2 * x, path.back().y});
  return bent_bar(path, width, height);
}

Mesh shelf(Random& random) {
  const double depth = random.uniform(0.2, 0.5), board = random.uniform(0.01, 0.05);
  const int rows = random.integer(1, 3), columns = random.integer(1, 3);
  const double over = random.chance(0.5) ? board : 0;  // boards end in each other, or flush
  Mesh mesh = moved(box_mesh({1 + board, board, 1 + board}), {0, depth + board - over, 0});
  for (int i = 0; i <= rows; ++i) append(mesh, moved(box_mesh({1 + board, depth, board}), {0, 0, -1 + 2.0 * i / rows}));
  for (int i = 0; i <= columns; ++i)
    append(mesh, moved(box_mesh({board, depth, 1 - board + over}), {-1 + 2.0 * i / columns, 0, 0}));
  return mesh;
}

Mesh ring(Random& random) {
  const double thick = random.uniform(0.05, 0.4);
  const int around = random.integer(3, 6);
  std::vector<Point2> profile;
  for (int i = 0; i < around; ++i)
    profile.push_back({1 + thick * std::cos(2 * kPi * i / around), thick * std::sin(2 * kPi * i / around)});
  return revolved(profile, random.integer(3, 12));
}

Mesh mug(Random& random) {
  const double wall = random.uniform(0.02, 0.15), r = random.uniform(0.4, 0.8), h = random.uniform(0.5, 1.5);
  const std::vector<Point2> cup{{0, 0}, {r, 0}, {r, h}, {r - wall, h}, {r - wall, wall}, {0, wall}};
  const int sides = random.integer(4, 9);
  Mesh mesh = revolved(cup, sides);
  // The handle begins and ends within the wall, at a vertex of its polygon.
  std::vector<Point2> outer, inner;
  for (int i = 0; i <= 5; ++i) {
    const double turn = kPi * (i / 5.0 - 0.5), c = std::cos(turn), s = std::sin(turn);
    outer.push_back({r - 0.5 * wall + 0.45 * h * c, 0.5 * h + 0.45 * h * s});
    inner.push_back({r - 0.5 * wall + 0.3 * h * c, 0.5 * h + 0.3 * h * s});
  }
  append(mesh, moved(upright(band(inner, outer, 0.1)), {0, 0.05, 0}));
  return mesh;
}

Mesh spiral(Random& random) {
  const int count = random.integer(8, 30);
  const double turn = random.uniform(0.3, 0.7), pitch = random.uniform(0.1, 0.3),
               width = pitch * random.uniform(0.3, 0.95), rise = random.chance(0.5) ? 0 : random.uniform(0, 0.05);
  std::vector<Point2> left, right;
  for (int i = 0; i < count; ++i) {
    const double at = turn * i, r = 0.1 + pitch * at / (2 * kPi), c = std::cos(at), s = std::sin(at);
    left.push_back({r * c, r * s});
    right.push_back({(r + width) * c, (r + width) * s});
  }
  Mesh mesh = band(left, right, random.uniform(0.1, 0.5));
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) mesh.vertices[i].z += rise * static_cast<double>(i / 4);
  return mesh;
}

Mesh comb(Random& random, double gap) {
  const int teeth = random.integer(2, 6);
  const double width = random.uniform(0.05, 0.2), length = random.uniform(0.3, 1), step = width + gap;
  if (random.chance(0.5)) {
    std::vector<Point2> path;
    for (int i = 0; i < teeth; ++i) {
      path.push_back({step * i, i % 2 == 0 ? 0 : length});
      path.push_back({step * i, i % 2 == 0 ? length : 0});
    }
    return bent_bar(path, width, 0.3);
  }
  Mesh mesh = box_mesh({0.5 * step * teeth, width, 0.15});
  for (int i = 0; i < teeth; ++i)
    append(mesh, moved(box_mesh({0.5 * width, 0.5 * length, 0.1}), {step * (i - 0.5 * (teeth - 1)), 0.5 * length, 0}));
  return mesh;
}

Mesh ball(Random& random) {
  const int rows = random.integer(3, 6);
  std::vector<Point2> profile;
  for (int i = 0; i <= rows; ++i) {
    const double turn = kPi * (static_cast<double>(i) / rows - 0.5);
    const double r = random.chance(0.3) ? random.uniform(0.3, 0.8) : 1;
    profile.push_back({i == 0 || i == rows ? 0 : r * std::cos(turn), r * std::sin(turn)});
  }
  return revolved(profile, random.integer(3, 9));
}

Mesh cells(Random& random, double step) {
  const int size[3] = {random.integer(1, 3), random.integer(1, 3), random.integer(1, 3)};
  std::vector<char> is_full(27, 0);
  const auto at = [&](std::array<int, 3> c) -> char* {
    for (std::size_t k = 0; k < 3; ++k)
      if (c[k] < 0 || c[k] >= size[k]) return nullptr;
    return &is_full[static_cast<std::size_t>(9 * c[0] + 3 * c[1] + c[2])];
  };
  const auto each = [&](auto&& f) {
    for (int x = 0; x < size[0]; ++x)
      for (int y = 0; y < size[1]; ++y)
        for (int z = 0; z < size[2]; ++z) f(std::array<int, 3>{x, y, z});
  };
  each([&](std::array<int, 3> c) { *at(c) = random.chance(0.6); });
  *at({0, 0, 0}) = 1;
  Mesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> known;
  const auto vertex = [&](std::array<int, 3> p) {
    const auto [it, is_new] = known.emplace(p, static_cast<std::uint32_t>(mesh.vertices.size()));
    if (is_new) mesh.vertices.push_back({step * p[0], step * p[1], step * p[2]});
    return it->second;
  };
  each([&](std::array<int, 3> c) {
    if (!*at(c)) return;
    for (std::size_t k = 0; k < 3; ++k)
      for (const int side : {0, 1}) {
        std::array<int, 3> beside = c;
        beside[k] += 2 * side - 1;
        if (const char* other = at(beside); other && *other) continue;
        std::array<int, 3> p = c;
        p[k] += side;
        std::array<std::uint32_t, 4> corner;
        const std::size_t u = (k + 1) % 3, v = (k + 2) % 3;
        for (std::size_t i = 0; i < 4; ++i) {
          std::array<int, 3> q = p;
          q[u] += i == 1 || i == 2;
          q[v] += i >= 2;
          corner[i] = vertex(q);
        }
        if (side == 0) std::swap(corner[1], corner[3]);
        add_quad(mesh, corner[0], corner[1], corner[2], corner[3]);
      }
  });
  return mesh;
}

Mesh plate(Random& random, double thickness) {
  const std::vector<Point2> path{{0, random.uniform(0.3, 1)}, {0, 0}, {random.uniform(0.3, 1), 0}};
  return bent_bar(path, thickness, random.uniform(0.3, 1));
}

Mesh any_mesh(Random& random) {
  switch (random.integer(0, 7)) {
    case 0:
      return bent(random);
    case 1:
      return shelf(random);
    case 2:
      return ring(random);
    case 3:
      return mug(random);
    case 4:
      return spiral(random);
    case 5:
      return comb(random, random.uniform(0.01, 0.2));
    case 6:
      return ball(random);
    default:
      return cells(random, 0.4);
  }
}

}  // namespace clearance::exact
