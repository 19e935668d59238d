// clearance joints: lists and sets joint positions of the scene's robots.
#include <iostream>
#include <memory>
#include <set>
#include <sstream>

#include "cli/commands.h"

namespace clearance::cli {
namespace {

struct JointsOptions {
  Connection connection;
  std::string group;
  std::vector<std::string> positions;  // NAME=POSITION
  Output output = Output::kTable;
};

const char* word(Status status) {
  return status == Status::kOk ? "ok" : status == Status::kNoPose ? "none" : "bad";
}

std::uint32_t joint_of(const JointsInfo& info, const std::string& name) {
  for (std::uint32_t j = 0; j < info.joints.size(); ++j)
    if (info.joints[j].name == name) return j;
  throw std::invalid_argument("--set: there is no joint \"" + name + "\"; `clearance joints` lists them");
}

void warn_of_limits(const JointsInfo& info, const std::vector<std::pair<std::uint32_t, double>>& update) {
  std::vector<std::pair<double, JointInfo>> beyond;
  std::ostringstream text;
  for (const auto& [id, position] : update) {
    const JointInfo& joint = info.joints[id];
    if (position >= joint.lower && position <= joint.upper) continue;
    beyond.emplace_back(position, joint);
    text << (beyond.size() > 1 ? ", " : "") << joint.name << " = " << position << " (" << joint.lower << " to "
         << joint.upper << ")";
  }
  if (!beyond.empty())
    std::cerr << "clearance: warning: beyond joint limits: " << text.str() << degrees_hint(beyond) << "\n";
}

/// Reads all positions before it sends any, so a rejected value changes nothing.
void set(Client& client, const JointsInfo& info, const std::vector<std::string>& positions) {
  std::vector<std::pair<std::uint32_t, double>> update;
  for (const std::string& text : positions) {
    const std::size_t equals = text.find('=');
    const std::string number = equals == std::string::npos ? "" : text.substr(equals + 1);
    const double position = position_of(number, "--set: " + text + ": expected JOINT=POSITION, a position");
    update.emplace_back(joint_of(info, text.substr(0, equals)), position);
  }
  const UpdateResult done = client.set_joints(update);
  std::cout << "pose revision " << done.revision << "\n";
  warn_of_bad(done);
  warn_of_limits(info, update);
}

void print(const JointsInfo& info, const std::string& group, Output output) {
  std::set<std::uint32_t> wanted;
  for (const JointGroupInfo& g : info.groups)
    if (g.name == group) wanted.insert(g.joints.begin(), g.joints.end());
  if (!group.empty() && wanted.empty()) {
    std::string known;
    for (const JointGroupInfo& g : info.groups) known += (known.empty() ? "" : ", ") + g.name;
    throw std::invalid_argument("there is no robot or group of joints \"" + group +
                                "\"; there are: " + (known.empty() ? "none" : known));
  }
  Table table({"id", "joint", "position", "status", "lower", "upper", "beyond_limits", "age_s"});
  for (std::uint32_t j = 0; j < info.joints.size(); ++j) {
    if (!group.empty() && !wanted.contains(j)) continue;
    const JointInfo& joint = info.joints[j];
    const bool known = joint.status == Status::kOk;
    table.add({j, joint.name, known ? Cell(joint.position) : Cell(), word(joint.status), joint.lower, joint.upper,
               joint.beyond_limits, joint.age_ns < 0 ? Cell() : Cell(1e-9 * static_cast<double>(joint.age_ns))});
  }
  table.print(std::cout, output);
}

void run(const JointsOptions& o) {
  Client client = o.connection.open();
  const JointsInfo info = client.joint_states();
  if (o.positions.empty()) return print(info, o.group, o.output);
  set(client, info, o.positions);
}

}  // namespace

void add_joints(CLI::App& app) {
  auto& command = *app.add_subcommand("joints", "the joint positions of the scene's robots; --set changes them");
  auto options = std::make_shared<JointsOptions>();
  command.add_option("GROUP", options->group, "a robot, or a group of its joints; default: all");
  command.add_option(
      "--set", options->positions,
      "JOINT=POSITION, radians or metres; may be repeated; all are set at once,\nor none if one is rejected");
  add_connection_options(command, options->connection);
  add_output_options(command, options->output);
  command.callback([options] { run(*options); });
}

}  // namespace clearance::cli
