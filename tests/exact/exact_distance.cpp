#include "exact_distance.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <queue>
#include <stdexcept>
#include <unordered_map>

namespace clearance::exact {

namespace {

// ---- doubles as integers -------------------------------------------------------------------------------------------

/// mantissa * 2^exponent, the mantissa odd or zero.
struct Dyadic {
  long mantissa = 0;
  int exponent = 0;
};

Dyadic dyadic(double v) {
  if (!std::isfinite(v)) throw std::invalid_argument("exact_distance: a number is not finite");
  if (v == 0) return {};
  int exponent;
  long mantissa = static_cast<long>(std::ldexp(std::frexp(v, &exponent), 53));
  exponent -= 53;
  const int zeros = std::countr_zero(static_cast<unsigned long>(mantissa));
  return {mantissa / (1L << zeros), exponent + zeros};
}

/// The least exponent among some numbers, so that each is an integer times 2^exponent.
struct LeastExponent {
  int value = std::numeric_limits<int>::max();
  void include(double v) {
    if (v != 0) value = std::min(value, dyadic(v).exponent);
  }
  void include(const Vec3d& v) {
    for (int k = 0; k < 3; ++k) include(v[k]);
  }
  int get() const { return value == std::numeric_limits<int>::max() ? 0 : value; }
};

/// v / 2^unit, which must be an integer.
mpz_class integer(double v, int unit) {
  const Dyadic d = dyadic(v);
  mpz_class z = d.mantissa;
  if (d.mantissa != 0) z <<= static_cast<unsigned>(d.exponent - unit);
  return z;
}

Vec3z integer(const Vec3d& v, int unit) { return {integer(v.x, unit), integer(v.y, unit), integer(v.z, unit)}; }

mpq_class rational(double v) {
  dyadic(v);  // refuses NaN and infinity
  return mpq_class(v);
}

/// An integer vector scaled by a power of two so that its largest used component is about 1; each component is off by less than
/// 2^-52 of itself, or by 2^-1074 where it underflows. Components not used (all vertices have 0 there) become 0.
Vec3d rounded(const Vec3z& v, const Vec3d& used) {
  double mantissa[3] = {0, 0, 0};
  long exponent[3] = {0, 0, 0}, largest = std::numeric_limits<long>::min();
  for (int k = 0; k < 3; ++k) {
    if (used[k] == 0 || v[k] == 0) continue;
    mantissa[k] = mpz_get_d_2exp(&exponent[k], v[k].get_mpz_t());
    largest = std::max(largest, exponent[k]);
  }
  Vec3d r{0, 0, 0};
  for (int k = 0; k < 3; ++k)
    if (mantissa[k] != 0) r[k] = std::ldexp(mantissa[k], static_cast<int>(std::max(exponent[k] - largest, -5000L)));
  return r;
}

// ---- posed pieces --------------------------------------------------------------------------------------------------

/// A piece with its rotation M / n in integers.
class PosedPiece {
 public:
  PosedPiece(const PieceView& piece, const Pose& X) : vertices_(piece.vertices) {
    if (vertices_.empty()) throw std::invalid_argument("exact_distance: a piece has no vertices");
    for (const Vec3d& v : vertices_) {
      exponent_.include(v);
      for (int k = 0; k < 3; ++k) largest_[k] = std::max(largest_[k], std::abs(v[k]));
    }
    LeastExponent e;
    for (const double q : {X.qw, X.qx, X.qy, X.qz}) e.include(q);
    const mpz_class w = integer(X.qw, e.get()), x = integer(X.qx, e.get()), y = integer(X.qy, e.get()),
                    z = integer(X.qz, e.get());
    n = w * w + x * x + y * y + z * z;
    if (n == 0) throw std::invalid_argument("exact_distance: a quaternion is zero");
    M.row[0] = {w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)};
    M.row[1] = {2 * (x * y + w * z), w * w + y * y - x * x - z * z, 2 * (y * z - w * x)};
    M.row[2] = {2 * (x * z - w * y), 2 * (y * z + w * x), w * w + z * z - x * x - y * y};
    mpz_class common = n;
    for (const Vec3z& row : M.row)
      for (int k = 0; k < 3; ++k) common = gcd(common, row[k]);
    n /= common;
    for (Vec3z& row : M.row)
      for (int k = 0; k < 3; ++k) row[k] /= common;
  }

