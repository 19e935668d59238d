// Resolution of each scalar type of the narrow phase.
#pragma once

#include "engine/base/double_double.h"

namespace clearance {

template <class T>
struct Arithmetic;

/// kUnit: bound on the relative error of every operation.
/// kCareful: spend more operations to lose fewer digits (the last resort).
/// kUnderflowLength: lengths below this may have lost digits to underflow in their squares; metres.
/// kSafelySquared: least squared length of directions that need no rescaling before squaring (see rescaled()).
/// kFlatFace: squared sine of the angle between two edges below which their face's plane is noise.
template <>
struct Arithmetic<float> {
  static constexpr double kUnit = 0x1p-24;
  static constexpr double kUnderflowLength = 1e-18, kSafelySquared = 1e-24;
  static constexpr double kFlatFace = 1e-9;
  static constexpr bool kCareful = false;
};
template <>
struct Arithmetic<double> {
  static constexpr double kUnit = 0x1p-53;
  static constexpr double kUnderflowLength = 1e-150, kSafelySquared = 1e-100;
  static constexpr double kFlatFace = 1e-22;
  static constexpr bool kCareful = false;
};
template <>
struct Arithmetic<DoubleDouble> {
  static constexpr double kUnit = 0x1p-102;  // 16 u^2 covers the sum, the product and the division of double_double.h
  static constexpr double kUnderflowLength = 1e-150, kSafelySquared = 1e-100;
  static constexpr double kFlatFace = 1e-54;
  static constexpr bool kCareful = true;
};

}  // namespace clearance
