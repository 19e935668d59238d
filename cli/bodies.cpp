// What the daemon knows: bodies, poses, ping.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

struct PlainOptions {
  Connection connection;
  Output output = Output::kTable;
};

Cell parent_cell(const SceneInfo& scene, std::uint32_t parent) {
  return parent < scene.bodies.size() ? Cell(scene.bodies[parent].name) : Cell();
}

void print_bodies(const PlainOptions& o) {
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

void print_poses(const PlainOptions& o) {
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

/// Like clearance::cli subcommands everywhere: options live as long as the callback that reads them.
template <class Run>
CLI::App& add_plain(CLI::App& app, const char* name, const char* description, Run run) {
  auto& command = *app.add_subcommand(name, description);
  auto options = std::make_shared<PlainOptions>();
  add_connection_options(command, options->connection);
  add_output_options(command, options->output);
  command.callback([options, run] { run(*options); });
  return command;
}

struct PingOptions {
  Connection connection;
  unsigned count = 100;
};

void ping(const PingOptions& o) {
  Client client = o.connection.open();
  const std::vector<std::byte> payload(64);
  std::vector<double> us;
  for (unsigned i = 0; i < o.count; ++i) us.push_back(1e-3 * static_cast<double>(client.ping(payload).count()));
  std::sort(us.begin(), us.end());
  const auto at = [&us](double part) {
    return us[std::min(us.size() - 1, static_cast<std::size_t>(part * static_cast<double>(us.size())))];
  };
  std::printf("%s: %u echoes of %zu bytes, round trip min %.1f us, p50 %.1f us, p99 %.1f us, max %.1f us\n",
              client.url().c_str(), o.count, payload.size(), us.front(), at(0.5), at(0.99), us.back());
}

}  // namespace

void add_bodies(CLI::App& app) {
  add_plain(app, "bodies", "the bodies of the scene", print_bodies);
}
void add_poses(CLI::App& app) {
  add_plain(app, "poses", "where the bodies are", print_poses);
}

void add_ping(CLI::App& app) {
  auto& command = *app.add_subcommand("ping", "time bare echoes through the daemon");
  auto options = std::make_shared<PingOptions>();
  add_connection_options(command, options->connection);
  command.add_option("--count", options->count, "echoes")
      ->check(quiet(CLI::Range(1u, 100000000u)))
      ->type_name("N")
      ->capture_default_str();
  command.callback([options] { ping(*options); });
}

}  // namespace clearance::cli