  std::size_t size() const { return vertices_.size(); }
  const LeastExponent& exponent() const { return exponent_; }
  /// M v, as integers of the unit 2^unit.
  Vec3z rotated(std::uint32_t i, int unit) const { return M * integer(vertices_[i], unit); }

  /// The index of a vertex v with the largest direction . (M v). Exact: doubles only discard vertices that are lower by more
  /// than any rounding could account for; the rest are compared as integers.
  std::uint32_t highest(const Vec3z& direction) const {
    const Vec3z m = M.transpose_times(direction);
    const Vec3d f = rounded(m, largest_);
    // |f.v as computed - its exact value| <= (2^-52 + 4 * 2^-53) sum |f_k v_k|, and a little more where it underflows.
    const double reach = std::abs(f.x) * largest_.x + std::abs(f.y) * largest_.y + std::abs(f.z) * largest_.z;
    const double margin = 0x1p-48 * reach + 0x1p-1060 * (1 + largest_.x + largest_.y + largest_.z);
    approximate_.resize(vertices_.size());
    double best = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const Vec3d& v = vertices_[i];
      approximate_[i] = f.x * v.x + f.y * v.y + f.z * v.z;
      best = std::max(best, approximate_[i]);
    }
    std::optional<std::uint32_t> winner;
    mpz_class winning, height;
    candidates_.clear();
    for (std::size_t i = 0; i < vertices_.size(); ++i)
      if (!(approximate_[i] < best - 2 * margin)) candidates_.push_back(static_cast<std::uint32_t>(i));
    if (candidates_.size() == 1) return candidates_[0];
    for (const std::uint32_t i : candidates_) {
      height = 0;
      for (int k = 0; k < 3; ++k) add_product(height, m[k], vertices_[i][k]);
      if (!winner || height > winning) {
        winner = i;
        swap(winning, height);
      }
    }
    return *winner;
  }

  Mat3<mpz_class> M;
  mpz_class n;

 private:
  /// sum += m v / 2^exponent_
  void add_product(mpz_class& sum, const mpz_class& m, double v) const {
    if (v == 0) return;
    const Dyadic d = dyadic(v);
    product_ = m * d.mantissa;
    product_ <<= static_cast<unsigned>(d.exponent - exponent_.get());
    sum += product_;
  }

  std::span<const Vec3d> vertices_;
  Vec3d largest_{0, 0, 0};
  LeastExponent exponent_;
  mutable std::vector<double> approximate_;
  mutable std::vector<std::uint32_t> candidates_;
  mutable mpz_class product_;
};

template <class T>
struct Vertex {
  VertexPair index;
  Vec3<T> c;  // a vertex of the difference B - A
};

/// The difference C = B - A, in integers: c * 2^unit / (n_a n_b) is in metres, in the world's axes.
class Difference {
 public:
  using Scalar = mpz_class;

  Difference(const PieceView& a, const Pose& X_wa, const PieceView& b, const Pose& X_wb) : a_(a, X_wa), b_(b, X_wb) {
    LeastExponent e = a_.exponent();
    e.value = std::min(e.value, b_.exponent().value);
    e.include(X_wa.translation);
    e.include(X_wb.translation);
    unit_ = e.get();
    const mpz_class n = a_.n * b_.n;
    offset_ = n * (integer(X_wb.translation, unit_) - integer(X_wa.translation, unit_));
    radius_ = rational(a.radius) + rational(b.radius);
  }

  Vertex<mpz_class> at(VertexPair i) const {
    return {i, a_.n * b_.rotated(i.b, unit_) + offset_ - b_.n * a_.rotated(i.a, unit_)};
  }
  /// The vertex of C lowest along a direction.
  Vertex<mpz_class> lowest(const Vec3z& direction) const { return at({a_.highest(direction), b_.highest(-direction)}); }

