#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "engine/engine.h"
#include "engine/hull/primitive.h"
#include "engine/scene/scene.h"
#include "tests/engine/engine_test_util.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using Options = engine::Scene::BodyOptions;

engine::Scene three_boxes() {
  engine::Scene scene;
  for (const char* name : {"a", "b", "c"}) scene.add_box(name, {1, 1, 1}, {});
  return scene;
}

TEST(Scene, BodiesHaveIdsInOrderOfArrival) {
  engine::Scene scene;
  EXPECT_EQ(scene.add_box("box", {1, 2, 3}, {}), 0u);
  EXPECT_EQ(scene.add_sphere("ball", 0.5, {}), 1u);
  EXPECT_EQ(scene.add_capsule("capsule", 0.5, 2, {}), 2u);
  EXPECT_EQ(scene.add_cylinder("cylinder", 0.5, 2, {}), 3u);
  EXPECT_EQ(scene.add_uv_sphere("uv", 2, 5, {}), 4u);
  const std::vector<Vec3d> points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {-0.0, 0, 0}};
  EXPECT_EQ(scene.add_hull("points", points, {}), 5u);
  EXPECT_EQ(scene.find_body("cylinder"), 3u);
  EXPECT_EQ(scene.find_body("none"), kNone);
  const auto& bodies = scene.bodies();
  EXPECT_EQ(bodies[0].parts[0]->vertices.size(), 8u);
  EXPECT_EQ(bodies[1].parts[0]->vertices.size(), 1u);
  EXPECT_EQ(bodies[1].parts[0]->radius, 0.5);
  EXPECT_EQ(bodies[2].parts[0]->vertices.size(), 2u);
  EXPECT_EQ(bodies[3].model_error, 0);
  EXPECT_TRUE(is_round(*bodies[3].parts[0]));
  EXPECT_EQ(bodies[4].parts[0]->vertices.size(), 42u);
  EXPECT_EQ(bodies[5].parts[0]->vertices.size(), 4u);  // exact duplicates merged, also -0
  EXPECT_EQ(bodies[5].parts[0]->loaded_vertices, 6u);
  EXPECT_FALSE(bodies[0].pose.has_value());
}

TEST(Scene, PrimitivesArePartsOfTheirOwn) {
  engine::Scene scene;
  scene.add_cone("cone", 0.5, 2, {});
  scene.add_ellipsoid("egg", {1, 2, 3}, {.radius = 0.25});
  scene.add_ellipsoid("same", {1, 2, 3}, {.radius = 0.25});
  scene.add_ellipsoid("other", {1, 2, 4}, {.radius = 0.25});
  scene.add_cone("padded", 0.5, 2, {.padding = 0.5});
  scene.add_cylinder("post", 0.5, 2, {.radius = 0.25});
  const auto& bodies = scene.bodies();
  EXPECT_EQ(bodies[1].parts[0], bodies[2].parts[0]);
  EXPECT_NE(bodies[1].parts[0], bodies[3].parts[0]);
  EXPECT_NE(bodies[1].parts[0]->digest, bodies[3].parts[0]->digest);
  EXPECT_NE(bodies[0].parts[0]->digest, bodies[4].parts[0]->digest);
  EXPECT_TRUE(same_primitive(*bodies[0].parts[0], *bodies[4].parts[0]));
  EXPECT_EQ(bodies[4].parts[0]->radius, 0.5);
  EXPECT_EQ(bodies[1].parts[0]->half.z, 3);
  EXPECT_EQ(bodies[5].parts[0]->radius, 0.25);
  EXPECT_FALSE(same_primitive(*bodies[0].parts[0], *bodies[5].parts[0])) << "of the same sizes";
  for (const Body& body : bodies) {
    EXPECT_EQ(body.model_error, 0);
    EXPECT_TRUE(body.display && !body.display->triangles.empty()) << body.name;
  }
  EXPECT_NE(
      error_text<engine::SceneError>([&] { scene.add_cone("flat", 1, 0, {}); }).find("cone length: expected a number"),
      std::string::npos);
  EXPECT_NE(
      error_text<engine::SceneError>([&] { scene.add_ellipsoid("flat", {1, 0, 1}, {}); }).find("half axis: expected"),
      std::string::npos);
}

