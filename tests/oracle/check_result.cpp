#include "tests/oracle/check_result.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace clearance::exact {

namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr double kEpsFloat = std::numeric_limits<float>::epsilon();

std::string text(const char* format, auto... values) {
  char buffer[512];
  std::snprintf(buffer, sizeof buffer, format, values...);
  return buffer;
}

bool finite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// Upper bound on the distance of a point of the world from a grown body; 0 or less inside.
double outside(const Solid& s, const Pose& X, const Vec3d& p) {
  if (!s.triangles.empty())
    return exact_distance(body_view(s), X, BodyView{std::span(&p, 1), {}, false, 0}, {}).distance.upper();
  return exact_distance(view(s), X, {std::span(&p, 1), 0}, {}, false).distance.upper();
}

class ResultChecker {
 public:
  ResultChecker(const Case& c, const Result& exact_value, const Setting& setting, const Answer& answer)
      : c_(c), setting_(setting), answer_(answer), exact_value_(exact_value), scale_(scale_of(c)) {
    // Without signed distance the exact value is clipped at 0, like the answer.
    clipped_ = !setting.signed_distance && exact_value.distance.compare(0) < 0;
    exact_ = clipped_ ? 0 : exact_value.distance.lower();
  }

  CheckResult all(bool columns) {
    bounds();
    if (!v_.violation.empty()) return v_;
    status();
    accuracy();
    if (columns && answer_.status != Status::kBeyond) {
      points();
      normal();
    }
    return v_;
  }

 private:
  int exact_against(double x) const { return clipped_ ? (x < 0) - (x > 0) : exact_value_.distance.compare(x); }
  void violation(const std::string& what) {
    if (v_.violation.empty()) v_.violation = what;
  }
  void inaccuracy(const std::string& what) {
    if (v_.inaccuracy.empty()) v_.inaccuracy = what;
  }

  void bounds() {
    const auto [lower, upper] = std::pair(answer_.lower, answer_.upper);
    if (std::isnan(lower) || std::isnan(upper)) return violation("a bound is NaN");
    if (lower > upper) return violation(text("lower %.17g is above upper %.17g", lower, upper));
    if (exact_against(std::max(lower, -1e300)) < 0)
      return violation(text("lower %.17g is above the exact %.17g by %.3g eps S", lower, exact_,
                            (lower - exact_) / (kEps * scale_)));
    if (exact_against(std::min(upper, 1e300)) > 0)
      return violation(text("upper %.17g is below the exact %.17g by %.3g eps S", upper, exact_,
                            (exact_ - upper) / (kEps * scale_)));
  }

  void status() {
    const double lower = answer_.lower, upper = answer_.upper;
    const double requested =
        std::max(setting_.abs_tol, setting_.wanted_rel_tol() * std::abs(setting_.float32 ? upper : answer_.distance));
    const bool narrow = setting_.float32 || upper - lower <= requested || (answer_.flags & kFlagRoundingLimited) != 0;
    switch (answer_.status) {
      case Status::kOk:
        // Bounds in float32 are rounded outward, perhaps to 0.
        if (!(lower > 0) && !(setting_.float32 && lower >= 0)) violation("ok, but lower is not above 0");
        if (exact_value_.distance.compare(0) <= 0) violation("ok, but the bodies touch or overlap");
        if (!narrow) violation(text("ok, but wider than asked: %.3g > %.3g", upper - lower, requested));
        break;
      case Status::kOverlap:
        if (!(upper <= 0)) violation("overlap, but upper is above 0");
        if (exact_value_.distance.compare(0) > 0) violation("overlap, but the bodies are apart");
        if (!setting_.signed_distance && (lower != 0 || upper != 0)) violation("overlap without depth, but not 0, 0");
        if (!narrow) violation(text("overlap, but wider than asked: %.3g > %.3g", upper - lower, requested));
        break;
      case Status::kContact:
        if (!(lower <= 0 && upper >= 0)) violation("contact, but the bounds prove a side");
        break;
      case Status::kBeyond:
        if (!(lower > setting_.max_distance) && !setting_.float32) violation("beyond, but lower is not");
        if (exact_value_.distance.compare(setting_.max_distance) <= 0)
          violation("beyond, but nearer than max_distance");
        break;
      case Status::kUnconverged:
        break;
      default:
        violation(text("status %d for a pair with good poses", static_cast<int>(answer_.status)));
    }
    if (setting_.float32 || answer_.status == Status::kUnconverged) return;
    const double expected =
        answer_.status == Status::kBeyond || (answer_.status == Status::kOverlap && setting_.signed_distance)
            ? answer_.lower
            : answer_.upper;
    if (answer_.status != Status::kContact && answer_.distance != expected)
      violation(text("distance %.17g is not the bound that it should be, %.17g", answer_.distance, expected));
    if (answer_.status == Status::kContact && !(lower <= answer_.distance && answer_.distance <= upper))
      violation("the distance of a contact is outside its bounds");
  }

  void accuracy() {
    if (answer_.status == Status::kBeyond) return;
    const double loose = setting_.float32 ? 4 * kEpsFloat * std::abs(exact_) + std::numeric_limits<float>::min() : 0;
    const double requested = std::max(setting_.abs_tol, setting_.wanted_rel_tol() * std::abs(exact_)) + loose;
    v_.width = (answer_.upper - answer_.lower) / (requested + 32 * kEps * scale_);
    const double distance = setting_.float32 ? answer_.upper : answer_.distance;
    v_.error = std::abs(distance - exact_) / (requested + 16 * kEps * scale_);
    if (!(v_.error <= 1))
      inaccuracy(text("distance %.17g is off the exact %.17g by %.3g of what is allowed", distance, exact_, v_.error));
  }

