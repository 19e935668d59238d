#include "tests/oracle/stops/exact_arm.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace clearance::stops {

Point operator+(const Point& a, const Point& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
Point operator-(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Point operator*(double s, const Point& a) {
  return {s * a[0], s * a[1], s * a[2]};
}
double length(const Point& a) {
  return std::hypot(a[0], a[1], a[2]);
}
Point direction(Random& random) {
  for (;;) {
    const Point p{between(random, -1, 1), between(random, -1, 1), between(random, -1, 1)};
    if (const double d = length(p); d > 0.1 && d < 1) return (1 / d) * p;
  }
}

namespace {

double dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Point world(const ExactArm::Placed& placed, const Point& p) {
  return placed.origin + p[0] * placed.columns[0] + p[1] * placed.columns[1] + p[2] * placed.columns[2];
}
Point local(const ExactArm::Placed& placed, const Point& p) {
  const Point d = p - placed.origin;
  return {dot(d, placed.columns[0]), dot(d, placed.columns[1]), dot(d, placed.columns[2])};
}

double outside(double x, double y, double z) {
  const double inside = std::min(std::max({x, y, z}), 0.0);
  return std::hypot(std::max(x, 0.0), std::max(y, 0.0), std::max(z, 0.0)) + inside;
}

/// Distance of a point from a link, in the link's frame.
double from_shape(const ExactArm::Link& link, const Point& p) {
  const Point d = p - link.centre;
  switch (link.shape) {
    case ExactArm::Shape::kBall:
      return length(d) - link.size[0];
    case ExactArm::Shape::kBox:
      return outside(std::abs(d[0]) - link.size[0], std::abs(d[1]) - link.size[1], std::abs(d[2]) - link.size[2]);
    case ExactArm::Shape::kCylinder:
      break;
  }
  const double radial = std::hypot(d[0], d[1]) - link.size[0], along = std::abs(d[2]) - link.size[1];
  return std::hypot(std::max(radial, 0.0), std::max(along, 0.0)) + std::min(std::max(radial, along), 0.0);
}

/// Distance of a point from the capsule around a link: along the longest side of a box, or the axis of a cylinder.
double from_capsule(const ExactArm::Link& link, const Point& p) {
  if (link.shape == ExactArm::Shape::kBall) return from_shape(link, p);
  const Point d = p - link.centre;
  const bool is_box = link.shape == ExactArm::Shape::kBox;
  const auto axis = is_box ? static_cast<std::size_t>(std::ranges::max_element(link.size) - link.size.begin()) : 2;
  const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
  const double half = is_box ? link.size[axis] : link.size[1],
               radius = is_box ? std::hypot(link.size[u], link.size[v]) : link.size[0];
  return std::hypot(std::max(std::abs(d[axis]) - half, 0.0), d[u], d[v]) - radius;
}

}  // namespace

ExactArm::ExactArm(Random& random) {
  const int count = std::uniform_int_distribution(2, 6)(random);
  double before = 0;
  for (int k = 0; k < count; ++k) {
    Link link;
    link.offset = {0, 0, k == 0 ? 0.2 : before};
    link.axis = k % 2 == 0 ? 2 : std::uniform_int_distribution(0, 1)(random);
    const double reach = between(random, 0.15, 0.4), thick = between(random, 0.03, 0.08);
    before = reach;
    link.centre = {0, 0, 0.5 * reach};
    link.shape = static_cast<Shape>(std::uniform_int_distribution(0, 2)(random));
    if (link.shape == Shape::kBall) link.size = {between(random, 0.05, 0.12), 0, 0};
    if (link.shape == Shape::kBox) link.size = {thick, between(random, 0.03, 0.1), 0.5 * reach};
    if (link.shape == Shape::kCylinder) link.size = {thick, 0.5 * reach, 0};
    links_.push_back(link);
  }
}

std::string ExactArm::urdf() const {
  std::ostringstream text;
  text.precision(17);
  text << "<robot name='arm'><link name='base'/>";
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const Link& link = links_[k];
    text << "<link name='l" << k << "'><collision><origin xyz='" << link.centre[0] << ' ' << link.centre[1] << ' '
         << link.centre[2] << "'/><geometry>";
    if (link.shape == Shape::kBall) text << "<sphere radius='" << link.size[0] << "'/>";
    if (link.shape == Shape::kBox)
      text << "<box size='" << 2 * link.size[0] << ' ' << 2 * link.size[1] << ' ' << 2 * link.size[2] << "'/>";
    if (link.shape == Shape::kCylinder)
      text << "<cylinder radius='" << link.size[0] << "' length='" << 2 * link.size[1] << "'/>";
    text << "</geometry></collision></link><joint name='j" << k << "' type='continuous'><parent link='"
         << (k == 0 ? std::string("base") : "l" + std::to_string(k - 1)) << "'/><child link='l" << k
         << "'/><origin xyz='" << link.offset[0] << ' ' << link.offset[1] << ' ' << link.offset[2] << "'/><axis xyz='"
         << (link.axis == 0) << ' ' << (link.axis == 1) << ' ' << (link.axis == 2) << "'/></joint>";
  }
  return text.str() + "</robot>";
}

std::vector<ExactArm::Placed> ExactArm::place(const std::vector<double>& q) const {
  std::vector<Placed> placed;
  Placed at{{Point{1, 0, 0}, Point{0, 1, 0}, Point{0, 0, 1}}, {0, 0, 0}};
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const Link& link = links_[k];
    at.origin = world(at, link.offset);
    const auto u = static_cast<std::size_t>((link.axis + 1) % 3), v = static_cast<std::size_t>((link.axis + 2) % 3);
    const Point first = at.columns[u], second = at.columns[v];
    at.columns[u] = std::cos(q[k]) * first + std::sin(q[k]) * second;
    at.columns[v] = std::cos(q[k]) * second - std::sin(q[k]) * first;
    placed.push_back(at);
  }
  return placed;
}

double ExactArm::distance(const std::vector<Placed>& placed, const Point& p, bool capsules) const {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < links_.size(); ++k) {
    const Point in_link = local(placed[k], p);
    least = std::min(least, capsules ? from_capsule(links_[k], in_link) : from_shape(links_[k], in_link));
  }
  return least;
}

Point ExactArm::point_of(const std::vector<Placed>& placed, std::size_t link, Random& random) const {
  const Link& of = links_[link];
  const double along = of.shape == Shape::kBox ? of.size[2] : of.shape == Shape::kBall ? of.size[0] : of.size[1];
  return world(placed[link], of.centre + Point{0, 0, between(random, -along, along)});
}

double ExactArm::speed(const std::vector<double>& velocities) const {
  double sum = 0, behind = 0;
  for (std::size_t k = links_.size(); k-- > 0;) {
    const Link& link = links_[k];
    behind = std::max(behind + (k + 1 < links_.size() ? length(links_[k + 1].offset) : 0),
                      length(link.centre) + link.size[0] + link.size[1] + link.size[2]);
    sum += behind * std::abs(velocities[k]);
  }
  return sum;
}

}  // namespace clearance::stops