  /// A core distance sign * |height| / |direction| in units of C, as a value in metres with the radii taken off.
  Value value(int sign, const mpz_class& height, const Vec3z& direction) const {
    Value v;
    v.sign = height == 0 ? 0 : sign;
    v.radius = radius_;
    if (v.sign == 0) return v;
    const mpz_class n = a_.n * b_.n;
    v.numerator = height * height;
    v.denominator = squared_norm(direction) * n * n;
    if (unit_ >= 0) v.numerator <<= static_cast<unsigned>(2 * unit_);
    else v.denominator <<= static_cast<unsigned>(-2 * unit_);
    return v;
  }

 private:
  PosedPiece a_, b_;
  int unit_ = 0;
  Vec3z offset_;
  mpq_class radius_;
};

/// The same difference in doubles, for a first guess.
class RoughDifference {
 public:
  using Scalar = double;

  RoughDifference(const PieceView& a, const Pose& X_wa, const PieceView& b, const Pose& X_wb) {
    const auto place = [](const PieceView& piece, const Pose& X, const Vec3d& t, std::vector<Vec3d>& out) {
      const Mat3d R = rotation_of(X);
      for (const Vec3d& v : piece.vertices) out.push_back(R * v + t);
    };
    place(a, X_wa, {0, 0, 0}, a_);
    place(b, X_wb, X_wb.translation - X_wa.translation, b_);
  }
  Vertex<double> at(VertexPair i) const { return {i, b_[i.b] - a_[i.a]}; }
  Vertex<double> lowest(const Vec3d& d) const {
    VertexPair best;
    double high = -std::numeric_limits<double>::infinity(), low = -high;
    for (std::uint32_t i = 0; i < a_.size(); ++i)
      if (const double h = dot(d, a_[i]); h > high) high = h, best.a = i;
    for (std::uint32_t i = 0; i < b_.size(); ++i)
      if (const double h = dot(d, b_[i]); h < low) low = h, best.b = i;
    return at(best);
  }

 private:
  std::vector<Vec3d> a_, b_;
};

// ---- nearest point of a simplex ------------------------------------------------------------------------------------

/// Where the hull of a few points is nearest to the origin: in the open hull of an independent subset.
template <class T>
struct Feature {
  std::vector<Vertex<T>> vertices;
  std::vector<T> weights;    // > 0, of the nearest point; their sum is not 1
  Vec3<T> direction{0, 0, 0};  // parallel to the nearest point, not of its length
  T height = 0;              // direction . c of each vertex c; 0: the origin is in the hull
};

/// The point of the affine hull of one to three points that is nearest to the origin; nothing if the points are dependent or
/// the point is not in their open hull.
template <class T>
std::optional<Feature<T>> nearest_of_subset(std::vector<Vertex<T>> s) {
  Feature<T> f;
  if (s.size() == 1) {
    f.weights = {T(1)};
    f.direction = s[0].c;
  } else if (s.size() == 2) {
    const Vec3<T>&p = s[0].c, &q = s[1].c;
    const Vec3<T> e = q - p;
    const T pe = dot(p, e), qe = dot(q, e);
    if (!(pe < 0 && qe > 0)) return std::nullopt;
    f.weights = {qe, T(-pe)};
    f.direction = T(qe - pe) * p - pe * e;
  } else {
    const Vec3<T>&p = s[0].c, &q = s[1].c, &r = s[2].c;
    Vec3<T> n = cross(q - p, r - p);
    f.weights = {dot(n, cross(q, r)), dot(n, cross(r, p)), dot(n, cross(p, q))};
    for (const T& w : f.weights)
      if (!(w > 0)) return std::nullopt;  // also if n = 0
    f.direction = dot(n, p) < 0 ? -n : n;
  }
  f.height = dot(f.direction, s[0].c);
  f.vertices = std::move(s);
  return f;
}

/// The nearest point of the hull of one to four points. In exact arithmetic it always finds one: by Caratheodory's theorem the
/// nearest point lies in the open hull of some independent subset, and there the other points are not lower. Four points
/// without such a proper subset are independent and hold the origin inside. In doubles it may find none.
template <class T>
std::optional<Feature<T>> nearest_of(const std::vector<Vertex<T>>& s) {
  const unsigned all = (1u << s.size()) - 1;
  for (unsigned mask = 1; mask <= all && mask < 15; ++mask) {
    std::vector<Vertex<T>> subset;
    for (std::size_t i = 0; i < s.size(); ++i)
      if (mask >> i & 1) subset.push_back(s[i]);
    const auto f = nearest_of_subset(std::move(subset));
    if (!f) continue;
    bool nearest = true;
    for (std::size_t i = 0; i < s.size() && nearest; ++i)
      if (!(mask >> i & 1) && dot(f->direction, s[i].c) < f->height) nearest = false;
    if (nearest) return f;
  }
  if (s.size() < 4) return std::nullopt;
  Feature<T> inside;
  inside.vertices = s;
  return inside;
}

