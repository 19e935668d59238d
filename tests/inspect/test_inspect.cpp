// Reports on the models of bodies, and on bodies and pairs that could be left out.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/bvh/surface.h"
#include "engine/engine.h"
#include "engine/hull/shapes.h"
#include "inspect/inspect.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/source_file.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

engine::Scene load(const std::string& name) {
  return engine::Scene::load(source_file("scenes/" + name + "/scene.yaml"));
}

const BodyReport& of(const engine::Scene& scene, const SceneReport& report, const std::string& body) {
  return report.bodies.at(scene.find_body(body));
}

std::vector<Finding> findings(const SceneReport& report, Finding::Kind kind) {
  std::vector<Finding> some;
  std::copy_if(report.findings.begin(), report.findings.end(), std::back_inserter(some),
               [&](const Finding& f) { return f.kind == kind; });
  return some;
}

std::uint64_t enabled_pairs(const engine::Scene& scene) {
  for (const auto& [name, value] : engine::Engine(scene).stats())
    if (name == "engine.pairs") return value;
  return 0;
}

TEST(Inspect, NineteenBodiesOfEveryForm) {
  const engine::Scene scene = load("nineteen");
  const SceneReport report = inspect(scene, {});
  ASSERT_EQ(report.bodies.size(), 19u);
  EXPECT_EQ(report.pairs, 171u);
  EXPECT_EQ(of(scene, report, "ball").form, "sphere");
  EXPECT_EQ(of(scene, report, "ball").vertices, 1u);
  EXPECT_EQ(of(scene, report, "pill").form, "capsule");
  EXPECT_EQ(of(scene, report, "crate").form, "box");
  EXPECT_EQ(of(scene, report, "brick").form, "rounded box");
  EXPECT_EQ(of(scene, report, "brick").radius, 0.04);
  EXPECT_EQ(of(scene, report, "egg").form, "hull");
  EXPECT_EQ(of(scene, report, "chair").form, "mixed");
  EXPECT_EQ(of(scene, report, "mug").parts, 18u);
  EXPECT_EQ(of(scene, report, "can").form, "cylinder");
  EXPECT_EQ(of(scene, report, "can").model_error, 0);
  EXPECT_EQ(of(scene, report, "egg").model_error, 0);
  // A text STL repeats each corner: 552 faces; many of its distinct vertices are inside the hull.
  const BodyReport& gear = of(scene, report, "gear");
  EXPECT_EQ(gear.loaded, 3 * gear.faces);
  EXPECT_GT(gear.inside.value(), 0u);
  EXPECT_LT(gear.inside.value() + gear.vertices, gear.loaded);
  double sum = 0;
  std::uint64_t bytes = 0;
  for (const BodyReport& body : report.bodies) {
    EXPECT_EQ(body.partners, 18u);
    EXPECT_GE(body.bytes, 48 * body.vertices);
    EXPECT_GT(body.extent, 0);
    ASSERT_TRUE(body.ns_per_pair);
    EXPECT_GT(*body.ns_per_pair, 0);
    sum += *body.ns_per_pair * 18;
    bytes += body.bytes;
  }
  EXPECT_EQ(report.bytes, bytes);  // nothing is shared
  EXPECT_NEAR(report.ns_all_pairs.value(), sum / 2, 1e-9 * sum);
}

TEST(Inspect, FramesOfARobotAreInNoPair) {
  engine::Scene scene;
  scene.add_box("table", {1, 1, 0.1}, {.is_static = true});
  scene.add_robot("arm", {.urdf = source_file("tests/engine/robot/arm.urdf"), .home = {{{"joint4", -1.5}}}});
  const SceneReport report = inspect(scene, {.measure = false});
  std::vector<std::uint64_t> partners(scene.bodies().size(), 0);
  for (const BodyPair pair : engine::Engine(scene).pairs({})) ++partners[pair.a], ++partners[pair.b];
  for (std::uint32_t b = 0; b < partners.size(); ++b) EXPECT_EQ(report.bodies[b].partners, partners[b]) << b;
  EXPECT_EQ(report.bodies[scene.find_body("arm")].form, "frame");
  EXPECT_EQ(report.bodies[scene.find_body("arm/palm")].form, "sphere");
}

