// Subcommands of `clearance`. Each add_ function adds one with its options and callback.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "cli/table.h"
#include "client/client.h"

namespace clearance::cli {

/// Address of the daemon: the options --connect and --timeout.
struct Connection {
  std::string url;
  double timeout_s = 5;
  /// Throws ConnectionError, std::invalid_argument.
  Client open() const;
};
void add_connection_options(CLI::App& command, Connection& connection);

/// Hides a check's own description, since the option's text describes the range.
inline CLI::Validator quiet(CLI::Validator check) {
  return check.description("");
}

/// Accepts a number that is not negative.
CLI::Validator at_least_zero();

/// Adds the options --json and --csv.
void add_output_options(CLI::App& command, Output& output);

/// Values of --precision.
extern const std::map<std::string, Precision> kPrecisionNames;

/// Returns a body by name or number.
std::uint32_t body_of(Client& client, const std::string& text);
/// Returns the id of a body, a group, or "*".
std::uint32_t selector_of(Client& client, const std::string& text);
/// Adds the option --pairs, A,B each.
void add_pairs_option(CLI::App& command, std::vector<std::string>& pairs);
/// Returns the values of --pairs. Throws std::invalid_argument.
std::vector<IdPair> pairs_of(Client& client, const std::vector<std::string>& texts);
/// Returns a pose from x y z [qw qx qy qz], or the identity without numbers. Throws std::invalid_argument, also for a
/// pose that the daemon would store as bad.
Pose7 pose_of(const std::string& option, const std::vector<double>& numbers);
/// Returns a finite number. Throws std::invalid_argument, beginning with `expected`, for any other text.
double number_of(const std::string& text, const std::string& expected);
/// Returns a joint's position, a number from -1e6 to 1e6 in radians or metres. Throws as number_of().
double position_of(const std::string& text, const std::string& expected);
/// Returns a hint that positions were given in degrees if one exceeds a turn and all are within their limits as
/// degrees, else nothing.
std::string degrees_hint(const std::vector<std::pair<double, JointInfo>>& beyond);
/// Prints a warning for entries of an update that the daemon has stored as bad.
void warn_of_bad(const UpdateResult& done);
std::string name_of(const SceneInfo& scene, std::uint32_t body);

void add_bodies(CLI::App& app);
void add_query(CLI::App& app);
void add_stat(CLI::App& app);
void add_joints(CLI::App& app);
void add_path(CLI::App& app);
void add_scene(CLI::App& app);
void add_move(CLI::App& scene);             // move.cpp
void add_points(CLI::App& scene);           // points.cpp
void add_bench(CLI::App& app);              // bench.cpp
void add_throughput_mode(CLI::App& bench);  // bench_throughput.cpp
void add_loop_mode(CLI::App& bench);        // bench_loop.cpp
void add_keygen(CLI::App& app);
void add_inspect(CLI::App& app);  // these four only with the engine
void add_robot(CLI::App& app);
void add_selftest(CLI::App& app);
void add_cache(CLI::App& app);
void add_view(CLI::App& app);  // sibling.cpp, also for the next
void add_sweep(CLI::App& app);

}  // namespace clearance::cli