/// Gilbert's descent (Gilbert, Johnson, Keerthi 1988): the nearest point of a simplex, then the vertex of C lowest towards
/// the origin, until no vertex is lower than the simplex. Exactly: |nearest point| falls strictly with every step, so that no
/// simplex returns and the loop ends. With doubles it only proposes: it ends where they show no clear progress.
template <class Shape>
Feature<typename Shape::Scalar> descend(const Shape& C, std::vector<VertexPair> start, int limit, double progress, int* steps) {
  using T = typename Shape::Scalar;
  std::vector<Vertex<T>> simplex;
  for (const VertexPair& i : start) simplex.push_back(C.at(i));
  Feature<T> f;
  for (int step = 0; step < limit; ++step) {
    if (steps) ++*steps;
    auto next = nearest_of(simplex);
    if (!next) return f;  // doubles only
    f = std::move(*next);
    if (f.height == 0) return f;
    Vertex<T> c = C.lowest(f.direction);
    const T h = dot(f.direction, c.c);
    if constexpr (std::is_same_v<T, double>) {
      if (!(h < (1 - progress) * f.height)) return f;
    } else {
      if (h >= f.height) return f;
    }
    simplex = f.vertices;
    simplex.push_back(std::move(c));
  }
  if constexpr (std::is_same_v<T, double>) return f;
  throw std::logic_error("exact_distance: the descent did not end");
}

// ---- depth ---------------------------------------------------------------------------------------------------------

/// Penetration depth by an expanding polytope (van den Bergen 2001), exactly. P is a closed polytope of vertices of C with the
/// origin inside or on it, so the depth is at least the distance of the nearest face plane of P. A face of P that no vertex of
/// C tops is a facet of C and will stay. Any other face is expanded by the vertex that tops it most. When every face that is not
/// known as a facet of C is farther than the nearest facet of C, that one is the answer.
class Depth {
 public:
  Depth(const Difference& C, Result& result) : C_(C), result_(result) {}

  /// \param hold vertices of C (one to four) whose hull holds the origin.
  void solve(std::vector<Vertex<mpz_class>> hold) {
    if (!make_tetrahedron(hold)) return;  // C is flat: depth 0 along the direction already stored
    while (!queue_.empty()) {
      const auto [near, id] = queue_.top();
      queue_.pop();
      if (faces_[id].dead) continue;
      if (best_ && near > rough_best_ + 0x1p-30) break;
      ++result_.iterations;
      // A copy: expand() moves the faces.
      const Vec3z normal = faces_[id].normal;
      Vertex<mpz_class> c = C_.lowest(-normal);
      if (dot(normal, c.c) > faces_[id].offset) {
        expand(id, std::move(c));
        continue;
      }
      if (!best_ || nearer(faces_[id], faces_[*best_])) best_ = id, rough_best_ = near;
      if (faces_[id].offset == 0) break;
    }
    const Face& f = faces_[*best_];
    result_.direction = -f.normal;
    result_.distance = C_.value(-1, f.offset, f.normal);
    result_.simplex.clear();
    for (const int v : f.vertex) result_.simplex.push_back(vertices_[v].index);
  }

 private:
  struct Face {
    std::array<int, 3> vertex;  // counter-clockwise from outside
    Vec3z normal;               // outwards
    mpz_class offset;           // normal . vertex, >= 0
    bool dead = false;
  };
  struct Entry {
    double near;  // log2(offset / |normal|), off by less than 2^-32: any size of number has a place
    int id;
    bool operator<(const Entry& o) const { return near > o.near || (near == o.near && id > o.id); }
  };

