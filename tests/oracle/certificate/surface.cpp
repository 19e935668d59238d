// A closed surface around a ball, by the three conditions of bounds.md: no border, beyond the ball, around it.
#include <algorithm>
#include <optional>

#include "tests/oracle/certificate/bounds.h"

namespace clearance::certificate_oracle {
namespace {

// Origins of rays, in units that are made small enough, and their directions: without pattern, so that some meet no
// edge.
struct Ray {
  Vector origin, along;
};
const std::vector<Ray>& rays() {
  static const std::vector<Ray> value{
      {{4.0, 1.0, -6.0}, {523.0, -811.0, 269.0}}, {{-2.0, 5.0, 3.0}, {-947.0, -158.0, 606.0}},
      {{1.0, -7.0, 2.0}, {311.0, 764.0, 877.0}},  {{-5.0, -3.0, -4.0}, {-683.0, 442.0, -971.0}},
      {{6.0, 3.0, 5.0}, {89.0, -373.0, -638.0}},  {{-3.0, 2.0, -7.0}, {-236.0, 991.0, -117.0}}};
  return value;
}

std::vector<Face> read_faces(const Value& witness, std::size_t points) {
  std::vector<Face> faces;
  for (const Value& face : witness["faces"].list()) {
    require(face.list().size() == 3, "a face is no triangle");
    faces.push_back({face.at(0).index(points), face.at(1).index(points), face.at(2).index(points)});
  }
  require(!faces.empty(), "a surface has no faces");
  return faces;
}

// The k of a ball of radius 2^k inside one of radius x / y.
long ball_within(const Dyadic& x, const Dyadic& y) {
  long over = 0, under = 0;  // x / y > 2^(over - 1) / 2^under
  x.rough(over);
  y.rough(under);
  return over - 1 - under;
}

// Checks that no face comes nearer to the origin than `radius`. Returns the k of a ball of radius 2^k that none of them
// meets.
long check_beyond(const Value& witness, const std::vector<Face>& faces, const std::vector<Vector>& points,
                  const Dyadic& radius) {
  const std::span<const Value> normals = witness["normals"].list();
  require(normals.size() == faces.size(), "there are not as many normals as faces");
  std::optional<long> smallest;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const Vector m = normals[f].vector_of_sums();
    const Dyadic length = length_above(m);
    const Dyadic beyond =
        std::min({dot(m, points[faces[f][0]]), dot(m, points[faces[f][1]]), dot(m, points[faces[f][2]])});
    require(beyond.sign() > 0 && beyond >= radius * length, "a face is not beyond its plane");
    const long ball = ball_within(beyond, length);
    smallest = std::min(smallest.value_or(ball), ball);
  }
  return *smallest;
}

// Net number of crossings of the faces by a ray; nothing if it meets an edge.
std::optional<long> crossings(const std::vector<Face>& faces, const std::vector<Vector>& points, const Vector& origin,
                              const Vector& along) {
  std::vector<Vector> from_origin;
  for (const Vector& w : points) from_origin.push_back(w - origin);
  long crossings = 0;
  for (const Face& face : faces) {
    if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) continue;  // its edges cancel
    const Vector &u = from_origin[face[0]], &v = from_origin[face[1]], &w = from_origin[face[2]];
    const Vector v_w = cross(v, w);
    const int first = dot(along, cross(u, v)).sign(), second = dot(along, v_w).sign();
    const int third = dot(along, cross(w, u)).sign();
    if (std::min({first, second, third}) < 0 && std::max({first, second, third}) > 0) continue;  // misses
    if (first == 0 || second == 0 || third == 0) return {};
    if (first == second && second == third && dot(u, v_w).sign() == first) crossings += first;
  }
  return crossings;
}

// Rays begin within a ball of radius 2^k.
long turns(const std::vector<Face>& faces, const std::vector<Vector>& points, long ball) {
  const Dyadic unit = Dyadic::power_of_two(ball - 4);  // rays begin within 10 of these
  for (const Ray& ray : rays())
    if (const std::optional<long> found = crossings(faces, points, unit * ray.origin, ray.along)) return *found;
  throw Rejection("every ray meets an edge of the surface");
}

}  // namespace

bool is_closed(const std::vector<Face>& faces) {
  std::vector<std::pair<std::size_t, std::size_t>> edges, back;
  for (const Face& face : faces)
    for (std::size_t k = 0; k < 3; ++k) {
      edges.emplace_back(face[k], face[(k + 1) % 3]);
      back.emplace_back(face[(k + 1) % 3], face[k]);
    }
  std::sort(edges.begin(), edges.end());
  std::sort(back.begin(), back.end());
  return edges == back;
}

long turns_around(const std::vector<Face>& faces, const std::vector<Vector>& points, const Dyadic& near) {
  return turns(faces, points, ball_within(near, 1.0));
}

void check_surface(const Value& witness, const std::vector<Vector>& points, const Dyadic& divisor, const Dyadic& radius,
                   const std::vector<Face>* given) {
  const std::vector<Face> faces = given ? *given : read_faces(witness, points.size());
  require(is_closed(faces), "the surface has a border");
  const long ball = check_beyond(witness, faces, points, radius * divisor);
  require(turns(faces, points, ball) != 0, "the surface does not go around the origin");
}

}  // namespace clearance::certificate_oracle