TEST(Scene, HalfSpacesStandStill) {
  engine::Scene scene;
  scene.add_box("box", {1, 1, 1}, {.is_static = true});
  EXPECT_EQ(scene.add_half_space("floor", {}), 1u);
  EXPECT_TRUE(scene.bodies()[1].is_static);
  EXPECT_EQ(scene.bodies()[1].pose->qw, 1);
  const auto rejected = [&](const engine::Scene::BodyOptions& options, const char* why) {
    const std::string text = error_text<engine::SceneError>([&] { scene.add_half_space("other", options); });
    EXPECT_NE(text.find(why), std::string::npos) << text;
  };
  rejected({.parent = "box"}, "parent: a half_space cannot follow a body");
  rejected({.requires_pose = true}, "requires_pose: a static body");
  rejected({.uncertainty = {0, 0.1}}, "uncertainty.angle: expected 0");
  EXPECT_NE(error_text<engine::SceneError>([&] {
              scene.set_parent("floor", "box");
            }).find("a half_space cannot follow a body"),
            std::string::npos);
  Body both;
  both.name = "both";
  both.parts = {scene.bodies()[0].parts[0], scene.bodies()[1].parts[0]};
  EXPECT_NE(error_text<engine::SceneError>([&] { scene.add_body(both); }).find("the only part of its body"),
            std::string::npos);
}

TEST(Scene, RadiusGrowsTheParts) {
  engine::Scene scene;
  Options grown;
  grown.radius = 0.25;
  scene.add_sphere("ball", 0.5, grown);
  scene.add_box("box", {1, 1, 1}, grown);
  EXPECT_EQ(scene.bodies()[0].parts[0]->radius, 0.75);
  EXPECT_EQ(scene.bodies()[1].parts[0]->radius, 0.25);
}

TEST(Scene, ChildrenAndStaticBodiesStayAtTheIdentityWithoutAPose) {
  engine::Scene scene;
  Options fixed, child;
  fixed.is_static = true;
  child.parent = "table";
  scene.add_box("table", {1, 1, 1}, fixed);
  scene.add_box("cup", {0.1, 0.1, 0.1}, child);
  EXPECT_EQ(scene.bodies()[1].parent, 0u);
  ASSERT_TRUE(scene.bodies()[0].pose && scene.bodies()[1].pose);
  EXPECT_EQ(scene.bodies()[1].pose->qw, 1);
}

TEST(Scene, IgnoredPairsAreSortedAndDistinct) {
  engine::Scene scene = three_boxes();
  scene.add_group("ab", std::vector<std::string>{"b", "a", "b"});
  EXPECT_EQ(scene.groups()[0].bodies, (std::vector<std::uint32_t>{0, 1}));
  scene.ignore("c", "ab");
  scene.ignore("ab", "ab");
  scene.ignore("a", "c");
  using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;
  EXPECT_EQ(scene.ignored(), (Pairs{{0, 1}, {0, 2}, {1, 2}}));
  engine::Scene all = three_boxes();
  all.ignore("b", "*");
  EXPECT_EQ(all.ignored(), (Pairs{{0, 1}, {1, 2}}));
}

