// Upper bounds: two points, the height of one over a half-space, or a surface around a ball of the difference of two
// convex parts.
#include <algorithm>

#include "tests/oracle/certificate/bounds.h"

namespace clearance::certificate_oracle {
namespace {

constexpr const char* kTooFar = "a point of a witness is too far away";

// The points of a part in a witness: its vertices, or for a core that is no hull points given by the witness.
struct Named {
  const ConvexPart *part = nullptr, *whole = nullptr;
  std::vector<Vector> points;  // of such a core
  Dyadic off;                  // bound on their distance from the core

  std::size_t count() const { return part->is_hull() ? part->count() : points.size(); }
  Vector at(std::size_t k) const { return part->is_hull() ? part->vertex(k) : points[k]; }
};

Named named(const Body& body, const Value& witness, std::size_t side) {
  Named named;
  const std::size_t place = witness["pieces"].at(side).index(body.parts.size());
  named.part = body.parts[place];
  named.whole = body.whole_of[place];
  if (const Value* points = witness.find("points")) require(points->list().size() == 2, "points are not of two pieces");
  if (named.part->is_hull()) return named;
  for (const Value& p : witness["points"].at(side).list()) {
    named.points.push_back(p.vector_of_sums());
    named.off = std::max(named.off, named.part->off(named.points.back()));
  }
  return named;
}

// The points of a - b in a witness, in a's axes, times `divisor`.
struct Difference {
  std::vector<Vector> points;
  Dyadic divisor;

  // At such distances, errors from rounded axes may approach blur().
  bool has_far_points() const {
    const Dyadic far = Dyadic::power_of_two(64) * divisor;
    return std::any_of(points.begin(), points.end(), [&](const Vector& p) { return dot(p, p) >= far * far; });
  }
};

// For a witness with a solid around it: all vertices of that, and the witness's vertex of the other body.
Difference all_around(const Value& witness, const Named& a, const Named& b, std::size_t around, const Pose& X_wa,
                      const Pose& X_wb) {
  Difference d{{}, X_wa.divisor * X_wb.divisor};
  const Vector shift = X_wb.divisor * (X_wb.origin - X_wa.origin);
  const std::span<const Value> vertices = witness["vertices"].list();
  require(vertices.size() == 1 && vertices[0].list().size() == 2, "what is within a solid is not one vertex");
  const Named &solid = around == 0 ? a : b, &other = around == 0 ? b : a;
  const Vector within = other.at(vertices[0].at(1 - around).index(other.count()));
  for (std::size_t k = 0; k < solid.whole->count(); ++k) {
    const Vector vertex = solid.whole->vertex(k), &u = around == 0 ? vertex : within,
                 &v = around == 0 ? within : vertex;
    d.points.push_back(d.divisor * u - turned_back(X_wa.rows, turned(X_wb.rows, v) + shift));
  }
  return d;
}

Difference difference(const Value& witness, const Named& a, const Named& b, const Pose& X_wa, const Pose& X_wb) {
  Difference d{{}, X_wa.divisor * X_wb.divisor};
  const Vector shift = X_wb.divisor * (X_wb.origin - X_wa.origin);
  for (const Value& places : witness["vertices"].list()) {
    require(places.list().size() == 2, "a vertex of a difference is not of two");
    const Vector u = a.at(places.at(0).index(a.count())), v = b.at(places.at(1).index(b.count()));
    d.points.push_back(d.divisor * u - turned_back(X_wa.rows, turned(X_wb.rows, v) + shift));
  }
  require(!d.points.empty(), "a witness is nowhere");
  return d;
}

// The distance of a point from a half-space is that from its plane: the height of one body's point over the other
// bounds the distance of both, and its depth below the depth of the overlap.
// \param up the planes' normals, in a's axes, times `over`, from the half-space to the point of the other, where the
// points are a - b
struct Normal {
  Vector up;
  Dyadic over;
};
std::vector<Normal> normals(const Named& a, const Named& b, const Pose& X_wa, const Pose& X_wb) {
  std::vector<Normal> normals;
  if (a.part->is_half_space()) normals.push_back({{0.0, 0.0, -1.0}, 1.0});
  if (b.part->is_half_space())
    normals.push_back({turned_back(X_wa.rows, turned(X_wb.rows, {0.0, 0.0, 1.0})), X_wa.divisor * X_wb.divisor});
  return normals;
}

void check_points(const Value& witness, const Difference& d, const Dyadic& reach, const std::vector<Normal>& normals) {
  const std::span<const Value> weights = witness["weights"].list();
  require(weights.size() == d.points.size(), "there are not as many weights as points");
  Vector sum;
  Dyadic total;
  for (std::size_t k = 0; k < weights.size(); ++k) {
    const Dyadic weight = weights[k].high_and_low();
    require(weight.sign() >= 0, "a weight is negative");
    total += weight;
    sum = sum + weight * d.points[k];
  }
  require(total.sign() > 0, "all weights are 0");
  const Dyadic most = reach * total * d.divisor;
  const auto is_low = [&](const Normal& n) { return dot(n.up, sum) <= most * n.over; };
  require((most.sign() >= 0 && dot(sum, sum) <= most * most) || std::any_of(normals.begin(), normals.end(), is_low),
          "the witness points are farther apart than upper");
}

}  // namespace

void check_witness(const Motion& motion, const IdPair& ids, const Value& witness, const Dyadic& bound) {
  const double time = witness["time"].finite();
  require(0 <= time && time <= 1, "a witness is at no time");
  require(witness["pieces"].list().size() == 2, "a witness is not of two pieces");
  const Body &a = motion.body(ids[0]), &b = motion.body(ids[1]);
  const Pose &X_wa = motion.at(ids[0], time).pose, &X_wb = motion.at(ids[1], time).pose;
  const Named of_a = named(a, witness, 0), of_b = named(b, witness, 1);
  Dyadic reach = bound - a.outer - b.outer;
  for (const Id id : ids) reach += motion.growth(id, time);
  for (const Pose* pose : {&X_wa, &X_wb})
    if (pose->is_rounded) reach -= blur();
  const bool is_rounded = X_wa.is_rounded || X_wb.is_rounded;
  for (const Named* side : {&of_a, &of_b}) reach += side->part->radius() - side->off;
  if (const Value* within = witness.find("within")) {
    const std::size_t around = within->index(2);
    const ConvexPart& solid = *(around == 0 ? of_a : of_b).whole;
    require(solid.is_solid(), "a surface that is no solid is around nothing");
    const Difference d = all_around(witness, of_a, of_b, around, X_wa, X_wb);
    require(!is_rounded || !d.has_far_points(), kTooFar);
    return check_surface(witness, d.points, d.divisor, -reach, &solid.faces());
  }
  const Difference d = difference(witness, of_a, of_b, X_wa, X_wb);
  require(!is_rounded || !d.has_far_points(), kTooFar);
  if (witness.find("faces"))
    check_surface(witness, d.points, d.divisor, -reach);
  else
    check_points(witness, d, reach, normals(of_a, of_b, X_wa, X_wb));
}

}  // namespace clearance::certificate_oracle