  void points() {
    if (!finite(answer_.point_a) || !finite(answer_.point_b)) return violation("a witness point is not finite");
    Vec3d a = answer_.point_a, b = answer_.point_b;
    double rounding = 16 * kEps * scale_;
    if (setting_.float32) {
      rounding += 4 * kEpsFloat * scale_;
      a += c_.X_wa.translation;
      b += c_.X_wb.translation;
    }
    const double near_a = rounding + 2 * kEps * norm(c_.X_wa.translation),
                 near_b = rounding + 2 * kEps * norm(c_.X_wb.translation);
    if (const double out = outside(*c_.a, c_.X_wa, a); !(out <= near_a))
      inaccuracy(text("point_a is outside its piece by %.3g, rounding allows %.3g", out, near_a));
    if (const double out = outside(*c_.b, c_.X_wb, b); !(out <= near_b))
      inaccuracy(text("point_b is outside its piece by %.3g, rounding allows %.3g", out, near_b));
    const double between = norm(b - a), error = std::abs(between - std::abs(answer_.upper));
    const double allowed =
        2 * near_a + 2 * near_b + (setting_.float32 ? 4 * kEpsFloat * std::abs(exact_) : 0) +
        // A depth's upper bound has no witness of its own; the points are within the requested tolerance of it. In
        // float32 the upper bound includes float32's rounding errors, the points do not.
        (setting_.precision == Precision::kF32 ? answer_.upper - answer_.lower : 0) +
        (answer_.upper < 0 ? std::max(setting_.abs_tol, setting_.wanted_rel_tol() * std::abs(exact_)) : 0);
    if (!(error <= allowed))
      inaccuracy(text("|p_a - p_b| = %.17g is not |upper| = %.17g; rounding allows %.3g", between,
                      std::abs(answer_.upper), allowed));
  }

  void normal() {
    if (setting_.float32) return;
    if (!finite(answer_.normal) || std::abs(norm(answer_.normal) - 1) > 8 * kEps)
      return violation("the normal is not a unit vector");
    if (!setting_.signed_distance && answer_.lower <= 0) return;       // clipped: nothing to prove
    if (!c_.a->triangles.empty() || !c_.b->triangles.empty()) return;  // it proves the nearest triangles only
    const double gap = exact_support_gap(view(*c_.a), c_.X_wa, view(*c_.b), c_.X_wb, answer_.normal).upper();
    if (!(gap >= answer_.lower - 16 * kEps * scale_))
      inaccuracy(text("the normal proves %.17g, lower says %.17g: %.3g eps S", gap, answer_.lower,
                      (answer_.lower - gap) / (kEps * scale_)));
  }

  const Case& c_;
  const Setting& setting_;
  const Answer& answer_;
  const Result& exact_value_;
  double scale_, exact_;
  bool clipped_;
  CheckResult v_;
};

}  // namespace

std::string Setting::name() const {
  std::string s = backend + (precision == Precision::kF64 ? " f64" : " f32");
  if (signed_distance) s += " signed";
  if (float32) s += " float32";
  if (rel_tol >= 0) s += text(" rel %.0e", rel_tol);
  if (abs_tol > 0) s += text(" abs %.0e", abs_tol);
  if (max_distance < 1e300) s += text(" max %.3g", max_distance);
  return s;
}

CheckResult hold_against(const Case& c, const Result& exact_value, const Setting& setting, const Answer& answer,
                         bool columns) {
  return ResultChecker(c, exact_value, setting, answer).all(columns);
}

std::string as_initialiser(const Case& c) {
  const auto one = [](const Solid& s, const Pose& X) {
    std::string out = "{{";
    for (const Vec3d& v : s.vertices) out += text("{%a, %a, %a},", v.x, v.y, v.z);
    out += text("}, %a", s.radius);
    for (std::size_t i = 0; i < s.triangles.size(); ++i)
      out +=
          text(i == 0 ? ", {{%u, %u, %u}" : ", {%u, %u, %u}", s.triangles[i][0], s.triangles[i][1], s.triangles[i][2]);
    out += s.triangles.empty() ? "},\n  " : s.is_solid ? "}, true},\n  " : "}, false},\n  ";
    return out + text("{{%a, %a, %a}, %a, %a, %a, %a}", X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx,
                      X.qy, X.qz);
  };
  return "{" + one(*c.a, c.X_wa) + ",\n " + one(*c.b, c.X_wb) + text(",\n %a},\n", exact_answer(c).distance.lower());
}

std::string in_words(const Answer& a) {
  return text(
      "status %d flags %d distance %.17g in [%.17g, %.17g], points (%.17g %.17g %.17g) (%.17g %.17g %.17g), normal "
      "(%.17g %.17g %.17g)",
      static_cast<int>(a.status), a.flags, a.distance, a.lower, a.upper, a.point_a.x, a.point_a.y, a.point_a.z,
      a.point_b.x, a.point_b.y, a.point_b.z, a.normal.x, a.normal.y, a.normal.z);
}

}  // namespace clearance::exact
