// Upper bounds: two points, or a surface around a ball of the difference of two pieces.
#include <algorithm>

#include "bounds.h"

namespace clearance::judge {
namespace {

// The points of a piece that a witness names: its vertices, or of a round core points that it gives itself.
struct Named {
  const Piece *piece = nullptr, *whole = nullptr;
  std::vector<Vector> points;  // of a round core
  Dyadic off;                  // no point is farther from the core

  std::size_t count() const { return piece->is_round() ? points.size() : piece->count(); }
  Vector at(std::size_t k) const { return piece->is_round() ? points[k] : piece->vertex(k); }
};

Named named(const Body& body, const Value& witness, std::size_t side) {
  Named named;
  const std::size_t place = witness["pieces"].at(side).index(body.pieces.size());
  named.piece = body.pieces[place];
  named.whole = body.whole_of[place];
  if (!named.piece->is_round()) return named;
  for (const Value& p : witness["points"].at(side).list()) {
    named.points.push_back(p.vector_of_sums());
    named.off = std::max(named.off, named.piece->off(named.points.back()));
  }
  return named;
}

// The points of a - b that a witness names, in a's axes, times `divisor`.
struct Difference {
  std::vector<Vector> points;
  Dyadic divisor;
};

// Of a witness that a solid is around: all vertices of that, and the one of the other that the witness names.
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

void check_points(const Value& witness, const Difference& d, const Dyadic& reach) {
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
  require(most.sign() >= 0 && dot(sum, sum) <= most * most, "the witness points are farther apart than upper");
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
  for (const Pose* pose : {&X_wa, &X_wb})
    if (pose->is_rounded) reach -= blur();
  for (const Named* side : {&of_a, &of_b}) reach += side->piece->radius() - side->off;
  if (const Value* within = witness.find("within")) {
    const std::size_t around = within->index(2);
    const Piece& solid = *(around == 0 ? of_a : of_b).whole;
    require(solid.is_solid(), "a surface that is no solid is around nothing");
    const Difference d = all_around(witness, of_a, of_b, around, X_wa, X_wb);
    return check_surface(witness, d.points, d.divisor, -reach, &solid.faces());
  }
  const Difference d = difference(witness, of_a, of_b, X_wa, X_wb);
  if (witness.find("faces"))
    check_surface(witness, d.points, d.divisor, -reach);
  else
    check_points(witness, d, reach);
}

}  // namespace clearance::judge
