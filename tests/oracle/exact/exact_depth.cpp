#include "tests/oracle/exact/exact_depth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <queue>
#include <stdexcept>
#include <unordered_map>

namespace clearance::exact {

namespace {

/// Penetration depth by an expanding polytope (van den Bergen 2001), exactly. P is a closed polytope of vertices of C
/// with the origin inside or on it, so the depth is at least the distance of the nearest face plane of P. A face of P
/// that no vertex of C tops is a facet of C and will stay. Any other face is expanded by the vertex that tops it most.
/// When every face except the known facets of C is farther than the nearest facet of C, that one is the answer.
class Depth {
 public:
  Depth(const Difference& C, Result& result) : C_(C), result_(result) {}

  /// \param hold vertices of C (one to four) whose hull contains the origin
  void solve(std::vector<Vertex<mpz_class>> hold) {
    if (!make_tetrahedron(hold)) return;  // C is flat: depth 0 along the direction already stored
    while (!queue_.empty()) {
      const auto [near, id] = queue_.top();
      queue_.pop();
      if (faces_[id].dead) continue;
      if (best_ && near > rough_best_ + 0x1p-30) break;
      ++result_.iterations;
      // A copy, since expand() moves the faces.
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
    std::array<int, 3> vertex;  // counterclockwise from outside
    Vec3z normal;               // outwards
    mpz_class offset;           // normal . vertex, >= 0
    bool dead = false;
  };
  struct Entry {
    double near;  // log2(offset / |normal|), within 2^-32, so that numbers of any size have a rank
    int id;
    bool operator<(const Entry& o) const { return near > o.near || (near == o.near && id > o.id); }
  };

  static bool nearer(const Face& f, const Face& g) {
    return f.offset * f.offset * squared_norm(g.normal) < g.offset * g.offset * squared_norm(f.normal);
  }
  static std::uint64_t edge(int from, int to) {
    return static_cast<std::uint64_t>(from) << 32 | static_cast<std::uint32_t>(to);
  }

  /// Adds vertices of C until four are independent. Returns false if C is flat, with its normal in result_.
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
      // All of C has the height of s along this normal, and the hull of s contains the origin: C lies in a plane
      // through it.
      result_.direction = normal;
      return false;
    }
    mpz_class side = dot(cross(s[1].c - s[0].c, s[2].c - s[0].c), s[3].c - s[0].c);
    if (side > 0) std::swap(s[1], s[2]);
    vertices_ = s;
    for (const auto& f : {std::array{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}}) add_face(f);
    return true;
  }

  /// A direction orthogonal to the span of one to three independent points.
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
    if (f.offset < 0 || squared_norm(f.normal) == 0)
      throw std::logic_error("exact_distance: the polytope lost the origin");
    const int id = static_cast<int>(faces_.size());
    for (int k = 0; k < 3; ++k) face_of_[edge(v[k], v[(k + 1) % 3])] = id;
    queue_.push({rough_distance(f), id});
    faces_.push_back(std::move(f));
  }

  static double rough_distance(const Face& f) {
    if (f.offset == 0) return -std::numeric_limits<double>::infinity();
    long eo, en;
    const double o = mpz_get_d_2exp(&eo, f.offset.get_mpz_t()),
                 n2 = mpz_get_d_2exp(&en, mpz_class(squared_norm(f.normal)).get_mpz_t());
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

}  // namespace

void solve_depth(const Difference& C, std::vector<Vertex<mpz_class>> hold, Result& result) {
  Depth(C, result).solve(std::move(hold));
}

}  // namespace clearance::exact
