// The query of a benchmark, drawn from the daemon's scene.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "client/client.h"

namespace clearance::cli {

struct BenchQueryOptions {
  std::uint64_t pairs = 0;           ///< drawn from the scene's; 0 for all
  std::uint32_t configurations = 0;  ///< 0 for the current poses
  std::uint32_t moved = 6;           ///< bodies that a configuration moves
  double jitter_m = 0.05;
  std::uint64_t seed = 1;
  std::string reduce = "none", precision = "f64";
  double max_distance = std::numeric_limits<double>::infinity();
};
void add_query_options(CLI::App& command, BenchQueryOptions& options);

/// A query over real poses, with the memory that it refers to.
struct BenchQuery {
  std::vector<IdPair> pairs;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose7> configurations;
  Query query;
};

/// Draws a query. Throws std::invalid_argument if the scene has too few pairs, or no movable body.
BenchQuery make_query(Client& client, const BenchQueryOptions& options);

/// A pose with normal noise: `sigma_m` metres along and as many radians about each axis.
Pose7 jittered(const Pose7& pose, double sigma_m, std::mt19937_64& random);

/// Bodies that can be moved, by id: not static, without a parent, with a usable pose.
std::vector<std::uint32_t> movable_bodies(const SceneInfo& scene, const std::vector<BodyStateInfo>& states);

/// Throws std::invalid_argument if `bench` has options before its mode, which would not apply to it.
void expect_mode_first(const CLI::App& bench);

/// The command line in shell syntax, with priority and pinning, which affect latency.
std::string bench_command_line(const CLI::App& command);

}  // namespace clearance::cli
