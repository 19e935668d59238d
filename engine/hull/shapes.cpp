#include "engine/hull/shapes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/base/double_double.h"

namespace clearance {

namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();

// Taylor series in double-double for 0 <= a <= pi/4; the first omitted term is below 2^-106.
void sin_cos_series(const DoubleDouble& a, double* sine, double* cosine) {
  const DoubleDouble minus_a2 = -(a * a);
  DoubleDouble s = a, c = 1.0, term_s = a, term_c = 1.0;
  for (int i = 1; i <= 14; ++i) {
    term_c = term_c * minus_a2 / DoubleDouble((2.0 * i - 1) * (2.0 * i));
    term_s = term_s * minus_a2 / DoubleDouble((2.0 * i) * (2.0 * i + 1));
    c += term_c;
    s += term_s;
  }
  *sine = s.hi;
  *cosine = c.hi;
}

// Two rings of n vertices, `lower` and `upper` counted from their first vertex, joined by a band of outward faces.
void add_band(std::vector<Triangle>* faces, std::uint32_t lower, std::uint32_t upper, std::uint32_t n) {
  for (std::uint32_t j = 0; j < n; ++j) {
    const std::uint32_t j1 = (j + 1) % n;
    faces->push_back({lower + j, lower + j1, upper + j1});
    faces->push_back({lower + j, upper + j1, upper + j});
  }
}

}  // namespace

void sin_cos_pi(std::uint32_t k, std::uint32_t n, double* sine, double* cosine) {
  const std::uint64_t eighths = 4 * std::uint64_t{k};
  const std::uint64_t octant = eighths / n % 8;
  std::uint64_t rest = eighths % n;  // the angle within its octant is (pi / 4) rest / n
  if (octant % 2) rest = n - rest;   // counted from the nearest axis
  const DoubleDouble pi_4(0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55);
  double s, c;
  sin_cos_series(pi_4 * DoubleDouble(double(rest)) / DoubleDouble(double(n)), &s, &c);
  const bool swapped = octant == 1 || octant == 2 || octant == 5 || octant == 6;  // nearest to the y axis
  *sine = swapped ? c : s;
  *cosine = swapped ? s : c;
  if (octant >= 4) *sine = -*sine;
  if (octant >= 2 && octant <= 5) *cosine = -*cosine;
}

Shape make_uv_sphere(double radius, int resolution) {
  const auto rings = static_cast<std::uint32_t>(resolution);
  const std::uint32_t around = 2 * rings;
  std::vector<double> sine(around), cosine(around);
  for (std::uint32_t j = 0; j < around; ++j) sin_cos_pi(j, rings, &sine[j], &cosine[j]);

  Shape shape;
  shape.vertices.reserve(std::size_t{around} * (rings - 1) + 2);
  shape.vertices.push_back({0, 0, radius});
  shape.vertices.push_back({0, 0, -radius});
  for (std::uint32_t i = 1; i < rings; ++i)
    for (std::uint32_t j = 0; j < around; ++j)
      shape.vertices.push_back({sine[i] * cosine[j] * radius, sine[i] * sine[j] * radius, cosine[i] * radius});

  const auto ring = [&](std::uint32_t i) { return 2 + around * (i - 1); };
  shape.triangles.reserve(std::size_t{around} * 2 * (rings - 1));
  for (std::uint32_t j = 0; j < around; ++j) {
    const std::uint32_t j1 = (j + 1) % around;
    shape.triangles.push_back({0, ring(1) + j, ring(1) + j1});
    shape.triangles.push_back({1, ring(rings - 1) + j1, ring(rings - 1) + j});
  }
  for (std::uint32_t i = 1; i + 1 < rings; ++i) add_band(&shape.triangles, ring(i + 1), ring(i), around);
  return shape;
}

