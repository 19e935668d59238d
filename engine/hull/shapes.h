// Shapes described by a few numbers: their vertices, radius and faces, in the body's frame, metres.
//
// Only additions, multiplications, divisions and square roots are used, so that a shape has the same bits everywhere.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"
#include "engine/pose/pose.h"

namespace clearance {

/// The convex hull of `vertices`, grown by `radius`.
struct Shape {
  std::vector<Vec3d> vertices;
  double radius = 0;
  double model_error = 0;           ///< maximum distance by which it exceeds the requested shape
  std::vector<Triangle> triangles;  ///< faces of the hull of `vertices`, outward; empty if that hull is flat
};

/// Largest resolution of a uv_sphere: 2 r (r - 1) + 2 vertices, about 8 million.
inline constexpr int kMaxUvSphereResolution = 2000;
/// Sides of the prism used for a robot's cylinder: its corners exceed the cylinder by 0.12 % of the radius.
inline constexpr int kCylinderSides = 64;

/// sin and cos of pi k / n, for n from 1 to 2^28 and 0 <= k <= 2 n, correct to the last bit but one and exact at
/// multiples of a right angle.
void sin_cos_pi(std::uint32_t k, std::uint32_t n, double* sine, double* cosine);

/// The mesh of Open3D's create_sphere: both poles, then resolution - 1 rings of 2 resolution vertices each. Resolution
/// from 2 to kMaxUvSphereResolution. For example, 5 gives 42 vertices and 80 faces.
Shape make_uv_sphere(double radius, int resolution);
/// Full edge lengths, centred at the origin.
Shape make_box(const Vec3d& size);
/// One vertex and a radius.
Shape make_sphere(double radius);
/// Along z; length between the centres of its caps. Two vertices and a radius (one, if the length is 0).
Shape make_capsule(double radius, double length);
/// Along z, centred at the origin; the prism around it. model_error is its sagitta.
Shape make_cylinder(double radius, double length);

/// Faces for a picture of a shape with a radius; those of the vertices if the radius is 0.
Shape picture_of(const Shape& shape);

/// Random numbers that are the same everywhere: the standard fixes the bits of std::mt19937_64, but not its
/// distributions.
class PortableRandom {
 public:
  explicit PortableRandom(std::uint64_t seed) : bits_(seed) {}
  /// In [0, 1), a multiple of 2^-53.
  double uniform() { return static_cast<double>(bits_() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// A position in the box of full edge lengths `box` about the origin, and a uniformly distributed orientation.
  Pose pose(const Vec3d& box);

 private:
  std::mt19937_64 bits_;
};

}  // namespace clearance