  static bool nearer(const Face& f, const Face& g) {
    return f.offset * f.offset * squared_norm(g.normal) < g.offset * g.offset * squared_norm(f.normal);
  }
  static std::uint64_t edge(int from, int to) {
    return static_cast<std::uint64_t>(from) << 32 | static_cast<std::uint32_t>(to);
  }

  /// Adds vertices of C until four are independent. False: C is flat, and result_ says along which direction.
  bool make_tetrahedron(std::vector<Vertex<mpz_class>>& s) {
    while (s.size() < 4) {
      const std::size_t before = s.size();
      const Vec3z normal = normal_to(s);
      for (const Vec3z& d : {normal, Vec3z(-normal)}) {
        Vertex<mpz_class> c = C_.lowest(d);
        if (dot(d, c.c) == dot(d, s[0].c)) continue;
        s.push_back(std::move(c));
        break;
      }
      if (s.size() > before) continue;
      // All of C has the height of s along this normal, and the hull of s holds the origin: C lies in a plane through it.
      result_.direction = normal;
      return false;
    }
    mpz_class side = dot(cross(s[1].c - s[0].c, s[2].c - s[0].c), s[3].c - s[0].c);
    if (side > 0) std::swap(s[1], s[2]);
    vertices_ = s;
    for (const auto& f : {std::array{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}}) add_face(f);
    return true;
  }

  /// A direction orthogonal to all that one to three independent points span.
  static Vec3z normal_to(const std::vector<Vertex<mpz_class>>& s) {
    if (s.size() == 1) return {1, 0, 0};
    const Vec3z e = s[1].c - s[0].c;
    if (s.size() == 3) return cross(e, s[2].c - s[0].c);
    if (e.x == 0 && e.y == 0) return {1, 0, 0};
    return {e.y, mpz_class(-e.x), 0};
  }

  void add_face(const std::array<int, 3>& v) {
    Face f;
    f.vertex = v;
    const Vec3z &p = vertices_[v[0]].c, &q = vertices_[v[1]].c, &r = vertices_[v[2]].c;
    f.normal = cross(q - p, r - p);
    f.offset = dot(f.normal, p);
    if (f.offset < 0 || squared_norm(f.normal) == 0) throw std::logic_error("exact_distance: the polytope lost the origin");
    const int id = static_cast<int>(faces_.size());
    for (int k = 0; k < 3; ++k) face_of_[edge(v[k], v[(k + 1) % 3])] = id;
    queue_.push({rough_distance(f), id});
    faces_.push_back(std::move(f));
  }

  static double rough_distance(const Face& f) {
    if (f.offset == 0) return -std::numeric_limits<double>::infinity();
    long eo, en;
    const double o = mpz_get_d_2exp(&eo, f.offset.get_mpz_t()), n2 = mpz_get_d_2exp(&en, mpz_class(squared_norm(f.normal)).get_mpz_t());
    return static_cast<double>(eo) - 0.5 * static_cast<double>(en) + std::log2(o) - 0.5 * std::log2(n2);
  }

  /// Replaces all faces that see c by a cone from their border to c.
  void expand(int seed, Vertex<mpz_class> c) {
    std::vector<int> visible{seed};
    faces_[seed].dead = true;
    std::vector<std::pair<int, int>> border;
    for (std::size_t i = 0; i < visible.size(); ++i) {
      const std::array<int, 3> v = faces_[visible[i]].vertex;
      for (int k = 0; k < 3; ++k) {
        const int from = v[k], to = v[(k + 1) % 3], other = face_of_.at(edge(to, from));
        Face& g = faces_[other];
        if (g.dead) continue;
        if (dot(g.normal, c.c) > g.offset) {
          g.dead = true;
          visible.push_back(other);
        } else {
          border.emplace_back(from, to);
        }
      }
    }
    for (const int id : visible)
      for (int k = 0; k < 3; ++k) face_of_.erase(edge(faces_[id].vertex[k], faces_[id].vertex[(k + 1) % 3]));
    const int top = static_cast<int>(vertices_.size());
    vertices_.push_back(std::move(c));
    for (const auto& [from, to] : border) add_face({from, to, top});
  }

