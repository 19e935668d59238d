// clearance robot: content of a URDF and its SRDF, and poses of links by joint positions.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <sstream>

#include "cli/commands.h"
#include "cli/text_lines.h"
#include "engine/robot/kinematics.h"
#include "inspect/robot_pairs.h"

namespace clearance::cli {
namespace {

struct RobotCommand {
  std::string urdf, srdf, positions, state;
  std::vector<std::string> packages, joints;
  std::vector<double> base = {0, 0, 0, 1, 0, 0, 0};
  double radius = 0;
  std::string srdf_to_write;
  bool seen = false, visual = false;
  FindingOptions finding;
  Output output = Output::kTable;
};

RobotModel load_robot(const RobotCommand& o) {
  RobotModel robot = read_urdf(o.urdf);
  if (!o.srdf.empty()) read_srdf(o.srdf, &robot);
  for (const std::string& warning : robot.warnings) std::cerr << "clearance: warning: " << warning << "\n";
  return robot;
}

std::string words(JointKind kind) {
  constexpr const char* kWords[] = {"fixed", "revolute", "continuous", "prismatic", "planar", "floating"};
  return kWords[static_cast<int>(kind)];
}

// --- inspect

std::map<std::string, std::string> packages_of(const RobotCommand& o) {
  std::map<std::string, std::string> packages;
  for (const std::string& package : o.packages) {
    const std::size_t equals = package.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == package.size())
      throw CLI::ValidationError("--packages", "expected NAME=FOLDER, got " + package);
    packages[package.substr(0, equals)] = package.substr(equals + 1);
  }
  return packages;
}

void inspect_robot(const RobotCommand& o) {
  const RobotModel robot = load_robot(o);
  std::map<std::string, std::string> packages = packages_of(o);
  find_packages(robot, false, &packages);
  const std::string folder = o.urdf.find('/') == std::string::npos ? "." : o.urdf.substr(0, o.urdf.rfind('/'));
  std::size_t missing = 0;
  Table table({"link", "parent", "joint", "type", "position", "lower", "upper", "shapes", "meshes"});
  for (std::uint32_t l = 0; l < robot.links.size(); ++l) {
    const RobotLink& link = robot.links[l];
    std::size_t meshes = 0;
    for (const RobotShape& shape : link.collision) {
      if (shape.kind != RobotShape::Kind::kMesh) continue;
      ++meshes;
      try {
        mesh_path(shape, folder, packages);
      } catch (const RobotError& error) {
        ++missing;
        std::cerr << "clearance: " << error.what() << "\n";
      }
    }
    std::vector<Cell> row = {link.name, {}, {}, "base", {}, {}, {}, link.collision.size(), meshes};
    if (link.joint != kNone) {
      const RobotJoint& joint = robot.joints[link.joint];
      row[1] = robot.links[joint.parent].name;
      row[2] = joint.name;
      row[3] = words(joint.kind);
      if (joint.mimic) row[4] = "mimics " + robot.joints[joint.mimic->joint].name;
      if (joint.column != kNone) {
        const RobotColumn& column = robot.columns[joint.column];
        row[4] = joint.kind == JointKind::kPlanar ? joint.name + "/x, /y, /theta" : column.name;
        if (std::isfinite(column.lower)) row[5] = column.lower, row[6] = column.upper;
      }
    }
    table.add(std::move(row));
  }
  table.print(std::cout, o.output);
  if (o.output == Output::kTable)
    std::printf("%s: %zu links, %zu joints, %zu positions, %zu groups, %zu states, %zu disabled pairs\n",
                robot.name.c_str(), robot.links.size(), robot.joints.size(), robot.columns.size(), robot.groups.size(),
                robot.states.size(), robot.disabled.size());
  if (missing) throw RobotError(std::to_string(missing) + " meshes are missing");
}

// --- fk

double number(const std::string& place, const std::string& text) {
  double x = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (error != std::errc() || end != text.data() + text.size())
    throw RobotError(place + ": expected a number, got " + excerpt(text));
  return x;
}

std::uint32_t column_of(const RobotModel& robot, const std::string& place, const std::string& name) {
  const std::uint32_t column = robot.find_column(name);
  if (column == kNone) throw RobotError(place + ": no joint of " + robot.name + " has a position " + excerpt(name));
  return column;
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> out;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) out.push_back(cell);
  return out;
}

