// Queries that no kernel answers: the CPU answers them, or they are rejected by name, before any work, if it may not. A
// fake device that holds the hulls of a real one leaves all its rows to the CPU, so no GPU is needed.
#include <functional>

#include "engine/device/hull_arrays.h"
#include "engine/device/query/device_plan.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/cuda/box_mesh.h"
#include "tests/engine/device/fake_device.h"

namespace clearance::test {
namespace {

class HullsDevice final : public IdleDevice {
 public:
  HullsDevice(Fault& fault, const engine::Scene& scene) : IdleDevice(fault), hulls_(scene, 96 * 1024) {}
  std::uint32_t hull_of(std::uint32_t body) const override { return hulls_.of_body[body]; }

 private:
  cuda::HullArrays hulls_;
};

engine::Scene mixed_scene() {
  engine::Scene scene;
  scene.add_robot("arm", at_home());
  const auto at = [](double x) { return engine::Scene::BodyOptions{.pose = Pose{{x, 3, 0}}}; };
  scene.add_box("box", {0.2, 0.2, 0.2}, at(0));
  scene.add_sphere("ball", 0.1, at(1));
  scene.add_cylinder("cylinder", 0.1, 0.3, at(2));
  scene.add_cone("cone", 0.1, 0.3, at(3));
  scene.add_ellipsoid("ellipsoid", {0.1, 0.2, 0.3}, at(4));
  scene.add_half_space("floor", {.is_static = true, .pose = Pose{{0, 0, -2}}});
  BoxMesh mesh;
  mesh.add_box({0, 0, 0}, {0.1, 0.1, 0.1}, 2, false);
  scene.add_mesh("mesh", mesh.vertices, mesh.triangles, MeshAs::kSolid, at(5));
  scene.add_points("cloud", std::vector<CloudPoint>{{0, 0, 0}, {0.1f, 0, 0}}, 0, at(6));
  return scene;
}

class UnsupportedQueries : public testing::Test {
 protected:
  static engine::Engine::Options options(bool fallback) {
    engine::Engine::Options o;
    o.backend = "cuda";
    o.threads = 1;
    o.device_fallback = fallback;
    o.covers = engine::Covers::kOff;
    return o;
  }
  std::uint32_t id(const char* name) const { return cpu_.scene().find_body(name); }

  /// Expects the rejection by the strict engine, and the CPU's answer of the other one.
  void expect_left_to_cpu(const QueryView& q, const std::string& reason) {
    SCOPED_TRACE(reason);
    const std::string text = rejection([&] { strict_.start(q, endless()); });
    EXPECT_NE(text.find(reason), std::string::npos) << text;
    expect_same(evaluate(device_, q), evaluate(cpu_, q), reason, true);
  }
  /// The same, and that the device of the strict engine was not used.
  void expect_rejected(const QueryView& q, const std::string& reason) {
    const int calls = strict_fault_.calls;
    expect_left_to_cpu(q, reason);
    EXPECT_EQ(strict_fault_.calls, calls) << "work was done";
  }
  static ReplyView endless() {
    ReplyView reply;
    reply.rows = ~std::uint64_t{0};
    return reply;
  }
  /// Likewise for a reason that needs no list of pairs: it comes with the preparation.
  void expect_rejected_early(const QueryView& q, const std::string& reason) {
    EXPECT_NE(rejection([&] { strict_.begin_preparing(q); }).find(reason), std::string::npos) << reason;
    expect_rejected(q, reason);
  }
  void expect_no_device_query(const QueryView& q, const std::string& reason) {
    const int calls = fault_.calls;
    const std::string text = rejection([&] { device_.plan_on_device(q); });
    EXPECT_NE(text.find(reason), std::string::npos) << text;
    EXPECT_EQ(fault_.calls, calls) << "work was done";
  }
  template <class Call>
  static std::string rejection(Call call) {
    try {
      call();
    } catch (const engine::QueryError& e) {
      EXPECT_EQ(e.code, QueryErrorCode::kNotSupported) << e.what();
      return e.what();
    }
    return "accepted";
  }