  const Difference& C_;
  Result& result_;
  std::vector<Vertex<mpz_class>> vertices_;
  std::vector<Face> faces_;
  std::unordered_map<std::uint64_t, int> face_of_;  // directed edge -> the face on its left
  std::priority_queue<Entry> queue_;
  std::optional<int> best_;
  double rough_best_ = 0;
};

// ---- values --------------------------------------------------------------------------------------------------------

/// Doubles in order as integers.
std::int64_t rank_of(double x) {
  const std::int64_t bits = std::bit_cast<std::int64_t>(x);
  return bits >= 0 ? bits : std::numeric_limits<std::int64_t>::min() - bits;
}
double of_rank(std::int64_t r) {
  return std::bit_cast<double>(r >= 0 ? r : std::numeric_limits<std::int64_t>::min() - r);
}

}  // namespace

int Value::compare(double x) const {
  const mpq_class y = rational(x) + radius;  // sign * sqrt(numerator / denominator) against y
  const int y_sign = sgn(y);
  if (sign != y_sign) return sign > y_sign ? 1 : -1;
  if (sign == 0) return 0;
  const mpz_class left = numerator * y.get_den() * y.get_den(), right = denominator * y.get_num() * y.get_num();
  return sign * sgn(mpz_class(left - right));
}

int Value::compare(const Value& other) const {
  if (radius != other.radius) throw std::invalid_argument("exact::Value::compare: radii differ");
  if (sign != other.sign) return sign > other.sign ? 1 : -1;
  if (sign == 0) return 0;
  return sign * sgn(mpz_class(numerator * other.denominator - other.numerator * denominator));
}

double Value::lower() const {
  constexpr unsigned kBits = 512;
  mpf_class root(0, kBits), quotient(0, kBits);
  quotient = mpf_class(numerator, kBits) / mpf_class(denominator, kBits);
  root = sqrt(quotient);
  mpf_class guess(0, kBits);
  guess = sign * root - mpf_class(radius, kBits);
  // The guess is almost always right or one off; the steps double in case it is not.
  const auto not_above = [&](std::int64_t r) { return compare(of_rank(r)) >= 0; };
  std::int64_t low = rank_of(compare(0.0) == 0 ? 0.0 : guess.get_d()), high = low;
  for (std::int64_t step = 1; !not_above(low); step *= 2) high = low, low -= step;
  for (std::int64_t step = 1; not_above(high); step *= 2) low = high, high += step;
  while (high - low > 1) {
    const std::int64_t middle = low + (high - low) / 2;
    (not_above(middle) ? low : high) = middle;
  }
  return of_rank(low);
}

double Value::upper() const {
  const double x = lower();
  return compare(x) == 0 ? x : std::nextafter(x, std::numeric_limits<double>::infinity());
}

Result exact_distance(const PieceView& a, const Pose& X_wa, const PieceView& b, const Pose& X_wb, bool depth) {
  const Difference C(a, X_wa, b, X_wb);
  std::vector<VertexPair> start;
  for (const auto& v : descend(RoughDifference(a, X_wa, b, X_wb), {{0, 0}}, 60, 1e-13, nullptr).vertices)
    start.push_back(v.index);
  if (start.empty()) start = {{0, 0}};

  Result result;
  Feature<mpz_class> f = descend(C, start, 1000000, 0, &result.iterations);
  if (f.height != 0) {
    result.direction = f.direction;
    result.distance = C.value(1, f.height, f.direction);
    result.weights = std::move(f.weights);
    for (const auto& v : f.vertices) result.simplex.push_back(v.index);
    return result;
  }
  result.cores_overlap = true;
  result.distance = C.value(0, 0, {1, 0, 0});
  if (depth) Depth(C, result).solve(std::move(f.vertices));
  return result;
}

Value exact_support_gap(const PieceView& a, const Pose& X_wa, const PieceView& b, const Pose& X_wb, const Vec3d& n) {
  const Difference C(a, X_wa, b, X_wb);
  LeastExponent e;
  e.include(n);
  const Vec3z direction = integer(n, e.get());
  if (squared_norm(direction) == 0) throw std::invalid_argument("exact_support_gap: the direction is zero");
  const mpz_class gap = dot(direction, C.lowest(direction).c);
  return C.value(sgn(gap), gap, direction);
}

}  // namespace clearance::exact
