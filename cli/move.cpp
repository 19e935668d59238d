// clearance scene move: places a body, attaches it to another or frees it.
#include <iostream>
#include <memory>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

struct MoveOptions {
  Connection connection;
  std::string body, parent;
  bool free = false;
  std::vector<double> pose;
  std::vector<std::string> allow;
};

// Attaches the body to its parent, or frees it.
void attach(const MoveOptions& o, const Pose7& pose) {
  Client client = o.connection.open();
  std::vector<std::uint32_t> allowed;
  for (const std::string& name : o.allow) allowed.push_back(selector_of(client, name));
  const UpdateResult done = client.attach(body_of(client, o.body), o.free ? kNone : body_of(client, o.parent),
                                          o.pose.empty() ? nullptr : &pose, allowed);
  std::cout << "pose revision " << done.revision << "\n";
}

void move(const MoveOptions& o) {
  const Pose7 wanted = pose_of("POSE", o.pose);
  if (o.free || !o.parent.empty()) return attach(o, wanted);
  if (o.pose.empty()) throw std::invalid_argument("move: expected POSE, --parent or --free");
  Client client = o.connection.open();
  const std::pair<std::uint32_t, Pose7> pose{body_of(client, o.body), wanted};
  const UpdateResult done = client.set_poses(std::span(&pose, 1));
  if (done.fixed) throw RequestError(0, "\"" + o.body + "\" is static: it does not move");
  std::cout << "pose revision " << done.revision << "\n";
  warn_of_bad(done);
}

}  // namespace

void add_move(CLI::App& scene) {
  auto& command = *scene.add_subcommand("move", "set the pose of a body, or make it follow another, such as a gripper");
  auto options = std::make_shared<MoveOptions>();
  command.add_option("BODY", options->body, "its name or number")->required();
  command
      .add_option("POSE", options->pose,
                  "x y z [qw qx qy qz], metres; of a body with a parent: relative to it;\n"
                  "default with --parent or --free: its current pose")
      ->expected(3, 7);
  auto* parent = command.add_option("--parent", options->parent, "body to follow")->type_name("NAME");
  command.add_flag("--free", options->free, "stop following a body")->excludes(parent);
  command.add_option("--allow", options->allow, "bodies and groups that it may touch while it follows the parent")
      ->delimiter(',')
      ->type_name("NAME,...")
      ->needs(parent);
  add_connection_options(command, options->connection);
  command.callback([options] { move(*options); });
}

}  // namespace clearance::cli
