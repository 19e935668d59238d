// Bullet as a contender: btGjkPairDetector with its EPA for depths. (btGjkEpaSolver2::Distance is wrong on ordinary
// pairs.)
#include <BulletCollision/BroadphaseCollision/btDbvt.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkEpaPenetrationDepthSolver.h>
#include <BulletCollision/NarrowPhaseCollision/btGjkPairDetector.h>
#include <BulletCollision/NarrowPhaseCollision/btPointCollector.h>
#include <BulletCollision/NarrowPhaseCollision/btVoronoiSimplexSolver.h>

#include "bench/peers/driver.h"

namespace {

btVector3 vector(const double* v) {
  return {static_cast<btScalar>(v[0]), static_cast<btScalar>(v[1]), static_cast<btScalar>(v[2])};
}

class BulletPeer {
 public:
  using Geometry = btConvexHullShape;  // its margin is the radius
  using Transform = btTransform;
  struct Cache {
    btVector3 axis{0, 1, 0};
  };

  static std::vector<std::string> settings(const peers::Problem& p) {
    if (p.kind == peers::Kind::kMotion) return {"gjk", "gjk cached"};
    return {p.kind == peers::Kind::kDepth ? "gjk epa" : "gjk"};
  }

  BulletPeer(const std::string& setting, const peers::Problem&)
      : cached_(setting.find("cached") != std::string::npos), depth_(setting.find("epa") != std::string::npos) {}

  static std::unique_ptr<Geometry> load(const peers::Shape& s) {
    auto hull = std::make_unique<btConvexHullShape>();
    for (const peers::Point& v : s.vertices) hull->addPoint(vector(v.data()), false);
    hull->recalcLocalAabb();
    hull->setMargin(static_cast<btScalar>(s.radius));
    return hull;
  }

  static Transform transform(const double R[9], const double t[3], const Geometry&) {
    const btVector3 x = vector(R), y = vector(R + 3), z = vector(R + 6);
    return btTransform(btMatrix3x3(x.x(), x.y(), x.z(), y.x(), y.y(), y.z(), z.x(), z.y(), z.z()), vector(t));
  }

  double distance(const Geometry& a, const Transform& at_a, const Geometry& b, const Transform& at_b, Cache& cache) {
    btGjkPairDetector detector(&a, &b, &simplex_, depth_ ? &epa_ : nullptr);
    if (cached_) detector.setCachedSeparatingAxis(cache.axis);
    btGjkPairDetector::ClosestPointInput input;
    input.m_transformA = at_a;
    input.m_transformB = at_b;
    input.m_maximumDistanceSquared = BT_LARGE_FLOAT;
    btPointCollector result;
    detector.getClosestPoints(input, result, nullptr);
    if (cached_) cache.axis = detector.getCachedSeparatingAxis();
    return result.m_hasResult ? static_cast<double>(result.m_distance) : 0;  // without EPA it does not report overlaps
  }

  class Tree {
   public:
    explicit Tree(const std::vector<peers::Box>& boxes) {
      for (std::size_t i = 0; i < boxes.size(); ++i)
        tree_.insert(btDbvtVolume::FromMM(vector(boxes[i].low.data()), vector(boxes[i].high.data())),
                     reinterpret_cast<void*>(i));
      tree_.optimizeTopDown();
    }
    template <class F>
    void each_pair(F f) {
      struct Each final : btDbvt::ICollide {
        explicit Each(F& to) : call(to) {}
        void Process(const btDbvtNode* a, const btDbvtNode* b) override {
          call(static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(a->data)),
               static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(b->data)));
        }
        F& call;
      } each(f);
      tree_.collideTTpersistentStack(tree_.m_root, tree_.m_root, each);
    }

   private:
    btDbvt tree_;
  };

 private:
  bool cached_, depth_;
  btVoronoiSimplexSolver simplex_;
  btGjkEpaPenetrationDepthSolver epa_;
};

}  // namespace

int main(int argc, char** argv) {
  return peers::drive<BulletPeer>(argc, argv);
}
