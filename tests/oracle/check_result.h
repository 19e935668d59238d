// Checks the documented properties of one answer against the exact result.
#pragma once

#include <cstdint>
#include <string>

#include "tests/oracle/cases/cases.h"
#include "wire/types.h"

namespace clearance::exact {

/// Settings of a batch's query.
struct Setting {
  std::string backend = "cpu";
  Precision precision = Precision::kF64;
  bool signed_distance = false;
  bool float32 = false;  ///< bounds and points in float32, and no other columns of numbers
  double rel_tol = -1;   ///< if negative, the default of the precision
  double abs_tol = 0;
  double max_distance = 1e300;

  double wanted_rel_tol() const { return rel_tol >= 0 ? rel_tol : precision == Precision::kF32 ? 1e-4 : 1e-6; }
  std::string name() const;  ///< "cpu f64 signed float32 rel 1e-3 ..."
};

/// One row of a reply. With Setting::float32 `distance` and `normal` are absent.
struct Answer {
  double distance = 0, lower = 0, upper = 0;
  Status status = Status::kOk;
  std::uint16_t flags = 0;
  Vec3d point_a{0, 0, 0}, point_b{0, 0, 0};  ///< world frame; with Setting::float32 from each body's origin, world axes
  Vec3d normal{0, 0, 0};
};

struct CheckResult {
  std::string violation;   ///< error in bounds, status or columns, or empty; anything but accuracy
  std::string inaccuracy;  ///< lack of accuracy of a correct answer, or empty
  double error = 0;        ///< |distance - exact| over the allowed error: tolerance + 16 eps S
  double width = 0;        ///< upper - lower over tolerance + 32 eps S; 0 for pairs that are beyond
  bool good() const { return violation.empty() && inaccuracy.empty(); }
};

/// Compares an answer with the exact result.
/// \param columns also prove witness points and normal, which costs three more exact solutions
CheckResult hold_against(const Case& c, const Result& exact_value, const Setting& setting, const Answer& answer,
                         bool columns = true);

/// The case and its exact signed distance (rounded down) as a C++ initialiser in hexadecimal floats, as in
/// mined_cases.inc.
std::string as_initialiser(const Case& c);
/// Describes an answer for a failed test.
std::string in_words(const Answer& a);

}  // namespace clearance::exact