TEST(Inspect, PartnersAreThoseOfThePairTable) {
  for (const char* name : {"nineteen", "cell", "extremes"}) {
    const engine::Scene scene = load(name);
    const SceneReport report = inspect(scene, {false, 0.01});
    EXPECT_EQ(report.pairs, enabled_pairs(scene)) << name;
    for (const BodyReport& body : report.bodies) EXPECT_FALSE(body.ns_per_pair);
    EXPECT_FALSE(report.ns_all_pairs);
  }
  const engine::Scene cell = load("cell");
  const SceneReport report = inspect(cell, {false, 0.01});
  EXPECT_EQ(of(cell, report, "wrist_2").ignored, 3u);
  EXPECT_EQ(of(cell, report, "floor").ignored, 13u);  // the other three static bodies, and ten that rest on it
  EXPECT_EQ(of(cell, report, "floor").partners, 8u);  // the arm without its static base
  EXPECT_TRUE(findings(report, Finding::Kind::kUnused).empty());
}

TEST(Inspect, ExtremesHaveFormsAndOneBallThatCouldBeASphere) {
  const engine::Scene scene = load("extremes");
  const SceneReport report = inspect(scene, {false, 0.01});
  EXPECT_EQ(of(scene, report, "point").form, "point");
  EXPECT_EQ(of(scene, report, "grown_point").form, "sphere");
  EXPECT_EQ(of(scene, report, "parallel").form, "segment");
  EXPECT_EQ(of(scene, report, "needle").form, "box");
  EXPECT_EQ(of(scene, report, "repeated").loaded, 10u);
  EXPECT_EQ(of(scene, report, "repeated").vertices, 4u);
  const auto spheres = findings(report, Finding::Kind::kSphere);
  ASSERT_EQ(spheres.size(), 1u);
  EXPECT_EQ(spheres[0].body, scene.find_body("huge_ball"));
}

