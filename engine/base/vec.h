// Three-vectors and matrices over any scalar, for host and device.
//
// The narrow phase is written once over a scalar T (float, double, DoubleDouble, a SIMD pack). Only the loaders use
// Eigen, outside hot loops.
#pragma once

#include <cmath>
#include <cstddef>

#ifdef __CUDACC__
#define CLEARANCE_HD __host__ __device__
#else
#define CLEARANCE_HD
#endif
/// Unrolls the next loop over a small array, so that a GPU can keep the array in registers.
#ifdef __CUDA_ARCH__
#define CLEARANCE_UNROLL _Pragma("unroll")
#else
#define CLEARANCE_UNROLL
#endif
/// Forces inlining of a function called once in a hot loop over packs, since passing packs through memory is expensive.
#define CLEARANCE_INLINE CLEARANCE_HD inline __attribute__((always_inline))

namespace clearance {

template <class T>
struct Vec3 {
  T x, y, z;

  CLEARANCE_HD Vec3& operator+=(const Vec3& b) { return *this = *this + b; }
  CLEARANCE_HD Vec3& operator-=(const Vec3& b) { return *this = *this - b; }
  CLEARANCE_HD friend Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  CLEARANCE_HD friend Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  CLEARANCE_HD friend Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
  CLEARANCE_HD friend Vec3 operator*(const Vec3& a, const T& s) { return {a.x * s, a.y * s, a.z * s}; }
  CLEARANCE_HD friend Vec3 operator*(const T& s, const Vec3& a) { return a * s; }
  CLEARANCE_HD const T& operator[](int i) const { return (&x)[i]; }
  CLEARANCE_HD T& operator[](int i) { return (&x)[i]; }
};

template <class T>
CLEARANCE_HD inline T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class T>
CLEARANCE_HD inline Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class T>
CLEARANCE_HD inline T squared_norm(const Vec3<T>& a) {
  return dot(a, a);
}

template <class T>
CLEARANCE_HD inline bool is_zero(const Vec3<T>& a) {
  return a.x == T(0) && a.y == T(0) && a.z == T(0);
}

template <class T>
CLEARANCE_HD inline T norm(const Vec3<T>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}

/// Scales v exactly by a power of two, so that its squares neither overflow nor lose digits to underflow. Returns 0 and
/// vectors with an infinity or a NaN unchanged.
template <class T>
CLEARANCE_HD inline Vec3<T> rescaled(const Vec3<T>& v) {
  using std::abs;
  using std::ilogb;
  using std::ldexp;
  const double x = static_cast<double>(abs(v.x)), y = static_cast<double>(abs(v.y)), z = static_cast<double>(abs(v.z));
  const double largest = x > y ? (x > z ? x : z) : (y > z ? y : z);
  if ((largest > 1e-60 && largest < 1e60) || !(largest > 0) || !(largest <= 1.7976931348623157e308)) return v;
  int exponent = ilogb(largest);
  exponent = exponent < -1000 ? -1000 : exponent;
  return v * T(ldexp(1.0, -exponent));
}

/// Converts between scalars.
template <class To, class From>
CLEARANCE_HD inline Vec3<To> cast(const Vec3<From>& a) {
  return {To(a.x), To(a.y), To(a.z)};
}

/// Row-major 3 x 3 matrix.
template <class T>
struct Mat3 {
  Vec3<T> row[3];

  CLEARANCE_HD friend Vec3<T> operator*(const Mat3& m, const Vec3<T>& v) {
    return {dot(m.row[0], v), dot(m.row[1], v), dot(m.row[2], v)};
  }
  /// m^T v, without forming the transpose.
  CLEARANCE_HD Vec3<T> transpose_times(const Vec3<T>& v) const {
    return {row[0].x * v.x + row[1].x * v.y + row[2].x * v.z, row[0].y * v.x + row[1].y * v.y + row[2].y * v.z,
            row[0].z * v.x + row[1].z * v.y + row[2].z * v.z};
  }
  /// m^T b, the same way.
  CLEARANCE_HD Mat3 transpose_times(const Mat3& b) const {
    const auto row_of = [&](const T& x, const T& y, const T& z) { return b.transpose_times(Vec3<T>{x, y, z}); };
    return {{row_of(row[0].x, row[1].x, row[2].x), row_of(row[0].y, row[1].y, row[2].y),
             row_of(row[0].z, row[1].z, row[2].z)}};
  }
  CLEARANCE_HD static Mat3 identity() { return {{{T(1), T(0), T(0)}, {T(0), T(1), T(0)}, {T(0), T(0), T(1)}}}; }
};

template <class To, class From>
CLEARANCE_HD inline Mat3<To> cast(const Mat3<From>& m) {
  return {{cast<To>(m.row[0]), cast<To>(m.row[1]), cast<To>(m.row[2])}};
}

using Vec3d = Vec3<double>;
using Mat3d = Mat3<double>;

}  // namespace clearance
