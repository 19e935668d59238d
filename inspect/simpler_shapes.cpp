#include "inspect/simpler_shapes.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "engine/engine.h"

namespace clearance {

namespace {

constexpr int kBallSteps = 500, kFirstBallStep = 50;

// Upper bounds on the (signed) distance between each point and the core of a convex part, in its body's frame.
std::vector<double> upper_distances(const ConvexPartPtr& part, const std::vector<Vec3d>& points, bool depth,
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

// Candidate axes (columns) of a box around the part: the body's, the principal ones, and those of its largest faces.
std::vector<Eigen::Matrix3d> axes_around(const ConvexPart& part, const std::vector<Triangle>& faces) {
  std::vector<Eigen::Matrix3d> all{Eigen::Matrix3d::Identity()};
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vec3d& v : part.vertices) {
    const Eigen::Vector3d d(v.x - part.centre.x, v.y - part.centre.y, v.z - part.centre.z);
    spread += d * d.transpose();
  }
  all.push_back(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors());
  std::vector<std::pair<double, Eigen::Vector3d>> normals;
  for (const Triangle& t : faces) {
    const Vec3d n = cross(part.vertices[t[1]] - part.vertices[t[0]], part.vertices[t[2]] - part.vertices[t[0]]);
    if (norm(n) > 0) normals.push_back({norm(n), Eigen::Vector3d(n.x, n.y, n.z) / norm(n)});
  }
  std::sort(normals.begin(), normals.end(), [](const auto& p, const auto& q) { return p.first > q.first; });
  for (const auto& [area, n] : normals) {
    const Eigen::Vector3d first = normals[0].second;
    if (std::abs(n.dot(first)) > 0.1) continue;
    Eigen::Matrix3d axes;
    axes.col(0) = first;
    axes.col(1) = (n - n.dot(first) * first).normalized();
    axes.col(2) = axes.col(0).cross(axes.col(1));
    all.push_back(axes);
    break;
  }
  return all;
}

struct FittedBox {
  Eigen::Matrix3d axes;  // columns
  Eigen::Vector3d low, high;
};

// The smallest of the boxes along the candidate axes.
FittedBox fit_box(const ConvexPart& part, const std::vector<Triangle>& faces) {
  constexpr double kInf = std::numeric_limits<double>::infinity();
  double least = kInf;
  FittedBox best{Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  for (const Eigen::Matrix3d& axes : axes_around(part, faces)) {
    Eigen::Vector3d low = Eigen::Vector3d::Constant(kInf), high = -low;
    for (const Vec3d& v : part.vertices) {
      const Eigen::Vector3d p = axes.transpose() * Eigen::Vector3d(v.x, v.y, v.z);
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    if (const double volume = (high - low).prod(); volume < least * (1 - 1e-9)) {  // of equal ones the first
      least = volume;
      best = {axes, low, high};
    }
  }
  return best;
}

}  // namespace

// A small ball around the vertices: Badoiu and Clarkson, "Smaller core-sets for balls" (2003): steps towards the
// farthest vertex that grow shorter, short ones from the start since the box's centre is a good one.
std::optional<SphereAround> find_sphere(const ConvexPartPtr& part, double allowed) {
  Vec3d centre = part->centre;
  const auto farthest = [&] {
    std::pair<double, const Vec3d*> far{-1, nullptr};
    for (const Vec3d& v : part->vertices)
      if (const double d = squared_norm(v - centre); d > far.first) far = {d, &v};
    return far;
  };
  // Cheap test first: along the axes a ball reaches as far as the part.
  for (int k = 0; k < 3; ++k)
    if (part->spread - part->half[k] > 2 * allowed) return std::nullopt;
  const int steps = part->vertices.size() > kMostQhullVertices ? 4 : kBallSteps;
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
  if (!(error <= allowed)) return std::nullopt;
  return SphereAround{centre, radius, error};
}

std::optional<BoxAround> find_box(const ConvexPartPtr& part, const std::vector<Triangle>& faces, double allowed) {
  auto [axes, low, high] = fit_box(*part, faces);
  if (!((high - low).minCoeff() > 0)) return std::nullopt;  // flat
  std::vector<Vec3d> corners;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d c =
        axes * Eigen::Vector3d((i & 1 ? high : low).x(), (i & 2 ? high : low).y(), (i & 4 ? high : low).z());
    corners.push_back({c.x(), c.y(), c.z()});
  }
  // The box is the hull of its corners, so a corner is its farthest point from the part.
  const std::vector<double> distances = upper_distances(part, corners, false, 0.1 * allowed);
  const double error = *std::max_element(distances.begin(), distances.end());
  if (!(error <= allowed)) return std::nullopt;
  const Eigen::Vector3d size = high - low, centre = axes * (0.5 * (low + high));
  if (axes.determinant() < 0) axes.col(2) *= -1;
  const Eigen::Quaterniond q(axes);
  BoxAround box{{}, {size.x(), size.y(), size.z()}, error};
  box.pose.qw = q.w();
  box.pose.qx = q.x();
  box.pose.qy = q.y();
  box.pose.qz = q.z();
  box.pose.translation = {centre.x(), centre.y(), centre.z()};
  return box;
}

}  // namespace clearance
