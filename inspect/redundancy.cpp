// Possible savings of a scene: unused bodies, copies, inner parts, and hulls that are spheres or boxes.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <set>
#include <tuple>

#include "engine/base/fp_environment.h"
#include "engine/engine.h"
#include "engine/hull/hull.h"
#include "engine/hull/qhull_guess.h"
#include "inspect/inspect.h"

namespace clearance {

namespace {

constexpr std::uint64_t kWorthSharing = 4096;  // bytes
constexpr std::size_t kMostVertices = 20'000;  // limit for Qhull: about a tenth of a second
constexpr std::size_t kFewVertices = 8;        // no box is cheaper than so many
constexpr int kBallSteps = 500, kFirstBallStep = 50;

using Piecewise = std::vector<std::uint64_t>;  // digest of each convex part
using Place = std::tuple<std::uint32_t, double, double, double, double, double, double, double>;  // parent and pose

/// Bodies of one shape: the first of them, and their distinct convex parts.
struct Copies {
  std::uint32_t first;
  std::set<const ConvexPart*> held;
};

Piecewise digests(const Body& body) {
  Piecewise all;
  for (const ConvexPartPtr& part : body.parts) all.push_back(part->digest);
  return all;
}

std::string text(const char* format, auto... values) {
  char buffer[400];
  std::snprintf(buffer, sizeof buffer, format, values...);
  return buffer;
}

class Search {
 public:
  Search(const engine::Scene& scene, double within) : scene_(scene), within_(within) {}

  std::vector<Finding> run(const std::vector<std::uint64_t>& partners) {
    for (const Body& body : scene_.bodies())
      if (body.parts.size() == 1) ++holders_[body.parts[0].get()];
    for (std::uint32_t b = 0; b < scene_.bodies().size(); ++b) {
      if (scene_.bodies()[b].parts.empty()) continue;  // frames are parents only
      if (partners[b] == 0)
        add(Finding::Kind::kUnused, b,
            "no enabled pair touches it: it could be left out, unless it only carries others");
      look_for_copies(b);
      look_inside(b);
      const Body& body = scene_.bodies()[b];
      if (body.parts.size() == 1) look_at_part(b, body.parts[0]);
    }
    return std::move(findings_);
  }

 private:
  // Bodies of several convex parts are not compared with primitives, and not counted.
  std::string also_for(const ConvexPartPtr& part) const {
    const std::size_t others = holders_.at(part.get()) - 1;
    return others == 0 ? "" : text("; the same holds for %zu more that share its shape", others);
  }

  Finding& add(Finding::Kind kind, std::uint32_t body, std::string words) {
    findings_.push_back({kind, body, kNone, {}, std::move(words)});
    return findings_.back();
  }

  void look_for_copies(std::uint32_t b) {
    const Body& body = scene_.bodies()[b];
    const Piecewise shape = digests(body);
    const auto name = [&](std::uint32_t other) { return '"' + scene_.bodies()[other].name + '"'; };
    if (body.pose) {
      const Pose& X = *body.pose;
      Place place{body.parent, X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz};
      const auto [first, fresh] = placed_.try_emplace({shape, place}, b);
      if (!fresh)
        add(Finding::Kind::kDuplicate, b,
            "the same shape at the same pose as " + name(first->second) + ": one of them is enough")
            .other = first->second;
    }
    Copies& copies = copies_.try_emplace(shape, Copies{b, {}}).first->second;
    std::uint64_t bytes = 0;
    for (const ConvexPartPtr& part : body.parts) bytes += resident_bytes(*part);
    if (copies.held.insert(body.parts[0].get()).second && copies.held.size() > 1 && bytes >= kWorthSharing)
      add(Finding::Kind::kUnshared, b,
          "its geometry is that of " + name(copies.first) + ", held once more: " +
              text("%.3g KiB that bodies of one mesh file and scale would share", static_cast<double>(bytes) / 1024))
          .other = copies.first;
  }

  // Returns whether part p is proved to lie inside q: reduce_to_hull() drops only inner vertices.
  static bool holds(const ConvexPart& q, const ConvexPart& p) {
    if (q.surface || p.surface) return false;  // hulls of meshes are not solid
    if (p.radius > q.radius || p.vertices.size() + q.vertices.size() > kMostVertices) return false;
    for (int k = 0; k < 3; ++k)
      if (std::abs(p.centre[k] - q.centre[k]) > q.half[k] - p.half[k] + 1e-12 * q.spread) return false;
    std::vector<Vec3d> both = q.vertices;
    both.insert(both.end(), p.vertices.begin(), p.vertices.end());
    std::set<std::tuple<double, double, double>> outer;
    for (const Vec3d& v : q.vertices) outer.insert({v.x, v.y, v.z});
    const Hull hull = reduce_to_hull(both);
    return std::all_of(hull.vertices.begin(), hull.vertices.end(),
                       [&](const Vec3d& v) { return outer.contains({v.x, v.y, v.z}); });
  }

