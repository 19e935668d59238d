// clearance path: checks that a whole path is free, not only its waypoints.
#include <algorithm>
#include <fstream>
#include <iostream>
#include <memory>
#include <sstream>

#include "cli/commands.h"
#include "cli/text_lines.h"

namespace clearance::cli {
namespace {

constexpr std::size_t kMotionsAtOnce = 256;

struct PathOptions {
  Connection connection;
  std::string file;
  std::vector<std::string> pairs;
  double margin = 0;
  std::uint32_t max_evaluations = 256;
  std::string certificate;  // file name, or empty
};

/// Exit code 1: a path that is not proved free or leaves the joints' limits.
struct NotFree : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Waypoints in joint space.
struct Path {
  std::string head;                 // place of the names, "path.csv:1"
  std::vector<std::string> names;   // (J,)
  std::vector<double> positions;    // (N, J)
  std::vector<std::string> places;  // (N,)
  std::size_t size() const { return places.size(); }
  double at(std::size_t k, std::size_t j) const { return positions[k * names.size() + j]; }
};

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream rest(line);
  for (std::string cell; std::getline(rest, cell, ',');) {
    const std::size_t begin = cell.find_first_not_of(" \t\r\""), end = cell.find_last_not_of(" \t\r\"");
    cells.push_back(begin == std::string::npos ? "" : cell.substr(begin, end + 1 - begin));
  }
  return cells;
}

Path read(const std::string& name) {
  Path path;
  for_each_line(name, "", [&](const std::string& line, const std::string& place) {
    const std::vector<std::string> cells = cells_of(line);
    if (cells.empty() || (cells.size() == 1 && cells[0].empty())) return;
    if (path.names.empty()) {
      path.names = cells;
      path.head = place;
      return;
    }
    if (cells.size() != path.names.size())
      throw std::invalid_argument(place + ": expected " + std::to_string(path.names.size()) +
                                  " numbers, one for each joint of the first line, got " +
                                  std::to_string(cells.size()));
    for (std::size_t j = 0; j < cells.size(); ++j)
      path.positions.push_back(position_of(cells[j], place + ": " + path.names[j] + ": expected a number"));
    path.places.push_back(place);
  });
  if (path.size() < 2)
    throw std::invalid_argument(name + ": expected a line of joint names and two waypoints or more, got " +
                                std::to_string(path.size()));
  return path;
}

std::vector<std::uint32_t> ids_of(const Path& path, const JointsInfo& info) {
  std::vector<std::uint32_t> ids;
  for (const std::string& name : path.names) {
    const auto known = [&name](const JointInfo& joint) { return joint.name == name; };
    const auto found = std::find_if(info.joints.begin(), info.joints.end(), known);
    if (found == info.joints.end())
      throw std::invalid_argument(path.head + ": there is no joint \"" + name + "\"; `clearance joints` lists them");
    ids.push_back(static_cast<std::uint32_t>(found - info.joints.begin()));
  }
  return ids;
}

/// Lists the first waypoint at which each joint exceeds its limits; empty if there is none. Joints move in straight
/// lines, so limits that hold at waypoints hold between them.
std::string beyond_limits(const Path& path, const std::vector<std::uint32_t>& ids, const JointsInfo& info) {
  std::ostringstream text;
  std::vector<std::pair<double, JointInfo>> beyond;
  for (std::size_t j = 0; j < ids.size(); ++j) {
    const JointInfo& joint = info.joints[ids[j]];
    for (std::size_t k = 0; k < path.size(); ++k) {
      const double position = path.at(k, j);
      if (position >= joint.lower && position <= joint.upper) continue;
      const bool is_above = position > joint.upper;
      text << (beyond.empty() ? "" : "\n") << path.places[k] << ": waypoint " << k << ": " << joint.name << " at "
           << position << " is beyond its " << (is_above ? "upper" : "lower") << " limit "
           << (is_above ? joint.upper : joint.lower) << " by "
           << (is_above ? position - joint.upper : joint.lower - position);
      beyond.emplace_back(position, joint);
      break;
    }
  }
  return text.str() + (beyond.empty() ? "" : degrees_hint(beyond));
}

/// Throws NotFree for the motion of row `r`, which begins at waypoint `first`.
/// \param limits beyond_limits()
[[noreturn]] void report(const Result& reply, std::size_t r, std::size_t first, const Path& path, const PathOptions& o,
                         const SceneInfo& scene, const std::string& limits) {
  const Status status = reply.status()[r];
  const auto [a, b] = reply.pair()[r];
  std::ostringstream text;
  const std::string& end = path.places[first + 1];
  text << path.places[first] << ": motion " << first << ", to line " << end.substr(end.rfind(':') + 1) << ": ";
  const std::string pair = name_of(scene, a) + " and " + name_of(scene, b);
  if (status <= Status::kContact)
    text << pair << " are within " << o.margin << " m at t = " << reply.time()[r];
  else if (status == Status::kUnconverged)
    text << "not proved from t = " << reply.first_contact()[2 * r] << " on: " << pair << " may be within " << o.margin
         << " m; --max-evaluations may prove it";
  else
    text << pair << " cannot be evaluated: a pose is bad, missing or old";
  if (!limits.empty()) text << "\n" << limits;
  throw NotFree(text.str());
}

/// Returns both ends of `count` motions from waypoint `first` on.
std::vector<double> ends_of(const Path& path, std::size_t first, std::size_t count) {
  const std::size_t width = path.names.size();
  std::vector<double> ends;
  for (std::size_t k = first; k < first + count; ++k)
    ends.insert(ends.end(), path.positions.data() + k * width, path.positions.data() + (k + 2) * width);
  return ends;
}

/// Writes a certificate of the first motions, if requested.
void certify(Client& client, Query query, const Path& path, std::size_t motions, const PathOptions& o) {
  if (o.certificate.empty()) return;
  const std::vector<double> ends = ends_of(path, 0, motions);
  query.positions = ends;
  std::ofstream file(o.certificate, std::ios::binary);
  file << client.certificate(query);
  if (!file.flush()) throw std::invalid_argument(o.certificate + ": cannot be written");
}

void run(const PathOptions& o) {
  const Path path = read(o.file);
  Client client = o.connection.open();
  const JointsInfo info = client.joint_states();
  const std::vector<std::uint32_t> ids = ids_of(path, info);
  const std::string limits = beyond_limits(path, ids, info);
  const std::vector<IdPair> pairs = pairs_of(client, o.pairs);
  Query query;
  query.pairs = pairs;
  query.joints = ids;
  query.reduce = Reduce::kAny;
  query.margin = o.margin;
  query.max_evaluations = o.max_evaluations;
  query.fields = kFieldStatus | kFieldPair | kFieldTime | kFieldFirstContact | kFieldSteps;
  std::uint64_t steps = 0;
  for (std::size_t first = 0; first + 1 < path.size(); first += kMotionsAtOnce) {
    const std::size_t count = std::min(kMotionsAtOnce, path.size() - 1 - first);
    const std::vector<double> ends = ends_of(path, first, count);
    query.positions = ends;
    const Result reply = client.distances(query);
    for (std::size_t r = 0; r < count; ++r) {
      if (reply.status()[r] != Status::kBeyond) {
        certify(client, query, path, first + r + 1, o);
        report(reply, r, first + r, path, o, client.scene(), limits);
      }
      steps += reply.steps()[r];
    }
  }
  certify(client, query, path, path.size() - 1, o);
  if (!limits.empty()) throw NotFree(limits);
  std::cout << "free: on all " << path.size() - 1 << " motions every pair is proved farther than " << o.margin << " m; "
            << steps << " configurations\n";
  if (!std::cout.flush()) throw std::invalid_argument("standard output cannot be written");
}

/// Turns rejected requests into exit code 2, since 1 means a path that is not free.
void run_or_fail(const PathOptions& o) {
  try {
    run(o);
  } catch (const NotFree&) {
    throw;
  } catch (const ConnectionError&) {
    throw;
  } catch (const std::exception& error) {
    throw std::invalid_argument(error.what());
  }
}

}  // namespace

