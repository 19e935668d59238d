// clearance-tradeoff: cost of accuracy. Sweeps the settings of a query over scenes in motion and writes one row for
// each.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iostream>

#include "bench/tradeoff/sweep.h"
#include "cli/machine_name.h"

namespace clearance::tradeoff {
namespace {

struct Options {
  std::string csv, scenes = "scenes";
  std::vector<std::string> only, backends;
  std::uint64_t seed = 1;
  int steps = 24;
  std::size_t checked = 40;
  SweepOptions sweep;
};

int run(Options o) {
  if (o.only.empty()) o.only = scene_names();
  if (o.backends.empty()) {
    o.backends = engine::Engine::backends();
    std::erase(o.backends, "reference");  // it is the reference
  }
  std::ofstream out(o.csv);
  if (!out) throw std::runtime_error(o.csv + ": cannot be written");
  out << "# seed " << o.seed << ", " << o.steps << " steps, " << o.sweep.rounds << " rounds, 1 thread, "
      << machine_name() << "\n";
  write_header(out);
  std::printf("%-9s %-9s %6s %6s %12s %12s %12s %11s  %s\n", "scene", "backend", "pairs", "judged", "median m",
              "default ns", "fastest ns", "violations", "what");
  std::size_t violations = 0;
  for (const std::string& name : o.only) {
    const MovingScene scene = make_moving_scene(name, o.scenes, o.seed, o.steps);
    const ExactDistances exact_value = find_exact_distances(scene, o.checked);
    for (const std::string& backend : o.backends) {
      o.sweep.backend = backend;
      const std::vector<Point> points = sweep(scene, exact_value, o.sweep);
      write_rows(out, scene, exact_value, o.sweep, points);
      std::size_t misses = 0;
      double usual = 0, fastest = points[0].ns_per_pair;
      for (const Point& p : points) {
        misses += p.violations;
        if (p.setting == kDefault) usual = p.ns_per_pair;
        fastest = std::min(fastest, p.ns_per_pair);
      }
      std::printf("%-9s %-9s %6zu %6zu %12.4g %12.0f %12.0f %11zu  %s\n", name.c_str(), backend.c_str(),
                  scene.pairs.size(), exact_value.checked, exact_value.median, usual, fastest, misses,
                  scene.what.c_str());
      std::fflush(stdout);
      violations += misses;
    }
  }
  if (!out.flush()) throw std::runtime_error(o.csv + ": cannot be written");
  if (violations > 0) std::cerr << "clearance-tradeoff: " << violations << " intervals miss the exact distance\n";
  return violations > 0 ? 1 : 0;
}

}  // namespace
}  // namespace clearance::tradeoff

int main(int argc, char** argv) {
  using namespace clearance::tradeoff;
  Options o;
  CLI::App app("Measures what accuracy costs: error, certified width and time per pair for every setting of a query.",
               "clearance-tradeoff");
  app.add_option("--csv", o.csv, "file to write")->required();
  app.add_option("--scenes", o.scenes, "folder of the repository's scenes")->capture_default_str();
  app.add_option("--scene", o.only, "only this scene (may be repeated)");
  app.add_option("--backend", o.backends, "only this backend (may be repeated); default: all but reference");
  app.add_option("--seed", o.seed)->capture_default_str();
  app.add_option("--steps", o.steps, "of motion")->check(CLI::Range(1, 10000))->capture_default_str();
  app.add_option("--rounds", o.sweep.rounds, "how often each setting is timed")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--judged", o.checked, "pairs of a scene that the exact judge looks at as well")
      ->capture_default_str();
  app.add_flag("--brief", o.sweep.brief, "a few settings only");
  CLI11_PARSE(app, argc, argv);
  try {
    return run(o);
  } catch (const std::exception& error) {
    std::cerr << "clearance-tradeoff: " << error.what() << "\n";
    return 1;
  }
}
