#include "engine/python/path_binding.h"

#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "client/python/bindings/gil.h"
#include "engine/query/job_pool.h"

namespace clearance::python {
namespace {

/// Interval at which a search tests for Ctrl-C.
constexpr std::chrono::milliseconds kSignalPeriod{50};

/// Proves motions by one query whose runs share a job. Releases the interpreter's lock while it exists.
class EngineProver final : public EdgeProver {
 public:
  EngineProver(std::shared_ptr<engine::Engine> engine, const QueryView& motions)
      : engine_(std::move(engine)), query_(motions) {
    query_.configuration_count = 2;
    reply_.rows = 1;
    reply_.verdict = &verdict_;
    unlocked_.emplace();
  }

  bool is_free(std::span<const double> ends) override {
    query_.positions = ends;
    Job job = engine_->start(engine_->prepare(query_, jobs_), reply_);
    while (!job.advance(kSignalPeriod)) test_signals();
    if (std::chrono::steady_clock::now() - tested_ > kSignalPeriod) test_signals();
    return verdict_ == static_cast<std::uint8_t>(Status::kBeyond);
  }

 private:
  void test_signals() {
    unlocked_.reset();
    check_signals();
    unlocked_.emplace();
    tested_ = std::chrono::steady_clock::now();
  }

  const std::shared_ptr<engine::Engine> engine_;
  QueryView query_;
  const std::shared_ptr<JobPool> jobs_ = std::make_shared<JobPool>();
  std::uint8_t verdict_ = 0;
  ReplyView reply_;
  std::chrono::steady_clock::time_point tested_ = std::chrono::steady_clock::now();
  std::optional<GilRelease> unlocked_;
};

}  // namespace

nb::tuple find_path(std::shared_ptr<engine::Engine> engine, const Query& query, const QueryView& motion,
                    std::span<const double> start, std::span<const double> goal, const PlanOptions& options) {
  std::vector<JointLimits> limits;
  for (std::size_t j = 0; j < start.size(); ++j) limits.push_back({query.lower->data()[j], query.upper->data()[j]});
  PathFound found;
  {
    EngineProver prover(std::move(engine), motion);
    found = clearance::find_path(prover, limits, start, goal, options);
  }
  auto* path = new std::vector<double>(std::move(found.path));
  const nb::capsule owner(path, [](void* p) noexcept { delete static_cast<std::vector<double>*>(p); });
  return nb::make_tuple(nb::ndarray<nb::numpy, double>(path->data(), {path->size()}, owner), found.iterations,
                        found.edges);
}

}  // namespace clearance::python
