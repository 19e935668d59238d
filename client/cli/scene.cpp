// What changes the scene: reload.
#include <cstdio>
#include <iostream>
#include <memory>

#include "commands.h"

namespace clearance::cli {
namespace {

void reload(const Connection& connection) {
  Client client = connection.open();
  const auto timeout = std::chrono::duration<double>(connection.timeout_s);
  const SceneChanged changed = client.reload(std::chrono::duration_cast<Client::Duration>(timeout));
  char text[96];
  std::snprintf(text, sizeof text, "scene revision %016llx, %u bodies, loaded in %.3g s",
                static_cast<unsigned long long>(changed.scene_revision), changed.body_count, changed.seconds);
  std::cout << text << "\n";
}

}  // namespace

void add_reload(CLI::App& app) {
  auto& command = *app.add_subcommand("reload", "have the daemon load its scene file anew; the old scene stays if it cannot");
  auto connection = std::make_shared<Connection>();
  connection->timeout_s = 600;
  add_connection_options(command, *connection);
  command.callback([connection] { reload(*connection); });
}

}  // namespace clearance::cli