TEST(Inspect, ASceneWhereThingsCanBeLeftOut) {
  const TemporaryFolder folder;
  const mesh_files::Source ball = mesh_files::ball();
  // Two boxes as two objects of one file, the small one inside.
  std::string obj;
  int first = 1;
  for (const double edge : {1.0, 0.4}) {
    const Shape box = make_box({edge, edge, edge});
    obj += "o box" + std::to_string(first) + "\n";
    for (const Vec3d& v : box.vertices)
      obj += "v " + std::to_string(v.x) + " " + std::to_string(v.y) + " " + std::to_string(v.z) + "\n";
    for (const Triangle& t : box.triangles) {
      obj += "f";
      for (const std::uint32_t i : t) obj += " " + std::to_string(first + static_cast<int>(i));
      obj += "\n";
    }
    first += 8;
  }
  folder.write("lump.obj", obj);
  const engine::Scene scene = engine::Scene::load(folder.write("scene.yaml", R"(
bodies:
  - {name: shelf, box: [1, 0.3, 0.02], static: true}
  - {name: shelf_again, box: [1, 0.3, 0.02], static: true}
  - {name: shelf_elsewhere, box: [1, 0.3, 0.02], static: true, pose: [0, 0, 1, 1, 0, 0, 0]}
  - {name: carrier, box: 0.1, pose: [3, 0, 0, 1, 0, 0, 0]}
  - {name: globe, uv_sphere: {radius: 0.5, resolution: 40}, pose: [5, 0, 0, 1, 0, 0, 0]}
  - {name: globe_2, uv_sphere: {radius: 0.5, resolution: 40}, pose: [7, 0, 0, 1, 0, 0, 0]}
  - {name: coarse, uv_sphere: {radius: 0.5, resolution: 4}, pose: [9, 0, 0, 1, 0, 0, 0]}
  - {name: lump, mesh: lump.obj, mesh_as: parts, pose: [11, 0, 0, 1, 0, 0, 0]}
ignore: [[carrier, "*"]]
)"));
  const SceneReport report = inspect(scene, {false, 0.01});
  EXPECT_EQ(report.findings.size(), 4u);

  const auto duplicates = findings(report, Finding::Kind::kDuplicate);
  ASSERT_EQ(duplicates.size(), 1u);
  EXPECT_EQ(duplicates[0].body, scene.find_body("shelf_again"));
  EXPECT_EQ(duplicates[0].other, scene.find_body("shelf"));

  const auto unused = findings(report, Finding::Kind::kUnused);
  ASSERT_EQ(unused.size(), 1u);
  EXPECT_EQ(unused[0].body, scene.find_body("carrier"));
  EXPECT_EQ(of(scene, report, "carrier").partners, 0u);

  const auto inner = findings(report, Finding::Kind::kInnerPart);
  ASSERT_EQ(inner.size(), 1u);
  EXPECT_EQ(inner[0].body, scene.find_body("lump"));
  EXPECT_EQ(inner[0].text.substr(0, 30), "piece 1 lies inside piece 0: i");

  const auto spheres = findings(report, Finding::Kind::kSphere);
  ASSERT_EQ(spheres.size(), 1u);
  EXPECT_EQ(spheres[0].body, scene.find_body("globe"));
  EXPECT_NE(spheres[0].text.find("1 more"), std::string::npos) << spheres[0].text;
  // The mesh's faces are at most this far inside the sphere: never more than reported.
  const Shape globe = make_uv_sphere(0.5, 40);
  double least = 1;
  for (const Triangle& t : globe.triangles) {
    const Vec3d &a = globe.vertices[t[0]], &b = globe.vertices[t[1]], &c = globe.vertices[t[2]];
    const Vec3d n = cross(b - a, c - a);
    least = std::min(least, dot(n, a) / norm(n));
  }
  EXPECT_GE(*spheres[0].error, 0.5 - least - 1e-15);
  EXPECT_LE(*spheres[0].error, 0.5 - least + 0.1 * 0.01 * 0.5);

  // Nothing of that kind at a smaller tolerance.
  EXPECT_TRUE(findings(inspect(scene, {false, 1e-4}), Finding::Kind::kSphere).empty());
}

TEST(Inspect, BevelledBoxesAreBoxesToTheirBevel) {
  std::mt19937 bits(3);
  std::normal_distribution<double> normal;
  for (const double radius : {0.0, 0.01}) {
    // Every corner cut off by 1 mm along each edge, rotated and moved within its own frame.
    const Vec3d half{0.3, 0.2, 0.1};
    const double cut = 1e-3;
    const Pose X{{0.5, -0.2, 0.1}, normal(bits), normal(bits), normal(bits), normal(bits)};
    const Mat3d R = rotation_of(X);
    std::vector<Vec3d> points;
    for (int i = 0; i < 8; ++i)
      for (int k = 0; k < 3; ++k) {
        Vec3d p{i & 1 ? half.x : -half.x, i & 2 ? half.y : -half.y, i & 4 ? half.z : -half.z};
        p[k] += p[k] > 0 ? -cut : cut;
        points.push_back(R * p + X.translation);
      }
    engine::Scene scene;
    engine::Scene::BodyOptions options;
    options.radius = radius;
    scene.add_hull("bevelled", points, options);
    const SceneReport report = inspect(scene, {false, 0.01});
    const auto boxes = findings(report, Finding::Kind::kBox);
    ASSERT_EQ(boxes.size(), 1u) << "radius " << radius;
    EXPECT_NEAR(*boxes[0].error, cut / std::sqrt(3), 0.1 * 0.01 * 0.4);
    EXPECT_GE(*boxes[0].error, cut / std::sqrt(3) * (1 - 1e-9));
    EXPECT_EQ(boxes[0].text.substr(0, 30), "a box of 0.2 x 0.4 x 0.6 m at ") << boxes[0].text;
    EXPECT_EQ(boxes[0].text.find("with the radius") != std::string::npos, radius > 0);
    EXPECT_TRUE(findings(inspect(scene, {false, 1e-3}), Finding::Kind::kBox).empty());
  }
}

TEST(Inspect, VerticesThatLieInTheSurfaceAreCounted) {
  std::mt19937 bits(7);
  std::uniform_real_distribution<double> uniform;
  const Mat3d R = rotation_of({{0, 0, 0}, 0.3, 0.5, -0.2, 0.7});
  std::vector<Vec3d> corners{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}}, points;
  for (Vec3d& c : corners) {
    c = R * c;
    points.push_back(c);
  }
  for (int i = 0; i < 200; ++i) {  // on a face, apart from rounding
    double s = uniform(bits), t = uniform(bits);
    if (s + t > 1) {
      s = 1 - s;
      t = 1 - t;
    }
    points.push_back(corners[0] * (1 - s - t) + corners[1] * s + corners[2] * t);
  }
  engine::Scene scene;
  scene.add_hull("rounded_face", points, {});
  const SceneReport report = inspect(scene, {false, 0.01});
  ASSERT_GT(report.bodies[0].vertices, 20u) << "rounding put no point outside: the test misses its case";
  const auto flat = findings(report, Finding::Kind::kFlatVertices);
  ASSERT_EQ(flat.size(), 1u);
  EXPECT_EQ(flat[0].text.substr(0, flat[0].text.find(" lie")),
            std::to_string(report.bodies[0].vertices - 4) + " of its " + std::to_string(report.bodies[0].vertices) +
                " vertices");
}

