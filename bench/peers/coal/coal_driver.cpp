// Coal as a contender: one GJKSolver for all pairs of hulls, with the neighbours that it derives from their faces. One
// vertex is a sphere, two are a capsule.
#include <coal/broadphase/broadphase_callbacks.h>
#include <coal/broadphase/broadphase_dynamic_AABB_tree.h>
#include <coal/distance.h>
#include <coal/narrowphase/narrowphase.h>
#include <coal/shape/convex.h>
#include <coal/shape/geometric_shapes.h>

#include "bench/peers/driver.h"

namespace {

using coal::Transform3s;
using coal::Vec3s;

class CoalPeer {
 public:
  struct Geometry {
    std::unique_ptr<coal::ShapeBase> shape;
    const coal::ConvexBase* hull = nullptr;  // the same geometry if convex; its radius is Coal's swept sphere
    Transform3s at;                          // of a sphere or capsule in its body
  };
  using Transform = Transform3s;
  struct Cache {
    Vec3s guess{1, 0, 0};
    coal::support_func_guess_t support = coal::support_func_guess_t::Zero();
  };

  static std::vector<std::string> settings(const peers::Problem& p) {
    std::vector<std::string> s{"default", "bounding volume", "default 1e-12", "bounding volume 1e-12", "nesterov"};
    if (p.kind == peers::Kind::kMotion) s.insert(s.end(), {"cached", "cached 1e-12"});
    if (p.max_distance < peers::kBeyond) s.insert(s.end(), {"early stop", "early stop, bounding volume"});
    return s;
  }

  CoalPeer(const std::string& setting, const peers::Problem& p) : depth_(p.kind == peers::Kind::kDepth) {
    request_.enable_signed_distance = depth_;
    if (setting.find("1e-12") != std::string::npos) request_.gjk_tolerance = request_.epa_tolerance = 1e-12;
    if (setting.find("bounding") != std::string::npos)
      request_.gjk_initial_guess = coal::GJKInitialGuess::BoundingVolumeGuess;
    if (setting.find("cached") == 0) request_.gjk_initial_guess = coal::GJKInitialGuess::CachedGuess, cached_ = true;
    if (setting.find("nesterov") == 0) request_.gjk_variant = coal::GJKVariant::NesterovAcceleration;
    solver_.set(request_);
    if (setting.find("early") != std::string::npos) solver_.distance_upper_bound = p.max_distance;
  }

  static std::unique_ptr<Geometry> load(const peers::Shape& s) {
    auto g = std::make_unique<Geometry>();
    if (s.vertices.size() <= 2) {
      const auto point = [&](std::size_t i) { return Vec3s(s.vertices[i][0], s.vertices[i][1], s.vertices[i][2]); };
      const Vec3s p = point(0), q = point(s.vertices.size() - 1);
      if (p == q)
        g->shape = std::make_unique<coal::Sphere>(s.radius);
      else
        g->shape = std::make_unique<coal::Capsule>(s.radius, (q - p).norm());
      g->at.setTranslation((p + q) / 2);
      g->at.setRotation(
          Eigen::Quaterniond::FromTwoVectors(Vec3s::UnitZ(), p == q ? Vec3s::UnitZ() : Vec3s(q - p)).matrix());
      g->shape->computeLocalAABB();
      return g;
    }
    auto points = std::make_shared<std::vector<Vec3s>>();
    for (const peers::Point& v : s.vertices) points->push_back({v[0], v[1], v[2]});
    const auto count = static_cast<unsigned>(points->size());
    std::vector<int> valence(points->size());
    for (const auto& t : s.triangles)
      for (const std::uint32_t v : t) ++valence[v];
    const auto [least, most] = std::minmax_element(valence.begin(), valence.end());
    if (*most > 255) throw std::runtime_error("a vertex has more than 255 neighbours");  // they are counted in a byte
    if (*least > 0) {
      auto faces = std::make_shared<std::vector<coal::Triangle>>();
      for (const auto& t : s.triangles) faces->emplace_back(t[0], t[1], t[2]);
      g->shape =
          std::make_unique<coal::Convex<coal::Triangle>>(points, count, faces, static_cast<unsigned>(faces->size()));
    } else {  // some vertices are not on the hull, or it is flat: Coal computes the hull itself
      g->shape.reset(coal::ConvexBase::convexHull(points, count, true, nullptr));
    }
    g->shape->setSweptSphereRadius(s.radius);
    g->shape->computeLocalAABB();
    g->hull = static_cast<const coal::ConvexBase*>(g->shape.get());
    return g;
  }

  static Transform transform(const double R[9], const double t[3], const Geometry& g) {
    const Transform X{Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R), Eigen::Map<const Vec3s>(t)};
    return g.hull ? X : X * g.at;
  }

  double distance(const Geometry& a, const Transform& at_a, const Geometry& b, const Transform& at_b, Cache& cache) {
    if (!a.hull || !b.hull) {
      coal::DistanceResult result;
      return coal::distance(a.shape.get(), at_a, b.shape.get(), at_b, request_, result);
    }
    if (cached_) solver_.cached_guess = cache.guess, solver_.support_func_cached_guess = cache.support;
    Vec3s p, q, n;
    const double d = solver_.shapeDistance(*a.hull, at_a, *b.hull, at_b, depth_, p, q, n);
    if (cached_) cache.guess = solver_.cached_guess, cache.support = solver_.support_func_cached_guess;
    return d;
  }

  class Tree {
   public:
    explicit Tree(const std::vector<peers::Box>& boxes) {
      for (const peers::Box& box : boxes) {
        const Eigen::Map<const Vec3s> low(box.low.data()), high(box.high.data());
        const auto shape = std::make_shared<coal::Box>(Vec3s(high - low));
        const Transform3s centre(Vec3s((low + high) / 2));
        objects_.push_back(std::make_unique<coal::CollisionObject>(shape, centre));
        objects_.back()->setUserData(reinterpret_cast<void*>(objects_.size() - 1));
        manager_.registerObject(objects_.back().get());
      }
      manager_.setup();
    }
    template <class F>
    void each_pair(F f) {
      struct Each final : coal::CollisionCallBackBase {
        explicit Each(F& to) : call(to) {}
        bool collide(coal::CollisionObject* a, coal::CollisionObject* b) override {
          call(static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(a->getUserData())),
               static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(b->getUserData())));
          return false;
        }
        F& call;
      } each(f);
      manager_.collide(&each);
    }

   private:
    std::vector<std::unique_ptr<coal::CollisionObject>> objects_;
    coal::DynamicAABBTreeCollisionManager manager_;
  };

 private:
  bool depth_;
  coal::DistanceRequest request_;
  coal::GJKSolver solver_;
  bool cached_ = false;
};

}  // namespace

int main(int argc, char** argv) {
  return peers::drive<CoalPeer>(argc, argv);
}
