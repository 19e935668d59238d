#include "tests/oracle/cases/cases.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace clearance::exact {

double Random::log_uniform(double low, double high) {
  return std::exp(uniform(std::log(low), std::log(high)));
}

double Random::normal() {
  return std::sqrt(-2 * std::log(1 - uniform())) * std::cos(2 * std::numbers::pi * uniform());
}

Vec3d Random::direction() {
  for (;;) {
    const Vec3d d{normal(), normal(), normal()};
    if (const double n = norm(d); n > 1e-3) return d * (1 / n);
  }
}

Pose Random::rotation(Vec3d translation) {
  for (;;) {
    const double w = normal(), x = normal(), y = normal(), z = normal(), n = std::sqrt(w * w + x * x + y * y + z * z);
    if (n > 1e-3) return {translation, w / n, x / n, y / n, z / n};
  }
}

double reach(const Solid& s) {
  double most = 0;
  for (const Vec3d& v : s.vertices) most = std::max(most, norm(v));
  return most;
}

double scale_of(const Case& c) {
  return norm(c.X_wb.translation - c.X_wa.translation) + reach(*c.a) + reach(*c.b) + c.a->radius + c.b->radius;
}

void set_gap(Case& c, double gap) {
  const Result r = exact_answer(c);
  if (squared_norm(r.direction) == 0 && !(c.a->triangles.empty() && c.b->triangles.empty())) return;
  // Scales a direction of integers of any size to doubles.
  mpz_class largest = 0;
  for (int k = 0; k < 3; ++k) largest = std::max(largest, mpz_class(abs(r.direction[k])));
  Vec3d n;
  for (int k = 0; k < 3; ++k) n[k] = mpf_class(mpf_class(r.direction[k], 128) / mpf_class(largest, 128)).get_d();
  c.X_wb.translation += n * ((gap - r.distance.lower()) / norm(n));
}

Case make_case(const CaseClass& c, std::uint64_t seed, std::uint64_t index) {
  std::uint64_t mixed = seed;
  const auto mix = [&](std::uint64_t v) { mixed = (mixed ^ v) * 0x9E3779B97F4A7C15u, mixed ^= mixed >> 29; };
  for (const char letter : c.name) mix(static_cast<unsigned char>(letter));
  mix(index);
  Random random(mixed);
  return c.make(random);
}

const std::vector<MinedCase>& mined_cases() {
  struct Entry {
    Solid a;
    Pose X_wa;
    Solid b;
    Pose X_wb;
    double exact;
  };
  static const std::vector<MinedCase> kCases = [] {
    const std::vector<Entry> entries = {
#include "tests/oracle/cases/mined_cases.inc"
    };
    std::vector<MinedCase> cases;
    for (const Entry& e : entries)
      cases.push_back(
          {{std::make_shared<const Solid>(e.a), std::make_shared<const Solid>(e.b), e.X_wa, e.X_wb}, e.exact});
    return cases;
  }();
  return kCases;
}

}  // namespace clearance::exact
