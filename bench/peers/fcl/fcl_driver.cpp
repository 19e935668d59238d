// FCL as a contender: fcl::distance, and fcl::collide for depths, by libccd. (GST_INDEP is wrong on ordinary pairs.)
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>

#include "bench/peers/driver.h"

namespace {

using fcl::Vector3d;

class FclPeer {
 public:
  struct Geometry {
    std::unique_ptr<fcl::CollisionGeometryd> shape;
    fcl::Transform3d at = fcl::Transform3d::Identity();
    bool sphere = false;
    double radius = 0;  // subtracted from the distance, because FCL has no rounded hulls
  };
  using Transform = fcl::Transform3d;
  struct Cache {};

  static std::vector<std::string> settings(const peers::Problem& p) {
    if (p.kind == peers::Kind::kDepth) return {"libccd signed", "libccd collide", "libccd signed 1e-12"};
    return {"libccd", "libccd 1e-12"};
  }

  FclPeer(const std::string& setting, const peers::Problem&) : collide_(setting.find("collide") != std::string::npos) {
    request_.enable_nearest_points = true;
    request_.enable_signed_distance = setting.find("signed") != std::string::npos;
    if (setting.find("1e-12") != std::string::npos) request_.distance_tolerance = 1e-12;
    contacts_.num_max_contacts = 1;
    contacts_.enable_contact = true;
  }

  static std::unique_ptr<Geometry> load(const peers::Shape& s) {
    auto g = std::make_unique<Geometry>();
    if (s.vertices.size() == 1) {
      g->shape = std::make_unique<fcl::Sphered>(s.radius);
      g->at.translation() = Vector3d(s.vertices[0][0], s.vertices[0][1], s.vertices[0][2]);
      g->sphere = true;
      return g;
    }
    // Vertices without faces would stop its hill climbing; flat hulls come without faces.
    std::vector<int> index(s.vertices.size(), s.triangles.empty() ? 0 : -1);
    for (const auto& t : s.triangles)
      for (const std::uint32_t v : t) index[v] = 0;
    auto vertices = std::make_shared<std::vector<Vector3d>>();
    for (std::size_t i = 0; i < index.size(); ++i)
      if (index[i] == 0) {
        index[i] = static_cast<int>(vertices->size());
        vertices->emplace_back(s.vertices[i][0], s.vertices[i][1], s.vertices[i][2]);
      }
    auto faces = std::make_shared<std::vector<int>>();
    for (const auto& t : s.triangles) faces->insert(faces->end(), {3, index[t[0]], index[t[1]], index[t[2]]});
    g->shape = std::make_unique<fcl::Convexd>(vertices, static_cast<int>(s.triangles.size()), faces);
    g->radius = s.radius;
    return g;
  }

  static Transform transform(const double R[9], const double t[3], const Geometry& g) {
    Transform X = Transform::Identity();
    X.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R);
    X.translation() = Eigen::Map<const Eigen::Vector3d>(t);
    return g.sphere ? X * g.at : X;
  }

  double distance(const Geometry& a, const Transform& at_a, const Geometry& b, const Transform& at_b, Cache&) {
    // For two spheres FCL has closed forms of distance and depth, but its signed distance iterates.
    const bool spheres = a.sphere && b.sphere;
    if (collide_ || spheres) {
      fcl::CollisionResultd result;
      fcl::collide(a.shape.get(), at_a, b.shape.get(), at_b, contacts_, result);
      if (result.isCollision()) return -result.getContact(0).penetration_depth - a.radius - b.radius;
      if (collide_) return 0;
    }
    fcl::DistanceResultd result;
    fcl::distance(a.shape.get(), at_a, b.shape.get(), at_b, spheres ? plain_ : request_, result);
    return result.min_distance - a.radius - b.radius;
  }

  class Tree {
   public:
    explicit Tree(const std::vector<peers::Box>& boxes) {
      for (const peers::Box& box : boxes) {
        const Eigen::Map<const Vector3d> low(box.low.data()), high(box.high.data());
        const auto shape = std::make_shared<fcl::Boxd>(Vector3d(high - low));
        fcl::Transform3d centre = fcl::Transform3d::Identity();
        centre.translation() = (low + high) / 2;
        objects_.push_back(std::make_unique<fcl::CollisionObjectd>(shape, centre));
        objects_.back()->setUserData(reinterpret_cast<void*>(objects_.size() - 1));
        manager_.registerObject(objects_.back().get());
      }
      manager_.setup();
    }
    template <class F>
    void each_pair(F f) {
      manager_.collide(&f, [](fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* to) {
        (*static_cast<F*>(to))(static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(a->getUserData())),
                               static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(b->getUserData())));
        return false;
      });
    }

   private:
    std::vector<std::unique_ptr<fcl::CollisionObjectd>> objects_;
    fcl::DynamicAABBTreeCollisionManagerd manager_;
  };

 private:
  bool collide_;
  fcl::DistanceRequestd request_, plain_{true};
  fcl::CollisionRequestd contacts_;
};

}  // namespace

int main(int argc, char** argv) {
  return peers::drive<FclPeer>(argc, argv);
}
