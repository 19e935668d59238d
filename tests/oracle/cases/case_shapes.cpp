#include "tests/oracle/cases/case_shapes.h"

#include <cmath>
#include <map>
#include <mutex>

#include "engine/hull/shapes.h"

namespace clearance::exact {

SolidPtr solid(std::vector<Vec3d> vertices, double radius) {
  return std::make_shared<const Solid>(Solid{std::move(vertices), radius});
}

std::vector<Vec3d> box(Vec3d half) {
  std::vector<Vec3d> v;
  for (int i = 0; i < 8; ++i)
    v.push_back({i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z});
  return v;
}

std::vector<Vec3d> ordinary(Random& random) {
  std::vector<Vec3d> v;
  switch (random.integer(0, 3)) {
    case 0:
      return make_uv_sphere(random.uniform(0.5, 1.5), 5).vertices;
    case 1:
      return box({random.uniform(0.2, 1), random.uniform(0.2, 1), random.uniform(0.2, 1)});
    case 2:
      for (int i = random.integer(4, 42); i > 0; --i) v.push_back(random.direction());
      return v;
    default:
      for (int i = random.integer(4, 24); i > 0; --i)
        v.push_back({random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)});
      return v;
  }
}

std::vector<Vec3d> scaled(std::vector<Vec3d> v, Vec3d s) {
  for (Vec3d& p : v) p = {p.x * s.x, p.y * s.y, p.z * s.z};
  return v;
}
std::vector<Vec3d> scaled(std::vector<Vec3d> v, double s) {
  return scaled(std::move(v), {s, s, s});
}

std::vector<Vec3d> prism(Random& random, int sides, double top) {
  std::vector<Vec3d> v;
  const double height = random.log_uniform(0.05, 2);
  for (int i = 0; i < sides; ++i) {
    double s, c;
    sin_cos_pi(static_cast<std::uint32_t>(2 * i), static_cast<std::uint32_t>(sides), &s, &c);
    v.push_back({c, s, 0});
    v.push_back({top * c, top * s, height});
  }
  return v;
}

SolidPtr dense_sphere(int resolution) {
  static std::mutex mutex;
  static std::map<int, SolidPtr> made;
  const std::lock_guard lock(mutex);
  SolidPtr& s = made[resolution];
  if (!s) s = solid(make_uv_sphere(1, resolution).vertices);
  return s;
}

SolidPtr needle(Random& random) {
  const double thin = random.log_uniform(1e-9, 1e-3);
  Vec3d s{thin, thin * random.log_uniform(0.01, 1), 1};
  std::vector<Vec3d> v = scaled(ordinary(random), s);
  return solid(std::move(v));
}
SolidPtr plate(Random& random) {
  return solid(scaled(ordinary(random), {1, random.uniform(0.3, 1), random.log_uniform(1e-12, 1e-3)}));
}
SolidPtr sliver(Random& random) {
  std::vector<Vec3d> v;
  const Vec3d p = random.direction(), q = random.direction();
  for (int i = random.integer(4, 8); i > 0; --i) {
    const double s = random.uniform(-1, 1), t = random.uniform(-1, 1) * random.log_uniform(1e-8, 1);
    v.push_back(p * s + q * t + random.direction() * random.log_uniform(1e-16, 1e-4));
  }
  return solid(std::move(v));
}
SolidPtr nearly_flat(Random& random) {
  const double off = random.log_uniform(1e-17, 1e-8);
  const Pose X = random.rotation({random.uniform(-1, 1), 0, 0});
  const Mat3d R = rotation_of(X);
  std::vector<Vec3d> v;
  for (int i = random.integer(4, 30); i > 0; --i)
    v.push_back(R * Vec3d{random.uniform(-1, 1), random.uniform(-1, 1), off * random.uniform(-1, 1)} + X.translation);
  return solid(std::move(v));
}
SolidPtr flat(Random& random) {
  std::vector<Vec3d> v;
  const int k = random.integer(0, 2);
  for (int i = random.integer(3, 16); i > 0; --i) {
    Vec3d p{random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)};
    p[k] = 0;
    v.push_back(p);
  }
  return solid(std::move(v));
}
SolidPtr line(Random& random) {
  const Vec3d d = random.chance(0.5)
                      ? Vec3d{static_cast<double>(random.integer(-3, 3)), static_cast<double>(random.integer(-3, 3)), 1}
                      : random.direction();
  std::vector<Vec3d> v;
  for (int i = random.integer(2, 8); i > 0; --i) v.push_back(d * (random.integer(-64, 64) / 64.0));
  return solid(std::move(v));
}
SolidPtr repeated(Random& random) {
  std::vector<Vec3d> v = ordinary(random);
  const auto some = [&] { return v[static_cast<std::size_t>(random.integer(0, static_cast<int>(v.size()) - 1))]; };
  for (int i = random.integer(1, 40); i > 0; --i) switch (random.integer(0, 3)) {
      case 0:
        v.push_back(some());
        break;  // a duplicate
      case 1:
        v.push_back(0.5 * (some() + some()));
        break;  // on an edge, or inside
      case 2:
        v.push_back(0.25 * (some() + some()) + 0.5 * some());
        break;    // on a face, or inside
      default: {  // a duplicate except for the last bit
        Vec3d p = some();
        p[random.integer(0, 2)] *= 1 + random.sign() * 0x1p-52;
        v.push_back(p);
      }
    }
  return solid(std::move(v));
}
SolidPtr faced(Random& random) {
  if (random.chance(0.5)) return solid(box({random.uniform(0.1, 1), random.uniform(0.1, 1), random.uniform(0.1, 1)}));
  return solid(prism(random, random.integer(3, 24), 1.0));
}

}  // namespace clearance::exact