Shape make_box(const Vec3d& size) {
  Shape shape;
  for (int i = 0; i < 8; ++i)
    shape.vertices.push_back(
        {(i & 1 ? 0.5 : -0.5) * size.x, (i & 2 ? 0.5 : -0.5) * size.y, (i & 4 ? 0.5 : -0.5) * size.z});
  shape.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                     {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return shape;
}

Shape make_sphere(double radius) {
  Shape shape;
  shape.vertices = {{0, 0, 0}};
  shape.radius = radius;
  return shape;
}

Shape make_capsule(double radius, double length) {
  Shape shape;
  shape.vertices = {{0, 0, -0.5 * length}, {0, 0, 0.5 * length}};
  if (length == 0) shape.vertices.resize(1);
  shape.radius = radius;
  return shape;
}

Shape make_cylinder(double radius, double length) {
  constexpr std::uint32_t n = kCylinderSides;
  double sine, cosine;
  sin_cos_pi(1, n, &sine, &cosine);
  const double corner =
      radius / cosine * (1 + 8 * kEps);  // the padding exceeds every rounding: the prism contains the cylinder
  Shape shape;
  for (const double z : {-0.5 * length, 0.5 * length})
    for (std::uint32_t j = 0; j < n; ++j) {
      sin_cos_pi(2 * j, n, &sine, &cosine);
      shape.vertices.push_back({corner * cosine, corner * sine, z});
    }
  shape.model_error = (corner - radius) + 16 * kEps * corner;
  add_band(&shape.triangles, 0, n, n);
  for (std::uint32_t j = 1; j + 1 < n; ++j) {
    shape.triangles.push_back({0, j + 1, j});
    shape.triangles.push_back({n, n + j, n + j + 1});
  }
  return shape;
}

Shape picture_of(const Shape& shape) {
  if (shape.radius == 0) return shape;
  constexpr int kResolution = 12;
  Shape ball = make_uv_sphere(shape.radius, kResolution);
  if (shape.vertices.size() == 1) {
    for (Vec3d& v : ball.vertices) v += shape.vertices[0];
    return ball;
  }
  // A capsule along z: the ball cut along its equator ring, which is doubled.
  const double low = shape.vertices.front().z, high = shape.vertices.back().z;
  constexpr std::uint32_t kAround = 2 * kResolution, kEquator = 2 + kAround * (kResolution / 2 - 1);
  Shape picture;
  picture.vertices = ball.vertices;
  for (std::uint32_t i = 0; i < ball.vertices.size(); ++i)
    picture.vertices[i].z += i == 1 || i >= kEquator + kAround ? low : high;
  const auto doubled = static_cast<std::uint32_t>(picture.vertices.size());
  for (std::uint32_t j = 0; j < kAround; ++j) {
    const Vec3d& v = ball.vertices[kEquator + j];
    picture.vertices.push_back({v.x, v.y, low});
  }
  for (Triangle t : ball.triangles) {
    const bool southern =
        std::any_of(t.begin(), t.end(), [](std::uint32_t i) { return i == 1 || i >= kEquator + kAround; });
    for (std::uint32_t& i : t)
      if (southern && i >= kEquator && i < kEquator + kAround) i = doubled + (i - kEquator);
    picture.triangles.push_back(t);
  }
  add_band(&picture.triangles, doubled, kEquator, kAround);
  return picture;
}

Pose PortableRandom::pose(const Vec3d& box) {
  Pose X;
  for (int k = 0; k < 3; ++k) X.translation[k] = uniform(-0.5 * box[k], 0.5 * box[k]);
  double n2;
  do {  // a point in the four-dimensional ball, not too near its centre
    X.qw = uniform(-1, 1);
    X.qx = uniform(-1, 1);
    X.qy = uniform(-1, 1);
    X.qz = uniform(-1, 1);
    n2 = X.qw * X.qw + X.qx * X.qx + X.qy * X.qy + X.qz * X.qz;
  } while (n2 > 1 || n2 < 1e-4);
  const double s = 1 / std::sqrt(n2);
  X.qw *= s;
  X.qx *= s;
  X.qy *= s;
  X.qz *= s;
  return X;
}

}  // namespace clearance
