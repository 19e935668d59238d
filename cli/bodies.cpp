// clearance bodies: the bodies of the scene and their poses.
#include <cmath>
#include <iostream>
#include <memory>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

struct BodiesOptions {
  Connection connection;
  Output output = Output::kTable;
  bool poses = false;
};

Cell parent_cell(const SceneInfo& scene, std::uint32_t parent) {
  return parent < scene.bodies.size() ? Cell(scene.bodies[parent].name) : Cell();
}

void print_bodies(const BodiesOptions& o) {
  Client client = o.connection.open();
  const SceneInfo& scene = client.scene();
  Table table({"id", "body", "kind", "parent", "pieces", "vertices", "extent_m", "model_error_m", "hull_excess_m",
               "empty_share", "truth", "triangles"});
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const BodyInfo& b = scene.bodies[i];
    table.add({i, b.name, b.is_static ? "static" : "movable", parent_cell(scene, b.parent), b.piece_count,
               b.vertex_count, Cell::finite(b.extent, 6), Cell(b.model_error, 3), Cell(b.hull_excess, 3),
               std::isnan(b.empty_share) ? Cell() : Cell(b.empty_share, 3),
               b.triangle_count == 0 ? "pieces"
               : b.is_solid          ? "solid"
                                     : "surface",
               b.triangle_count});
  }
  table.print(std::cout, o.output);
  if (o.output != Output::kTable) return;
  for (const GroupInfo& group : scene.groups) {
    std::cout << "group " << group.name << ":";
    for (const std::uint32_t body : group.bodies) std::cout << " " << name_of(scene, body);
    std::cout << "\n";
  }
  std::printf("%zu bodies, %llu enabled pairs, backend %s, scene %016llx\n", scene.bodies.size(),
              static_cast<unsigned long long>(scene.pair_count), scene.backend.c_str(),
              static_cast<unsigned long long>(scene.revision));
}

const char* pose_status(Status status) {
  switch (status) {
    case Status::kOk:
      return "ok";
    case Status::kBadPose:
      return "bad_pose";
    default:
      return "no_pose";
  }
}

void print_poses(const BodiesOptions& o) {
  Client client = o.connection.open();
  const SceneInfo& scene = client.scene();
  const auto states = client.body_states();
  Table table({"id", "body", "status", "x", "y", "z", "qw", "qx", "qy", "qz", "age_s", "parent"});
  for (std::size_t i = 0; i < states.size(); ++i) {
    std::vector<Cell> row{i, name_of(scene, static_cast<std::uint32_t>(i)), pose_status(states[i].status)};
    for (const double value : states[i].pose) row.push_back(states[i].status == Status::kOk ? Cell(value, 6) : Cell());
    row.push_back(states[i].age_ns < 0 ? Cell() : Cell(1e-9 * static_cast<double>(states[i].age_ns), 3));
    row.push_back(parent_cell(scene, states[i].parent));
    table.add(std::move(row));
  }
  table.print(std::cout, o.output);
}

}  // namespace

void add_bodies(CLI::App& app) {
  auto& command = *app.add_subcommand("bodies", "the bodies of the scene, or their poses");
  auto options = std::make_shared<BodiesOptions>();
  add_connection_options(command, options->connection);
  add_output_options(command, options->output);
  command.add_flag("--poses", options->poses, "their poses and parents instead");
  command.callback([options] { options->poses ? print_poses(*options) : print_bodies(*options); });
}

}  // namespace clearance::cli