  void look_inside(std::uint32_t b) {
    const std::vector<ConvexPartPtr>& parts = scene_.bodies()[b].parts;
    std::vector<char> gone(parts.size(), 0);
    for (std::size_t i = 0; i < parts.size(); ++i)
      for (std::size_t j = 0; j < parts.size() && !gone[i]; ++j) {
        if (i == j || gone[j] || !holds(*parts[j], *parts[i])) continue;
        gone[i] = 1;
        add(Finding::Kind::kInnerPart, b, text("piece %zu lies inside piece %zu: it never decides a distance", i, j));
      }
  }

  void look_at_part(std::uint32_t b, const ConvexPartPtr& part) {
    // Findings of a part apply to every body that shares it and are reported once.
    if (part->surface || !seen_.insert(part.get()).second || part->vertices.size() <= kFewVertices) return;
    const double allowed = within_ * (part->spread + part->radius);
    if (look_for_sphere(b, part, allowed)) return;
    if (part->vertices.size() > kMostVertices) return;
    const std::vector<Triangle> faces = qhull_triangles(part->vertices);
    if (look_for_box(b, part, faces, allowed)) return;
    std::set<std::uint32_t> corners;
    for (const Triangle& t : faces) corners.insert(t.begin(), t.end());
    if (const std::size_t flat = part->vertices.size() - corners.size(); !faces.empty() && flat > 0)
      add(Finding::Kind::kFlatVertices, b,
          text("%zu of its %zu vertices lie in the surface that the others span, to rounding", flat,
               part->vertices.size()) +
              also_for(part));
  }

  // Upper bounds on the (signed) distance between each point and the core of a convex part, in its body's frame.
  static std::vector<double> upper_distances(const ConvexPartPtr& part, const std::vector<Vec3d>& points, bool depth,
                                             double abs_tol) {
    const ConvexPartPtr core = part->radius > 0 ? make_convex_part(part->vertices) : part;
    engine::Scene scene;
    std::vector<BodyPair> pairs;
    for (std::size_t i = 0; i <= points.size(); ++i) {
      Body body;
      body.name = std::to_string(i);
      body.parts = {i == 0 ? core : make_convex_part({points[i - 1]})};
      body.pose = Pose{};
      scene.add_body(std::move(body));
      if (i > 0) pairs.push_back({0, static_cast<std::uint32_t>(i)});
    }
    engine::Engine::Options options;
    options.threads = 1;
    const engine::Engine engine(std::move(scene), options);
    QueryView query;
    query.all_pairs = false;
    query.pairs = pairs;
    query.signed_distance = depth;
    query.rel_tol = 0;
    query.abs_tol = abs_tol;
    query.fields = kFieldUpper;
    std::vector<double> upper(pairs.size());
    ReplyView reply;
    reply.rows = pairs.size();
    reply.upper = upper.data();
    engine.start(query, reply).advance();
    return upper;
  }

  // A small ball around the vertices: Badoiu and Clarkson, "Smaller core-sets for balls" (2003): steps towards the
  // farthest vertex that grow shorter, short ones from the start since the box's centre is a good one.
  bool look_for_sphere(std::uint32_t b, const ConvexPartPtr& part, double allowed) {
    Vec3d centre = part->centre;
    const auto farthest = [&] {
      std::pair<double, const Vec3d*> far{-1, nullptr};
      for (const Vec3d& v : part->vertices)
        if (const double d = squared_norm(v - centre); d > far.first) far = {d, &v};
      return far;
    };
    // Cheap test first: along the axes a ball reaches as far as the part.
    for (int k = 0; k < 3; ++k)
      if (part->spread - part->half[k] > 2 * allowed) return false;
    const int steps = part->vertices.size() > kMostVertices ? 4 : kBallSteps;
    Vec3d best = centre;
    double least = farthest().first;
    for (int i = 0; i < steps; ++i) {
      centre += (*farthest().second - centre) * (1.0 / (i + kFirstBallStep));
      if (const double far = farthest().first; far < least) {
        least = far;
        best = centre;
      }
    }
    centre = best;
    const double radius = std::sqrt(least) * (1 + 1e-15);
    // The inscribed ball of the same centre has the centre's depth as its radius.
    const double depth = -upper_distances(part, {centre}, true, 0.1 * allowed)[0];
    const double error = radius - depth;
    if (!(error <= allowed)) return false;
    add(Finding::Kind::kSphere, b,
        text("a sphere of radius %.6g m at [%.6g, %.6g, %.6g] holds it and stands out by at most %.2g m: 1 vertex in "
             "place of %zu",
             radius + part->radius, centre.x, centre.y, centre.z, error, part->vertices.size()) +
            also_for(part))
        .error = error;
    return true;
  }

  struct Frame {
    Eigen::Matrix3d axes;  // columns
  };