// Concatenated configurations: the state's positions, overridden by --set and by the file's rows.
std::vector<double> configurations(const RobotModel& robot, const RobotCommand& o) try {
  std::vector<double> first(robot.columns.size(), 0);
  if (!o.state.empty()) {
    const auto is_requested = [&](const GroupState& s) {
      return s.name == o.state || s.group + "/" + s.name == o.state;
    };
    const auto at = std::find_if(robot.states.begin(), robot.states.end(), is_requested);
    if (at == robot.states.end()) throw RobotError("--state: the SRDF has no state " + excerpt(o.state));
    for (const auto& [column, position] : at->positions) first[column] = position;
  }
  for (const std::string& joint : o.joints) {
    const std::size_t equals = joint.find('=');
    if (equals == std::string::npos) throw RobotError("--set: expected JOINT=POSITION, got " + excerpt(joint));
    first[column_of(robot, "--set", joint.substr(0, equals))] = number("--set", joint.substr(equals + 1));
  }
  if (o.positions.empty()) return first;
  std::optional<std::vector<std::uint32_t>> columns;
  std::vector<double> all;
  for_each_line(o.positions, "", [&](const std::string& line, const std::string& place) {
    const std::vector<std::string> cells = split(line);
    if (!columns) {
      columns.emplace();
      for (const std::string& name : cells) columns->push_back(column_of(robot, place, name));
      return;
    }
    if (cells.size() != columns->size())
      throw RobotError(place + ": expected " + std::to_string(columns->size()) + " numbers, got " +
                       std::to_string(cells.size()));
    for (std::size_t c = 0; c < cells.size(); ++c) first[(*columns)[c]] = number(place, cells[c]);
    all.insert(all.end(), first.begin(), first.end());
  });
  if (!columns) throw RobotError(o.positions + ": expected a line of names, separated by commas");
  return all;
} catch (const std::invalid_argument& unreadable) {
  throw RobotError(unreadable.what());
}

void print_link_poses(const RobotCommand& o) {
  const RobotModel robot = load_robot(o);
  const Kinematics kinematics(robot);
  const Pose base{{o.base[0], o.base[1], o.base[2]}, o.base[3], o.base[4], o.base[5], o.base[6]};
  if (check(base) == PoseQuality::kBad) throw RobotError("--base: expected a pose x y z qw qx qy qz");
  const std::vector<double> positions = configurations(robot, o);
  const std::size_t columns = robot.columns.size(), count = columns ? positions.size() / columns : 1;
  std::vector<Pose> roots(kinematics.roots().size());
  roots[0] = base;  // links of floating joints stay at the identity
  std::vector<Pose> poses(count * robot.links.size());
  std::vector<Status> status(count);
  kinematics.place(positions, roots, poses, status);
  Table table({"configuration", "link", "x", "y", "z", "qw", "qx", "qy", "qz", "error", "reach"});
  for (std::size_t k = 0; k < count; ++k) {
    if (status[k] != Status::kOk)
      throw RobotError("configuration " + std::to_string(k) + ": positions must be numbers up to 1e6");
    const double travel = kinematics.travel(std::span(positions).subspan(k * columns, columns));
    for (std::uint32_t l = 0; l < robot.links.size(); ++l) {
      const Pose& X = poses[k * robot.links.size() + l];
      table.add({k, robot.links[l].name, X.translation.x, X.translation.y, X.translation.z, X.qw, X.qx, X.qy, X.qz,
                 Cell(kinematics.error(l, o.radius).at(travel, norm(base.translation)), 3),
                 Cell(kinematics.reach(l, o.radius) + travel + norm(base.translation), 3)});
    }
  }
  table.print(std::cout, o.output);
}

// --- pairs

const char* word_of(PairFinding finding) {
  constexpr const char* kWords[] = {"adjacent", "never", "always", "never_seen", "always_seen", "sometimes"};
  return kWords[static_cast<int>(finding)];
}

