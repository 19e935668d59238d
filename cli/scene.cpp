// clearance scene: changes to the daemon's scene.
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <sstream>
#include <stdexcept>

#include "cli/commands.h"
#include "cli/text_lines.h"

namespace clearance::cli {
namespace {

void print(const SceneChanged& changed, const char* how) {
  char text[96];
  std::snprintf(text, sizeof text, "scene revision %016llx, %u bodies, %s in %.3g s",
                static_cast<unsigned long long>(changed.scene_revision), changed.body_count, how, changed.seconds);
  std::cout << text << "\n";
}

void reload(const Connection& connection) {
  Client client = connection.open();
  const auto timeout = std::chrono::duration<double>(connection.timeout_s);
  print(client.reload(std::chrono::duration_cast<Client::Duration>(timeout)), "loaded");
}

struct AddBodyOptions {
  Connection connection;
  std::string name, vertices, points, triangles, mesh_as = "auto", parent;
  std::vector<double> box, capsule, cylinder, cone, ellipsoid, pose, uncertainty{0, 0};
  double sphere = 0, voxel = 0, radius = 0, padding = 0, max_speed = 0;
  bool is_static = false, half_space = false;
};

/// Reads rows of three numbers, separated by white space or commas, from a file or, for "-", standard input.
template <class Number>
std::vector<std::array<Number, 3>> read_rows(const std::string& option, const std::string& path,
                                             const std::string& expected) {
  std::vector<std::array<Number, 3>> rows;
  for_each_line(path, option + " ", [&](std::string line, const std::string& place) {
    std::replace(line.begin(), line.end(), ',', ' ');
    if (line.find_first_not_of(" \t\r") == std::string::npos) return;
    std::istringstream words(line);
    std::array<Number, 3> row{};
    std::string rest;
    if (!(words >> row[0] >> row[1] >> row[2]) || words >> rest)
      throw std::invalid_argument(place + ": expected three " + expected + ", got \"" + line.substr(0, 60) + '"');
    rows.push_back(row);
  });
  if (rows.empty()) throw std::invalid_argument(option + " " + path + ": there are none");
  return rows;
}

void add_body(const CLI::App& command, const AddBodyOptions& o) {
  const auto pose = pose_of("--pose", o.pose);
  std::vector<std::array<double, 3>> vertices;
  if (!o.vertices.empty()) vertices = read_rows<double>("--vertices", o.vertices, "numbers");
  std::vector<std::array<std::uint32_t, 3>> triangles;
  if (!o.triangles.empty()) triangles = read_rows<std::uint32_t>("--triangles", o.triangles, "indices of vertices");
  NewBody body;
  body.name = o.name;
  body.vertices = vertices;
  body.triangles = triangles;
  body.mesh_as = *mesh_as_of(o.mesh_as);
  std::vector<std::array<float, 3>> points;
  if (!o.points.empty()) {
    points = read_rows<float>("--points", o.points, "numbers");
    body.points = points;
    body.voxel = o.voxel;
  }
  if (!o.box.empty()) body.box = {o.box[0], o.box[1], o.box[2]};
  if (command.count("--sphere")) body.sphere = o.sphere;
  if (!o.capsule.empty()) body.capsule = {o.capsule[0], o.capsule[1]};
  if (!o.cylinder.empty()) body.cylinder = {o.cylinder[0], o.cylinder[1]};
  if (!o.cone.empty()) body.cone = {o.cone[0], o.cone[1]};
  if (!o.ellipsoid.empty()) body.ellipsoid = {o.ellipsoid[0], o.ellipsoid[1], o.ellipsoid[2]};
  body.half_space = o.half_space;
  body.radius = o.radius;
  body.is_static = o.is_static;
  body.uncertainty_position = o.uncertainty[0];
  body.uncertainty_angle = o.uncertainty[1];
  body.padding = o.padding;
  body.max_speed = o.max_speed;
  if (!o.pose.empty()) body.pose = pose;
  Client client = o.connection.open();
  if (!o.parent.empty()) body.parent = body_of(client, o.parent);
  print(client.add_body(body), "added");
}

void remove_body(const Connection& connection, const std::string& name) {
  print(connection.open().remove_body(name), "removed");
}

struct AllowOptions {
  Connection connection;
  std::string a, b;
};

void allow(const AllowOptions& o, bool allowed) {
  Client client = o.connection.open();
  const std::uint32_t a = selector_of(client, o.a), b = selector_of(client, o.b);
  const UpdateResult done = allowed ? client.allow(a, b) : client.forbid(a, b);
  std::cout << done.applied << (done.applied == 1 ? " pair" : " pairs") << (allowed ? " allowed\n" : " forbidden\n");
}

void add_shape_options(CLI::App& command, AddBodyOptions& options) {
  auto& shape = *command.add_option_group("Shape", "exactly one; lengths in metres");
  shape.require_option(1);
  shape.add_option("--box", options.box, "edge lengths x y z")->expected(3)->type_name("X");
  shape.add_option("--sphere", options.sphere, "radius")->type_name("R");
  shape.add_option("--capsule", options.capsule, "radius, and length between the centres of its caps, along z")
      ->expected(2)
      ->type_name("X");
  shape.add_option("--cylinder", options.cylinder, "radius, and length along z")->expected(2)->type_name("X");
  shape.add_option("--cone", options.cone, "radius, and length along z, the apex ahead")->expected(2)->type_name("X");
  shape.add_option("--ellipsoid", options.ellipsoid, "half axes x y z")->expected(3)->type_name("X");
  shape.add_flag("--half-space", options.half_space, "z <= 0 in its own frame: a floor or a wall, static");
  shape
      .add_option("--vertices", options.vertices,
                  "the convex hull of the vertices in this file, x y z on a line; - for standard input")
      ->type_name("FILE");
  shape
      .add_option("--points", options.points,
                  "a cloud, which `clearance scene points` replaces: x y z on a line; - for standard input")
      ->type_name("FILE");
  command.add_option("--voxel", options.voxel, "with --points: edge of a box around each point")->type_name("X");
  command
      .add_option("--triangles", options.triangles,
                  "with --vertices: triangles of a mesh, three vertex indices from 0 on a line")
      ->type_name("FILE");
  command
      .add_option("--mesh-as", options.mesh_as,
                  "use of that mesh: hull, surface (its triangles), solid (the enclosed volume), or\n"
                  "auto: hull if it is convex or open, else solid")
      ->check(quiet(CLI::IsMember({"auto", "hull", "surface", "solid"})))
      ->type_name("WORD")
      ->capture_default_str();
  command.add_option("--radius", options.radius, "grows the shape")->type_name("R");
}

void add_placement_options(CLI::App& command, AddBodyOptions& options) {
  command.add_option("--parent", options.parent, "name or number of the body that it follows")->type_name("BODY");
  command
      .add_option("--pose", options.pose,
                  "x y z [qw qx qy qz]; with a parent: relative to it. Default: none until one arrives\n"
                  "(with a parent or static: the origin)")
      ->expected(3, 7)
      ->type_name("X");
  command.add_flag("--static", options.is_static, "it never moves");
  command.add_option("--uncertainty", options.uncertainty, "uncertainty of its pose, in metres and radians")
      ->expected(2)
      ->type_name("X");
  command.add_option("--padding", options.padding, "padding in metres")->type_name("R");
  command.add_option("--max-speed", options.max_speed, "maximum speed of its points, in metres a second")
      ->type_name("V");
}

void add_add(CLI::App& scene) {
  auto& command = *scene.add_subcommand("add", "add a body, such as a grasped object");
  auto options = std::make_shared<AddBodyOptions>();
  command.add_option("NAME", options->name, "name of the new body")->required();
  add_shape_options(command, *options);
  add_placement_options(command, *options);
  add_connection_options(command, options->connection);
  command.callback([&command, options] { add_body(command, *options); });
}

void add_remove(CLI::App& scene) {
  auto& command = *scene.add_subcommand("remove", "remove a body that was added at run time");
  auto connection = std::make_shared<Connection>();
  auto name = std::make_shared<std::string>();
  command.add_option("NAME", *name, "name of the body")->required();
  add_connection_options(command, *connection);
  command.callback([connection, name] { remove_body(*connection, *name); });
}

void add_allow(CLI::App& scene, bool allowed) {
  auto& command =
      *scene.add_subcommand(allowed ? "allow" : "forbid", allowed ? "let bodies touch: exclude their pairs from queries"
                                                                  : "include the pairs of bodies in queries again");
  auto options = std::make_shared<AllowOptions>();
  command.add_option("A", options->a, "body or group; * is every body")->required();
  command.add_option("B", options->b, "the other")->required();
  add_connection_options(command, options->connection);
  command.callback([options, allowed] { allow(*options, allowed); });
}

void add_reload(CLI::App& scene) {
  auto& command = *scene.add_subcommand("reload", "reload the scene file; if that fails, the old scene stays");
  auto connection = std::make_shared<Connection>();
  connection->timeout_s = 600;
  add_connection_options(command, *connection);
  command.callback([connection] { reload(*connection); });
}

}  // namespace

void add_scene(CLI::App& app) {
  auto& scene =
      *app.add_subcommand("scene", "change the daemon's scene: add, remove, move, points, allow, forbid, reload");
  scene.require_subcommand(1);
  add_add(scene);
  add_remove(scene);
  add_move(scene);
  add_points(scene);
  add_allow(scene, true);
  add_allow(scene, false);
  add_reload(scene);
}

}  // namespace clearance::cli
