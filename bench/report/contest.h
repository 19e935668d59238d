// One set of pairs of one scene, answered by every system: the report's, ours, and Coal.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "bench/report/sheet.h"
#include "bench/report/world.h"
#include "engine/engine.h"

namespace clearance::report {

struct ContestOptions {
  int threads = 0;      ///< of systems with several; 0 for all cores
  bool once = false;    ///< accept inaccurate times
  bool gpu = false;     ///< whether a GPU is available
  std::string coal;     ///< Coal's program (bench/peers/coal); empty to leave it out
  std::string scratch;  ///< folder for its problems
};

class Contest {
 public:
  /// Covers all pairs of the scene's bodies.
  Contest(Sheet& sheet, const ContestOptions& options, std::string experiment, std::string name,
          const engine::Scene& scene);

  /// Runs a baseline by name.
  /// \param most maximum number of pairs to time; of more, evenly spaced ones are chosen
  /// \param block_size 0 for the default
  void baseline(const std::string& method, std::uint64_t most = ~std::uint64_t{0}, int block_size = 0);
  /// Runs the engine: distance, bounds, status and, for up to 16 million pairs, witness points, in one query.
  /// \param backend "cpu" or "cuda"
  void engine(const std::string& method, const std::string& backend, int threads);
  /// Runs the engine: each body's nearest neighbour, as in the report's figure 1.
  void nearest(const std::string& method);
  void coal(std::uint64_t most = 500'000);

  const baselines::World& world() const { return world_; }
  std::uint64_t pairs() const { return all_; }

 private:
  std::vector<BodyPair> sample(std::uint64_t most) const;
  void learn_exact_value();
  double worst_error(const std::vector<BodyPair>& pairs, const std::vector<double>& distances);
  Row row(const std::string& method, std::uint64_t measured, double us) const;

  Sheet& sheet_;
  const ContestOptions& options_;
  std::string experiment_, name_;
  engine::Scene scene_;
  baselines::World world_;
  std::uint64_t all_;
};

}  // namespace clearance::report
