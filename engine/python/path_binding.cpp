#include "engine/python/path_binding.h"

#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>

#include "engine/query/job_pool.h"

namespace clearance::python {
namespace {

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
    while (!job.advance(kSearchSignalPeriod)) test_signals();
    if (std::chrono::steady_clock::now() - tested_ > kSearchSignalPeriod) test_signals();
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
                    const PathSearch& search) {
  return find_path(query, search, [&] { return EngineProver(std::move(engine), motion); });
}

}  // namespace clearance::python