  // Candidate axes of a box around the part: the body's, the principal ones, and those of its largest faces.
  static std::vector<Frame> frames(const ConvexPart& part, const std::vector<Triangle>& faces) {
    std::vector<Frame> all{{Eigen::Matrix3d::Identity()}};
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Vec3d& v : part.vertices) {
      const Eigen::Vector3d d(v.x - part.centre.x, v.y - part.centre.y, v.z - part.centre.z);
      spread += d * d.transpose();
    }
    all.push_back({Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors()});
    std::vector<std::pair<double, Eigen::Vector3d>> normals;
    for (const Triangle& t : faces) {
      const Vec3d n = cross(part.vertices[t[1]] - part.vertices[t[0]], part.vertices[t[2]] - part.vertices[t[0]]);
      if (norm(n) > 0) normals.push_back({norm(n), Eigen::Vector3d(n.x, n.y, n.z) / norm(n)});
    }
    std::sort(normals.begin(), normals.end(), [](const auto& p, const auto& q) { return p.first > q.first; });
    for (const auto& [area, n] : normals) {
      const Eigen::Vector3d first = normals[0].second;
      if (std::abs(n.dot(first)) > 0.1) continue;
      Frame f;
      f.axes.col(0) = first;
      f.axes.col(1) = (n - n.dot(first) * first).normalized();
      f.axes.col(2) = f.axes.col(0).cross(f.axes.col(1));
      all.push_back(f);
      break;
    }
    return all;
  }

  bool look_for_box(std::uint32_t b, const ConvexPartPtr& part, const std::vector<Triangle>& faces, double allowed) {
    double least = std::numeric_limits<double>::infinity();
    Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = low;
    Frame best{Eigen::Matrix3d::Identity()};
    for (const Frame& f : frames(*part, faces)) {
      Eigen::Vector3d l = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity()), h = -l;
      for (const Vec3d& v : part->vertices) {
        const Eigen::Vector3d p = f.axes.transpose() * Eigen::Vector3d(v.x, v.y, v.z);
        l = l.cwiseMin(p);
        h = h.cwiseMax(p);
      }
      if (const double volume = (h - l).prod(); volume < least * (1 - 1e-9)) {  // of equal ones the first
        least = volume;
        low = l;
        high = h;
        best = f;
      }
    }
    if (!((high - low).minCoeff() > 0)) return false;  // flat
    std::vector<Vec3d> corners;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d c =
          best.axes * Eigen::Vector3d((i & 1 ? high : low).x(), (i & 2 ? high : low).y(), (i & 4 ? high : low).z());
      corners.push_back({c.x(), c.y(), c.z()});
    }
    // The box is the hull of its corners, so a corner is its farthest point from the part.
    const std::vector<double> distances = upper_distances(part, corners, false, 0.1 * allowed);
    const double error = *std::max_element(distances.begin(), distances.end());
    if (!(error <= allowed)) return false;
    const Eigen::Vector3d size = high - low, centre = best.axes * (0.5 * (low + high));
    if (best.axes.determinant() < 0) best.axes.col(2) *= -1;
    const Eigen::Quaterniond q(best.axes);
    add(Finding::Kind::kBox, b,
        text("a box of %.6g x %.6g x %.6g m at [%.6g, %.6g, %.6g, %.6g, %.6g, %.6g, %.6g] holds it and stands out by "
             "at most "
             "%.2g m%s: 8 vertices in place of %zu",
             size.x(), size.y(), size.z(), centre.x(), centre.y(), centre.z(), q.w(), q.x(), q.y(), q.z(), error,
             part->radius > 0 ? ", with the radius that it has" : "", part->vertices.size()) +
            also_for(part))
        .error = error;
    return true;
  }

  const engine::Scene& scene_;
  double within_;
  std::map<std::pair<Piecewise, Place>, std::uint32_t> placed_;
  std::map<Piecewise, Copies> copies_;
  std::set<const ConvexPart*> seen_;
  std::map<const ConvexPart*, std::size_t> holders_;  // number of bodies that consist of this part alone
  std::vector<Finding> findings_;
};

}  // namespace

const char* name_of(Finding::Kind kind) {
  switch (kind) {
    case Finding::Kind::kUnused:
      return "unused";
    case Finding::Kind::kDuplicate:
      return "duplicate";
    case Finding::Kind::kUnshared:
      return "unshared";
    case Finding::Kind::kInnerPart:
      return "inner_piece";
    case Finding::Kind::kFlatVertices:
      return "flat_vertices";
    case Finding::Kind::kSphere:
      return "sphere";
    case Finding::Kind::kBox:
      return "box";
  }
  return "";
}

std::vector<Finding> find_redundancy(const engine::Scene& scene, const std::vector<std::uint64_t>& partners,
                                     double within) {
  const FpEnvironment environment;
  return Search(scene, within).run(partners);
}

}  // namespace clearance
