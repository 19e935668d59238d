#include "inspect/covers.h"

#include <exception>
#include <optional>

#include "engine/base/fp_environment.h"
#include "engine/cache/cache.h"
#include "engine/cover/cover_record.h"
#include "engine/engine.h"

namespace clearance {

namespace {

CoverReport report_of(std::uint32_t body, const TimedCover& made) {
  CoverReport report{body, 0, made.cover.resident_bytes(), made.seconds, {}};
  for (int level = 0; level < Cover::kLevels; ++level) {
    report.levels[level] = stand_out(made.cover, level);
    report.balls += report.levels[level].balls;
  }
  return report;
}

}  // namespace

std::vector<CoverReport> covers_of(const engine::Scene& scene) {
  const Cache cache = Cache::of_environment();
  const std::vector<std::uint32_t> bodies = engine::bodies_to_cover(scene);
  std::vector<std::optional<CoverReport>> found(bodies.size());
  std::exception_ptr error;
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < bodies.size(); ++i) try {
      const FpEnvironment environment;
      const std::vector<ConvexPartPtr>& parts = scene.bodies()[bodies[i]].parts;
      const std::string name = cover_name(parts);
      std::optional<TimedCover> made = read_cover(cache, name);
      if (!made) made = make_timed_cover(cache, name, parts);
      if (made) found[i] = report_of(bodies[i], *made);
    } catch (...) {
#pragma omp critical
      error = std::current_exception();
    }
  if (error) std::rethrow_exception(error);
  std::vector<CoverReport> reports;
  for (const std::optional<CoverReport>& report : found)
    if (report) reports.push_back(*report);
  return reports;
}

}  // namespace clearance
