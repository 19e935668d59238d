// Arms of boxes, balls and cylinders, and their distances from points in closed form: independent of the engine.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace clearance::stops {

using Point = std::array<double, 3>;
using Random = std::mt19937_64;

inline double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// A serial arm of turning joints, each with a link of one shape.
class ExactArm {
 public:
  enum class Shape { kBall, kBox, kCylinder };
  struct Link {
    Point offset;  ///< of its joint in the frame before, metres
    int axis;      ///< of its joint: x, y or z
    Shape shape;
    Point size;    ///< half lengths of a box; radius of a ball; radius and half length of a cylinder
    Point centre;  ///< of its shape
  };
  /// Rotation and position of each link's frame.
  struct Placed {
    std::array<Point, 3> columns;
    Point origin;
  };

  explicit ExactArm(Random& random);

  std::size_t joints() const { return links_.size(); }
  std::string urdf() const;
  std::vector<Placed> place(const std::vector<double>& q) const;
  /// Distance of a point from the nearest link, below 0 within one; and with `capsules`, from the capsules around them.
  double distance(const std::vector<Placed>& placed, const Point& p, bool capsules) const;
  /// A point of a link's surface or inside.
  Point point_of(const std::vector<Placed>& placed, std::size_t link, Random& random) const;
  /// Bound on the speed of the arm's points.
  double speed(const std::vector<double>& velocities) const;

 private:
  std::vector<Link> links_;
};

Point operator+(const Point& a, const Point& b);
Point operator-(const Point& a, const Point& b);
Point operator*(double s, const Point& a);
double length(const Point& a);
Point direction(Random& random);

}  // namespace clearance::stops
