// Possible savings of a scene: unused bodies, copies, inner parts, and hulls that are spheres or boxes.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <tuple>

#include "engine/base/fp_environment.h"
#include "engine/hull/hull.h"
#include "engine/hull/qhull_guess.h"
#include "inspect/inspect.h"
#include "inspect/simpler_shapes.h"

namespace clearance {

namespace {

constexpr std::uint64_t kWorthSharing = 4096;  // bytes
constexpr std::size_t kFewVertices = 8;        // no box is cheaper than so many

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
    if (p.radius > q.radius || p.vertices.size() + q.vertices.size() > kMostQhullVertices) return false;
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
    if (const auto sphere = find_sphere(part, allowed)) return add_sphere(b, part, *sphere);
    if (part->vertices.size() > kMostQhullVertices) return;
    const std::vector<Triangle> faces = qhull_triangles(part->vertices);
    if (const auto box = find_box(part, faces, allowed)) return add_box(b, part, *box);
    std::set<std::uint32_t> corners;
    for (const Triangle& t : faces) corners.insert(t.begin(), t.end());
    if (const std::size_t flat = part->vertices.size() - corners.size(); !faces.empty() && flat > 0)
      add(Finding::Kind::kFlatVertices, b,
          text("%zu of its %zu vertices lie in the surface that the others span, to rounding", flat,
               part->vertices.size()) +
              also_for(part));
  }

  void add_sphere(std::uint32_t b, const ConvexPartPtr& part, const SphereAround& s) {
    add(Finding::Kind::kSphere, b,
        text("a sphere of radius %.6g m at [%.6g, %.6g, %.6g] holds it and stands out by at most %.2g m: 1 vertex in "
             "place of %zu",
             s.radius + part->radius, s.centre.x, s.centre.y, s.centre.z, s.error, part->vertices.size()) +
            also_for(part))
        .error = s.error;
  }

  void add_box(std::uint32_t b, const ConvexPartPtr& part, const BoxAround& box) {
    const Vec3d &size = box.size, &at = box.pose.translation;
    add(Finding::Kind::kBox, b,
        text("a box of %.6g x %.6g x %.6g m at [%.6g, %.6g, %.6g, %.6g, %.6g, %.6g, %.6g] holds it and stands out by "
             "at most "
             "%.2g m%s: 8 vertices in place of %zu",
             size.x, size.y, size.z, at.x, at.y, at.z, box.pose.qw, box.pose.qx, box.pose.qy, box.pose.qz, box.error,
             part->radius > 0 ? ", with the radius that it has" : "", part->vertices.size()) +
            also_for(part))
        .error = box.error;
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