TEST(Scene, RevisionDistinguishesScenesAndIsRepeatable) {
  const std::uint64_t plain = three_boxes().revision();
  EXPECT_EQ(plain, three_boxes().revision());
  std::vector<std::uint64_t> seen = {plain, 0};
  const auto expect_new = [&](const char* what, const std::function<void(engine::Scene&)>& change) {
    engine::Scene scene = three_boxes();
    change(scene);
    EXPECT_EQ(std::count(seen.begin(), seen.end(), scene.revision()), 0) << what;
    seen.push_back(scene.revision());
  };
  expect_new("a body", [](engine::Scene& s) { s.add_box("d", {1, 1, 1}, {}); });
  expect_new("its name", [](engine::Scene& s) { s.add_box("e", {1, 1, 1}, {}); });
  expect_new("its size", [](engine::Scene& s) { s.add_box("d", {1, 1, 1.0000000000000002}, {}); });
  expect_new("its radius", [](engine::Scene& s) {
    s.add_box("d", {1, 1, 1}, {.radius = 1, .parent = "", .is_static = false, .pose = {}});
  });
  expect_new("its pose", [](engine::Scene& s) {
    s.add_box("d", {1, 1, 1}, {.radius = 0, .parent = "", .is_static = false, .pose = Pose{}});
  });
  expect_new("static", [](engine::Scene& s) {
    s.add_box("d", {1, 1, 1}, {.radius = 0, .parent = "", .is_static = true, .pose = Pose{}});
  });
  expect_new("parent", [](engine::Scene& s) {
    s.add_box("d", {1, 1, 1}, {.radius = 0, .parent = "a", .is_static = false, .pose = Pose{}});
  });
  expect_new("a group", [](engine::Scene& s) { s.add_group("g", std::vector<std::string>{"a"}); });
  expect_new("its members", [](engine::Scene& s) { s.add_group("g", std::vector<std::string>{"b"}); });
  expect_new("ignore", [](engine::Scene& s) { s.ignore("a", "b"); });
  expect_new("ignore another", [](engine::Scene& s) { s.ignore("a", "c"); });
}

TEST(Scene, BadInputIsRejectedWithTheReason) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto text = [](const std::function<void(engine::Scene&)>& f) {
    engine::Scene scene = three_boxes();
    scene.add_group("g", std::vector<std::string>{"a", "b"});
    return error_text<engine::SceneError>([&] { f(scene); });
  };
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("a", {1, 1, 1}, {}); }), "body name \"a\" is already that of a body");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("g", {1, 1, 1}, {}); }),
            "body name \"g\" is already that of a group");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("", {1, 1, 1}, {}); }), "body name is empty");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("*", {1, 1, 1}, {}); }),
            "body name \"*\" is reserved: it selects every body");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("x\ny", {1, 1, 1}, {}); }),
            "body name holds an unprintable character or bad UTF-8 at byte 1");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("x\xff", {1, 1, 1}, {}); }),
            "body name holds an unprintable character or bad UTF-8 at byte 1");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box(std::string(64, 'n'), {1, 1, 1}, {}); }),
            "body name has 64 bytes, expected at most 63: \"" + std::string(40, 'n') + "\"...");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box(std::string(63, 'n'), {1, 1, 1}, {}); }), "");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("Gl\xc3\xa4ser", {1, 1, 1}, {}); }), "");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_box("d", {1, 0, 1}, {}); }),
            "body \"d\": box edge: expected a number of metres > 0, got 0");
  EXPECT_EQ(text([&](engine::Scene& s) { s.add_sphere("d", nan, {}); }),
            "body \"d\": sphere radius: expected a number of metres > 0, got nan");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_capsule("d", 1, -1, {}); }),
            "body \"d\": capsule length: expected a number of metres >= 0, got -1");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_uv_sphere("d", 1, 1, {}); }),
            "body \"d\": uv_sphere resolution: expected an integer from 2 to 2000, got 1");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_hull("d", {}, {}); }), "body \"d\": a part needs at least one vertex");
  EXPECT_EQ(text([&](engine::Scene& s) { s.add_hull("d", std::vector<Vec3d>{{0, 0, 0}, {0, nan, 0}}, {}); }),
            "body \"d\": vertex 1 has the coordinate nan; expected a finite number up to 1e60 m");
  EXPECT_EQ(text([](engine::Scene& s) {
              s.add_box("d", {1, 1, 1}, {.radius = -1, .parent = "", .is_static = false, .pose = {}});
            }),
            "body \"d\": radius: expected a number of metres >= 0, got -1");
  EXPECT_EQ(text([](engine::Scene& s) {
              s.add_box("d", {1, 1, 1}, {.radius = 0, .parent = "z", .is_static = false, .pose = {}});
            }),
            "body \"d\": parent: there is no body \"z\"");
  EXPECT_EQ(text([](engine::Scene& s) {
              Pose bad;
              bad.qw = 0;
              s.add_box("d", {1, 1, 1}, {.radius = 0, .parent = "", .is_static = false, .pose = bad});
            }),
            "body \"d\": pose: expected finite numbers and a quaternion of norm 1e-6 to 1e6");
  EXPECT_EQ(text([](engine::Scene& s) {
              s.add_box("d", {1, 1, 1}, {.radius = 0, .parent = "a", .is_static = true, .pose = {}});
            }),
            "body \"d\": a static body cannot follow the movable body \"a\"");
  EXPECT_EQ(text([](engine::Scene& s) {
              s.set_parent("b", "a");
              s.set_parent("c", "b");
              s.set_parent("a", "c");
            }),
            "body \"a\": parent: \"c\" follows \"a\" itself");
  EXPECT_EQ(text([](engine::Scene& s) { s.set_parent("a", "a"); }), "body \"a\": parent: \"a\" follows \"a\" itself");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_group("h", std::vector<std::string>{"z"}); }),
            "group \"h\": there is no body \"z\"");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_group("a", std::vector<std::string>{"b"}); }),
            "group name \"a\" is already that of a body");
  EXPECT_EQ(text([](engine::Scene& s) { s.ignore("a", "z"); }), "there is no body or group \"z\"");
  EXPECT_EQ(text([](engine::Scene& s) { s.ignore("a", "a"); }),
            "ignore: \"a\" with itself: a body has no pair with itself");
  EXPECT_EQ(text([](engine::Scene& s) { s.add_body({}); }), "body name is empty");
  EXPECT_EQ(text([](engine::Scene& s) {
              Body body;
              body.name = "d";
              s.add_body(body);
            }),
            "body \"d\": expected at least one piece");
}