  Fault fault_, strict_fault_;
  bool is_strict_ = true;  // the engine that is made next
  cuda::FakeDevice fake_{{true, "a fake", ""}, [this](const engine::Scene& scene, int, std::uint64_t) {
                           return std::make_shared<HullsDevice>(
                               std::exchange(is_strict_, false) ? strict_fault_ : fault_, scene);
                         }};
  engine::Engine strict_{mixed_scene(), options(false)}, device_{mixed_scene(), options(true)};
  engine::Engine cpu_{mixed_scene(), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff}};
};

TEST_F(UnsupportedQueries, NameTheColumnOrOption) {
  const std::vector<std::uint32_t> joints{0, 1};
  const std::vector<double> positions{0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.4, 0.5}, weights{1, 1};
  const std::vector<BodyPair> pairs{{id("box"), id("arm/flange")}, {id("ball"), id("arm/flange")}};
  QueryView good;
  good.all_pairs = false;
  good.pairs = pairs;
  good.joints = joints;
  good.positions = positions;
  good.configuration_count = 4;
  good.fields = kFieldLower | kFieldUpper;
  EXPECT_EQ(rejection([&] { evaluate(strict_, good); }), "accepted");
  const auto with = [&](const std::function<void(QueryView&)>& change) {
    QueryView q = good;
    change(q);
    return q;
  };
  const QueryView scale =
      with([&](QueryView& q) { q.reduce = Reduce::kAny, q.fields = kFieldFreeScale, q.weights = weights; });
  expect_rejected_early(scale, "the column free_scale");
  expect_no_device_query(scale, "the column free_scale");
  for (const std::uint32_t column : {kFieldHessianJoints, kFieldRate, kFieldCurvature, kFieldSmoothRadius}) {
    const QueryView second = with([&](QueryView& q) { q.fields |= column; });
    expect_rejected_early(second, "a column of second order");
    expect_no_device_query(second, "hessian_joints, rate");
  }
  const QueryView k = with([](QueryView& q) { q.reduce = Reduce::kNearest, q.k = 1; });
  expect_rejected_early(k, "k of reduce nearest");
  expect_no_device_query(k, "reduce: expected none, min or any");

  const auto motions = [&](const std::function<void(QueryView&)>& change) {
    QueryView q = good;
    q.max_evaluations = 64;
    change(q);
    return q;
  };
  const QueryView any = motions([](QueryView& q) { q.reduce = Reduce::kAny; });
  expect_rejected(any, "motions of several devices");  // the fake one has no kernels for motions
  expect_no_device_query(any, "max_evaluations");
  expect_rejected_early(motions([](QueryView&) {}), "max_evaluations with reduce: none");
  expect_rejected_early(motions([](QueryView& q) { q.reduce = Reduce::kMin, q.max_distance = 1; }),
                        "a max_distance of motions");
  expect_rejected_early(motions([](QueryView& q) { q.reduce = Reduce::kMin, q.fields |= kFieldPairLower; }),
                        "the column pair_lower of motions");
  expect_rejected_early(motions([](QueryView& q) { q.reduce = Reduce::kAny, q.control_points = 4; }),
                        "more than two control_points");
}

TEST_F(UnsupportedQueries, NameMotionsByPosesAndGrowths) {
  const std::vector<std::uint32_t> bodies{id("box")};
  const std::vector<Pose> poses{Pose{{0, 1, 0}}, Pose{{0.5, 1, 0}}};
  const std::vector<double> growths{0, 0.01};
  const std::vector<BodyPair> pairs{{id("box"), id("ball")}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = 2;
  q.max_evaluations = 64;
  q.reduce = Reduce::kAny;
  q.fields = kFieldLower | kFieldUpper;
  expect_rejected_early(q, "motions of bodies by their poses");
  q.growths = growths;
  expect_rejected_early(q, "motions of bodies by their poses");
}

TEST_F(UnsupportedQueries, NameBodiesThatTheDeviceDoesNotHold) {
  const std::pair<const char*, const char*> kinds[] = {{"cylinder", "'cylinder' is a closed form (cylinder)"},
                                                       {"cone", "'cone' is a closed form (cone)"},
                                                       {"ellipsoid", "'ellipsoid' is a closed form (ellipsoid)"},
                                                       {"floor", "'floor' is a closed form (half_space)"},
                                                       {"mesh", "'mesh' is a mesh of triangles"},
                                                       {"cloud", "'cloud' is a cloud of points"}};
  for (const auto& [name, reason] : kinds) {
    const std::vector<BodyPair> pairs{{id("box"), id("ball")}, {id("box"), id(name)}};
    QueryView q;
    q.all_pairs = false;
    q.pairs = pairs;
    q.fields = kFieldLower | kFieldUpper | kFieldStatus;
    expect_rejected(q, reason);
    expect_no_device_query(q, reason);
    const bool has_kernel = id(name) == id("mesh") || id(name) == id("cloud");
    for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest, Reduce::kWithin, Reduce::kAny}) {
      q.reduce = reduce;
      q.max_distance = reduce == Reduce::kWithin ? 20 : std::numeric_limits<double>::infinity();
      if (has_kernel)
        expect_left_to_cpu(q, "clouds and meshes on several devices");  // the fake one cannot hold elements
      else
        expect_rejected(q, reason);
      if (reduce == Reduce::kMin || reduce == Reduce::kAny) expect_no_device_query(q, reason);
    }
  }
  // Two clouds or meshes that no kernel evaluates together.
  const std::vector<BodyPair> pairs{{id("mesh"), id("cloud")}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.reduce = Reduce::kMin;
  expect_rejected(q, "'mesh' is a mesh of triangles");
}

TEST_F(UnsupportedQueries, AreNotKeptOnACpuThatMayNotAnswer) {
  const std::vector<BodyPair> pairs{{id("box"), id("cylinder")}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  const std::string text = rejection([&] {
    PreparedQuery prepared = strict_.prepare(q);
    prepared.keep_on_cpu();
    strict_.start(std::move(prepared), endless());
  });
  EXPECT_NE(text.find("'cylinder' is a closed form (cylinder)"), std::string::npos) << text;
}

TEST_F(UnsupportedQueries, OfMotionsNameBodiesToo) {
  const std::vector<std::uint32_t> joints{0, 1};
  const std::vector<double> positions{0.1, 0.2, 0.2, 0.3};
  for (const char* name : {"cylinder", "mesh", "cloud"}) {
    const std::vector<BodyPair> pairs{{id("arm/flange"), id(name)}};
    QueryView q;
    q.all_pairs = false;
    q.pairs = pairs;
    q.joints = joints;
    q.positions = positions;
    q.configuration_count = 2;
    q.max_evaluations = 64;
    q.reduce = Reduce::kAny;
    q.fields = kFieldLower | kFieldUpper;
    expect_rejected(q, "'" + std::string(name) + "' is a ");
  }
}

}  // namespace
}  // namespace clearance::test