TEST(Inspect, GeometryHeldTwiceIsNamedAndCounted) {
  engine::Scene scene;
  const Shape ball = make_uv_sphere(0.5, 12);
  engine::Scene::BodyOptions here, there;
  here.pose = Pose{};
  there.pose = Pose{{2, 0, 0}};
  scene.add_hull("one", ball.vertices, here);
  Body second = scene.bodies()[0];
  second.name = "two";
  second.pose = there.pose;
  second.parts = {std::make_shared<const ConvexPart>(*second.parts[0])};
  scene.add_body(second);
  Body third = scene.bodies()[0];
  third.name = "three";
  third.pose = Pose{{4, 0, 0}};
  scene.add_body(third);
  const SceneReport report = inspect(scene, {false, 1e-6});
  const auto unshared = findings(report, Finding::Kind::kUnshared);
  ASSERT_EQ(unshared.size(), 1u);
  EXPECT_EQ(unshared[0].body, 1u);
  EXPECT_EQ(report.bodies[0].sharing, 2u);
  EXPECT_EQ(report.bodies[1].sharing, 1u);
  EXPECT_EQ(report.bytes, report.bodies[0].bytes + report.bodies[1].bytes);
  EXPECT_TRUE(findings(report, Finding::Kind::kDuplicate).empty());
}

TEST(Inspect, BodiesWithoutAPoseAreNotTimed) {
  engine::Scene scene;
  for (const char* name : {"a", "b"}) scene.add_sphere(name, 1, {});
  const SceneReport report = inspect(scene, {});
  EXPECT_FALSE(report.bodies[0].ns_per_pair);
  EXPECT_FALSE(report.ns_all_pairs);
  EXPECT_TRUE(findings(report, Finding::Kind::kDuplicate).empty()) << "nobody knows yet where they will be";
}

TEST(Inspect, ASolidIsItsTrianglesAndNoSphereOrBox) {
  const Shape globe = make_uv_sphere(0.5, 40);
  engine::Scene scene;
  for (const MeshAs how : {MeshAs::kHull, MeshAs::kSolid, MeshAs::kSurface})
    scene.add_mesh(std::string(word_of(how)), globe.vertices, globe.triangles, how, {.radius = 0});
  scene.add_mesh("again", globe.vertices, globe.triangles, MeshAs::kSolid, {.radius = 0});
  const SceneReport report = inspect(scene, {false, 0.01});
  const auto spheres = findings(report, Finding::Kind::kSphere);
  ASSERT_EQ(spheres.size(), 1u) << "what looks at vertices alone would name it for all of them";
  EXPECT_EQ(spheres[0].body, 0u);
  EXPECT_TRUE(findings(report, Finding::Kind::kUnshared).empty());
  const BodyReport &hull = report.bodies[0], &solid = report.bodies[1], &surface = report.bodies[2];
  EXPECT_EQ(hull.form, "hull");
  EXPECT_EQ(solid.form, "solid");
  EXPECT_EQ(surface.form, "surface");
  EXPECT_EQ(hull.triangles, 0u);
  EXPECT_EQ(solid.triangles, globe.triangles.size());
  EXPECT_GT(solid.bytes, hull.bytes / 2 + surface_of(scene.bodies()[1])->resident_bytes()) << "its tree counts";
  EXPECT_EQ(solid.sharing, 2u);
}