void print_robot_pairs(const RobotCommand& o) {
  const RobotModel model = load_robot(o);
  engine::RobotOptions robot;
  robot.urdf = o.urdf;
  robot.packages = packages_of(o);
  robot.visual = o.visual;
  const std::vector<RobotPair> found = find_robot_pairs(robot, o.finding);
  Table table({"link_a", "link_b", "finding", "proof_steps"});
  std::map<PairFinding, std::size_t> count;
  for (const RobotPair& pair : found) {
    table.add({pair.a, pair.b, word_of(pair.found.finding), pair.found.steps});
    ++count[pair.found.finding];
  }
  table.print(std::cout, o.output);
  if (o.output == Output::kTable)
    std::printf(
        "%s: %zu pairs: %zu adjacent; proved over all positions: %zu never, %zu always; in %u samples: %zu never, "
        "%zu always; %zu to be queried\n",
        model.name.c_str(), found.size(), count[PairFinding::kAdjacent], count[PairFinding::kNever],
        count[PairFinding::kAlways], o.finding.samples, count[PairFinding::kNeverSeen], count[PairFinding::kAlwaysSeen],
        count[PairFinding::kSometimes]);
  if (o.srdf_to_write.empty()) return;
  std::ofstream file(o.srdf_to_write);
  file << srdf_of(model.name, found, o.finding, o.seen);
  if (!file.flush()) throw RobotError(o.srdf_to_write + ": cannot be written");
}

void add_robot_options(CLI::App& command, RobotCommand& o) {
  command.add_option("urdf", o.urdf, "the robot")->required();
  command.add_option("--srdf", o.srdf, "its SRDF");
  add_output_options(command, o.output);
}

void add_packages(CLI::App& command, RobotCommand& o) {
  command
      .add_option("--packages", o.packages,
                  "NAME=FOLDER: folder of package://NAME/..., if ROS' environment does not have it; may be repeated")
      ->take_all();
}

}  // namespace

void add_robot(CLI::App& app) {
  auto& command =
      *app.add_subcommand("robot", "contents of a URDF, and forward kinematics of its links: inspect, fk, pairs");
  command.require_subcommand(1);
  const auto o = std::make_shared<RobotCommand>();
  auto& inspecting = *command.add_subcommand("inspect", "links, joints, limits and shapes; warnings; missing meshes");
  add_robot_options(inspecting, *o);
  add_packages(inspecting, *o);
  inspecting.callback([o] { inspect_robot(*o); });
  auto& placing = *command.add_subcommand("fk", "poses of all links, with error bounds");
  add_robot_options(placing, *o);
  placing.add_option("--set", o->joints, "JOINT=POSITION: radians or metres; others are 0")->take_all();
  placing.add_option("--state", o->state, "positions of an SRDF's group state: NAME or GROUP/NAME");
  placing.add_option("--positions", o->positions,
                     "file of configurations: a line of names, then a line of numbers for each");
  placing.add_option("--base", o->base, "pose of the base: x y z qw qx qy qz")->expected(7);
  placing
      .add_option("--radius", o->radius, "metres: error bounds are for points of a link up to this far from its origin")
      ->check(CLI::NonNegativeNumber);
  placing.callback([o] { print_link_poses(*o); });
  auto& finding = *command.add_subcommand(
      "pairs", "pairs of links that never or always touch: proved where possible, else sampled");
  add_robot_options(finding, *o);
  add_packages(finding, *o);
  finding.add_flag("--visual", o->visual, "use the visual shapes of links, not the collision shapes");
  finding.add_option("--samples", o->finding.samples, "random configurations for each pair")
      ->check(CLI::PositiveNumber);
  finding.add_option("--steps", o->finding.most_steps, "maximum evaluations in the proof of a pair");
  finding.add_option("--seed", o->finding.seed, "seed of the samples");
  finding.add_option("--margin", o->finding.margin, "metres: pairs within it count as touching")
      ->check(CLI::Range(0.0, 1e3));
  finding.add_option("--write", o->srdf_to_write, "SRDF to write: disables adjacent and proved pairs");
  finding.add_flag("--seen", o->seen, "with --write: also disables pairs that only samples support");
  finding.callback([o] { print_robot_pairs(*o); });
  command.footer(R"(
Exit codes
  0 done    1 the robot or the request is invalid    2 the command line is wrong)");
}

}  // namespace clearance::cli