// Coordinates of a map, where float32 has steps of half a metre.
TEST(Scene, MeshesKeepTheirDistanceAtMapCoordinates) {
  const TemporaryFolder folder;
  const auto box_at = [](double x) {
    const Shape box = make_box({1, 1, 1});
    mesh_files::Source mesh{box.vertices, box.triangles};
    for (Vec3d& v : mesh.vertices) v = v + Vec3d{x, 5.7e6, 0};
    return mesh;
  };
  using Write = std::function<std::string(const mesh_files::Source&)>;
  const std::pair<const char*, Write> formats[] = {
      {".obj", mesh_files::obj},
      {".off", mesh_files::off},
      {".stl", mesh_files::stl_text},
      {".ply", [](const auto& m) { return mesh_files::ply(m, mesh_files::Ply::kText); }}};
  for (const auto& [extension, write] : formats)
    for (const double scale : {1.0, 1e-3}) {
      engine::Scene scene;
      Options options;
      options.pose = Pose{};
      for (const double x : {4.3e6, 4300001.1})
        scene.add_mesh("at " + std::to_string(x), folder.write(std::to_string(x) + extension, write(box_at(x))),
                       {scale, scale, scale}, MeshAs::kHull, options);
      const engine::Engine engine(scene);
      const test::Answer answer = test::evaluate(engine, {});
      ASSERT_EQ(answer.info.rows, 1u);
      const double lower = answer.view.lower[0], upper = answer.view.upper[0];
      const std::uint8_t status = answer.view.status[0];
      EXPECT_EQ(static_cast<Status>(status), Status::kOk) << extension;
      const double error = scene.bodies()[0].model_error + scene.bodies()[1].model_error;
      EXPECT_EQ(error > 0, scale != 1) << extension << " " << error;
      const double wanted = scale * ((4300001.1 - 0.5) - (4.3e6 + 0.5));  // as in the files
      EXPECT_LE(lower - error, wanted) << extension;
      EXPECT_GE(upper + error, wanted) << extension;
      EXPECT_LE(upper - lower + error, 2e-6 * scale) << extension;
    }
}

}  // namespace
}  // namespace clearance