// Two separate tetrahedra, as one mesh.
TEST(Inspect, SaysWhatAMeshCouldBeAndWhatThatCosts) {
  const std::vector<Vec3d> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                                   {5, 0, 0}, {6, 0, 0}, {5, 1, 0}, {5, 0, 1}};
  const std::vector<Triangle> faces{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2},
                                    {4, 6, 5}, {4, 5, 7}, {5, 6, 7}, {4, 7, 6}};
  const std::span<const Triangle> open = std::span(faces).first(7), one = std::span(faces).first(4);
  engine::Scene scene;
  scene.add_mesh("closed", corners, faces, MeshAs::kAuto, {.pose = Pose{{0, 0, 0}}});
  scene.add_mesh("open", corners, open, MeshAs::kAuto, {.radius = 0.25, .pose = Pose{{0, 0, 9}}});
  scene.add_mesh("convex", std::span(corners).first(4), one, MeshAs::kAuto, {.pose = Pose{{0, 9, 0}}});
  scene.add_box("box", {1, 1, 1}, {.pose = Pose{{3, 0.5, 0.5}}});
  scene.add_mesh("apart", corners, faces, MeshAs::kSurface, {.radius = 0.5});  // without a pose
  const SceneReport report = inspect(scene, {});
  ASSERT_EQ(report.choices.size(), 8u);
  const auto is = [&](std::size_t i, std::uint32_t body, MeshAs what, bool now, bool is_timed) {
    const Choice& c = report.choices[i];
    EXPECT_EQ(c.body, body) << i;
    EXPECT_EQ(c.what, what) << i;
    EXPECT_EQ(c.is_now, now) << i;
    EXPECT_EQ(c.ns_per_pair.has_value(), is_timed) << i;
    EXPECT_EQ(c.triangles, c.what == MeshAs::kHull ? 0u : body == 1 ? 7u : 8u) << i;
    EXPECT_EQ(c.hull_excess > 1, c.what == MeshAs::kHull) << i << ' ' << c.hull_excess;
  };
  is(0, 0, MeshAs::kHull, false, true);
  is(1, 0, MeshAs::kSurface, false, true);
  is(2, 0, MeshAs::kSolid, true, true);
  is(3, 1, MeshAs::kHull, true, true);
  is(4, 1, MeshAs::kSurface, false, true);
  is(5, 4, MeshAs::kHull, false, false);
  is(6, 4, MeshAs::kSurface, true, false);
  is(7, 4, MeshAs::kSolid, false, false);
  EXPECT_GT(report.choices[2].bytes, report.choices[0].bytes);
  for (const Choice& c : inspect(scene, {.measure = false}).choices) EXPECT_FALSE(c.ns_per_pair);

  ASSERT_EQ(report.models.size(), 1u);
  const GroupModel& model = report.models[0];
  EXPECT_EQ(model.group, "movable bodies");
  EXPECT_EQ(model.bodies, 5u);
  EXPECT_EQ(model.concave, 3u);
  EXPECT_EQ(model.elements, 8u + 7u + 8u);
  EXPECT_EQ(model.hull_excess, report.choices[0].hull_excess);
  EXPECT_GT(model.cost_ratio.value(), 0);
  const std::vector<MeshModel> better{{0, MeshAs::kSolid}, {1, MeshAs::kSurface}, {4, MeshAs::kSolid}};
  EXPECT_EQ(model.true_meshes, better);
  const SceneReport coarse = inspect(scene, {.measure = false, .margin = model.hull_excess});
  EXPECT_TRUE(coarse.models[0].true_meshes.empty());
  EXPECT_FALSE(coarse.models[0].cost_ratio);
}

TEST(Inspect, ModelsAreThoseOfRobotsCloudsAndTheOtherBodies) {
  engine::Scene scene;
  scene.add_robot("arm", {.urdf = source_file("tests/engine/robot/arm.urdf")});
  scene.add_box("table", {1, 1, 0.1}, {.is_static = true});
  scene.add_points("dots", std::vector<CloudPoint>{{0, 0, 5}, {1, 0, 5}}, 0, {.is_static = true});
  const std::vector<GroupModel> models = inspect(scene, {.measure = false}).models;
  ASSERT_EQ(models.size(), 3u);
  EXPECT_EQ(models[0].group, "arm");
  EXPECT_EQ(models[1].group, "static bodies");
  EXPECT_EQ(models[2].group, "clouds");
  EXPECT_EQ(models[2].elements, 2u);
}

}  // namespace
}  // namespace clearance