void add_path(CLI::App& app) {
  auto& command =
      *app.add_subcommand("path", "prove that a path is free along its whole length and within joint limits");
  auto options = std::make_shared<PathOptions>();
  command
      .add_option(
          "FILE", options->file,
          "CSV: a line of joint names as `clearance joints` prints them, then a line for each waypoint,\nradians "
          "and metres; joints move linearly from one to the next")
      ->required();
  command.add_option("--margin", options->margin, "distance in metres that every pair must exceed")
      ->check(at_least_zero())
      ->type_name("M")
      ->capture_default_str();
  command.add_option("--max-evaluations", options->max_evaluations, "maximum evaluations per motion")
      ->check(quiet(CLI::Range(1, 65536)))
      ->type_name("N")
      ->capture_default_str();
  command
      .add_option("--certificate", options->certificate,
                  "write the proof (JSON, for tools/check_certificate.py) of all motions, or of those up to the first\n"
                  "that is not free, with the time of its contact")
      ->type_name("FILE");
  add_pairs_option(command, options->pairs);
  add_connection_options(command, options->connection);
  command.footer(R"(
Exit codes
  0 free    1 not proved free, or beyond a joint's limits    2 an error: a bad file, or the daemon rejected the request
  3 no connection, or no answer in time)");
  command.callback([options] { run_or_fail(*options); });
}

}  // namespace clearance::cli
