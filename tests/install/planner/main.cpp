// planner SCENE MESH: checks the use of the installed engine. Exit code 0 if all is correct.
#include <clearance/eigen.h>
#include <clearance/engine.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

using namespace clearance;

static void check(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::exit(1);
}

int main(int, char** argv) {
  // Two unit boxes, 1 m between their faces, the second rotated by 45 degrees about z.
  Scene scene;
  scene.add_box("a", {1, 1, 1}, {.is_static = true, .X_parent_body = Pose7{0, 0, 0, 1, 0, 0, 0}});
  scene.add_box("b", {1, 1, 1});
  Engine engine(std::move(scene));
  Eigen::Isometry3d X_wb = Eigen::Isometry3d::Identity();
  X_wb.translation() = Eigen::Vector3d(1.5 + std::sqrt(0.5), 0, 0);
  X_wb.linear() = Eigen::AngleAxisd(std::acos(-1) / 4, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  engine.set_poses({{"b", eigen::pose(X_wb)}});
  const Result answer = engine.distances({.fields = kDefaultFields | kFieldPoints});
  check(answer.rows() == 1 && answer.status()[0] == Status::kOk, "one pair, apart");
  check(answer.lower()[0] <= 1 + 1e-12 && answer.upper()[0] >= 1 - 1e-12, "the interval holds 1 m");
  check(answer.upper()[0] - answer.lower()[0] < 1e-5, "and is narrow");
  const auto a = eigen::points(answer.point_a()), b = eigen::points(answer.point_b());
  check(std::abs((b.col(0) - a.col(0)).norm() - answer.upper()[0]) < 1e-12, "the witness points are so far apart");
  check(eigen::numbers(answer.distance()).minCoeff() == answer.distance()[0], "columns as Eigen maps");
  check(eigen::isometry(eigen::pose(X_wb)).isApprox(X_wb, 1e-14), "to a pose and back");

  // A prepared query for other poses, at once and in the background.
  const std::vector<std::uint32_t> moved{engine.body("b")};
  Prepared prepared = engine.prepare(as_check({.bodies = moved}));
  const std::vector<Pose7> poses{{0, 0, 0, 1, 0, 0, 0}, {3, 0, 0, 1, 0, 0, 0}};
  check(prepared.run(poses).verdict()[0] == Status::kOk, "a prepared query");
  check(check_of(prepared.submit({.configurations = poses}).get()).free[1], "and in the background");
  const PathCheck path = engine.check_path({.bodies = moved, .configurations = poses});
  check(!path && path.hit() && path.index == 0, "a path that begins in a contact");

  // Errors are caught by their types; features of a daemon are rejected by name.
  try {
    Scene::load("/dev/null/scene.yaml");
    check(false, "a scene that is not there is an error");
  } catch (const SceneError& error) {
    std::puts(error.what());
  }
  try {
    engine.distances({.min_pose_stamp_ns = 1});
    check(false, "waiting for poses is a daemon's");
  } catch (const std::invalid_argument& error) {
    std::puts(error.what());
  }
  try {
    engine.distances({.rel_tol = NAN});
    check(false, "a tolerance that is no number is an error");
  } catch (const QueryError& error) {
    std::puts(error.what());
  }
  try {
    eigen::pose(Eigen::Isometry3d(Eigen::Scaling(2.0)));
    check(false, "a scaled matrix is no pose");
  } catch (const std::invalid_argument& error) {
    std::puts(error.what());
  }

  // Meshes are read by the installed loader.
  Engine of_file(Scene::load(argv[1]));
  check(of_file.scene().bodies.size() == 19 && of_file.pairs().size() == of_file.distances().rows(), "nineteen bodies");
  Scene with_mesh;
  with_mesh.add_mesh("mesh", argv[2]);
  check(Engine(std::move(with_mesh)).scene().bodies.size() == 1, "a mesh");
}
