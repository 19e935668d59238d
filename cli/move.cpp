// What changes where bodies are: set-pose, attach.
#include <iostream>
#include <memory>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

struct SetPoseOptions {
  Connection connection;
  std::string body;
  std::vector<double> pose;
};

void set_pose(const SetPoseOptions& o) {
  const Pose7 wanted = pose_of("POSE", o.pose);
  Client client = o.connection.open();
  const std::pair<std::uint32_t, Pose7> pose{body_of(client, o.body), wanted};
  const PosesDone done = client.set_poses(std::span(&pose, 1));
  if (done.fixed) throw RequestError(0, "\"" + o.body + "\" is static: it does not move");
  std::cout << "pose revision " << done.revision << "\n";
  warn_of_bad(done);
}

struct AttachOptions {
  Connection connection;
  std::string child, parent;
  bool free = false;
  std::vector<double> pose;
  std::vector<std::string> allow;
};

void attach(const AttachOptions& o) {
  const Pose7 pose = pose_of("--pose", o.pose);
  if (o.free == !o.parent.empty()) throw std::invalid_argument("attach: name a parent, or say --free");
  Client client = o.connection.open();
  std::vector<std::uint32_t> allowed;
  for (const std::string& name : o.allow) allowed.push_back(selector_of(client, name));
  const PosesDone done = client.attach(body_of(client, o.child), o.free ? kNone : body_of(client, o.parent),
                                       o.pose.empty() ? nullptr : &pose, allowed);
  std::cout << "pose revision " << done.revision << "\n";
}

}  // namespace

void add_set_pose(CLI::App& app) {
  auto& command = *app.add_subcommand("set-pose", "put a body somewhere");
  auto options = std::make_shared<SetPoseOptions>();
  command.add_option("BODY", options->body, "its name or number")->required();
  command.add_option("POSE", options->pose, "x y z [qw qx qy qz], metres; of a body with a parent: relative to it")
      ->required()
      ->expected(3, 7);
  add_connection_options(command, options->connection);
  command.callback([options] { set_pose(*options); });
}

void add_attach(CLI::App& app) {
  auto& command = *app.add_subcommand("attach", "make a body follow another, as a grasped object does");
  auto options = std::make_shared<AttachOptions>();
  command.add_option("CHILD", options->child, "name or number")->required();
  command.add_option("PARENT", options->parent, "name or number");
  command.add_flag("--free", options->free, "follow nobody any more");
  command.add_option("--pose", options->pose, "where in the parent: x y z [qw qx qy qz]; default: where it is now")
      ->expected(3, 7)
      ->type_name("X");
  command.add_option("--allow", options->allow, "bodies and groups that the child may touch while it is attached so")
      ->delimiter(',')
      ->type_name("NAME,...");
  add_connection_options(command, options->connection);
  command.callback([options] { attach(*options); });
}

}  // namespace clearance::cli
