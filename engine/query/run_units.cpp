#include "engine/query/run_units.h"

#include <omp.h>

#include <algorithm>
#include <chrono>
#include <exception>

#include "engine/base/fp_environment.h"
#include "engine/cost/team_cost.h"

namespace clearance {

// One call of run().
class UnitRunner::Pass {
 public:
  Pass(UnitRunner& runner, std::uint64_t& next, std::uint64_t count, WorkMeter& slice, const Unit& unit)
      : runner_(runner), next_(next), count_(count), slice_(slice), unit_(unit), from_(next) {}

  // Units that are interrupted or have not begun.
  std::uint64_t left() const {
    const std::vector<std::uint64_t>& open = runner_.interrupted_;
    return count_ - std::min(from_, count_) + open.size() -
           static_cast<std::uint64_t>(std::count(open.begin(), open.end(), kNone64));
  }

  // Runs on the calling thread. Returns true once all units are done.
  bool run_alone(WorkMeter meter) {
    slice_.count(work(0, 1, meter, [&] { return from_++; }));
    return end_phase();
  }

  // Runs on the calling thread until the rest is worth a team, then on a team.
  bool run_with_team(int threads) {
    const std::uint64_t all = left();
    const Clock::time_point begin = Clock::now();
    std::chrono::nanoseconds begun{0};
    std::uint64_t left_then = 0;  // nonzero once the clock suggests a team
    for (std::chrono::nanoseconds time = kAlone;; time *= 2) {
      if (run_alone(slice_.share(time))) return true;
      if (slice_.is_over()) return false;
      // The thread's processor time confirms the cheaper clock, since other processes may have used the core.
      if (left_then && is_worth_team(threads, thread_time() - begun, left_then)) break;
      left_then = is_worth_team(threads, Clock::now() - begin, all) ? left() : 0;
      if (left_then) begun = thread_time();
    }
    run_team(threads);
    return end_phase();
  }

 private:
  using Clock = std::chrono::steady_clock;
  // Time on the calling thread before the first decision about a team.
  static constexpr std::chrono::nanoseconds kAlone{20'000};

  void resume(int worker, WorkMeter& meter) {
    std::uint64_t& open = runner_.interrupted_[static_cast<std::size_t>(worker)];
    if (open != kNone64 && unit_(open, worker, meter)) open = kNone64;
  }

  // One thread's share: interrupted units of its workers, then new ones. Returns the work in units.
  // \param take returns the next unit
  template <class Take>
  std::uint64_t work(int thread, int threads, WorkMeter meter, const Take& take) {
    for (int worker = thread; worker < runner_.workers(); worker += threads) resume(worker, meter);
    std::uint64_t& open = runner_.interrupted_[static_cast<std::size_t>(thread)];
    while (open == kNone64 && !(meter.spent() > 0 && meter.is_over())) {
      const std::uint64_t i = take();
      if (i >= count_) break;
      open = i;
      resume(thread, meter);
    }
    return meter.spent();
  }

  bool end_phase() {
    next_ = std::min(from_, count_);
    return left() == 0;
  }

  // Whether the units left are worth a team, given the time that the others took. Lowers `threads` to their number.
  bool is_worth_team(int& threads, std::chrono::nanoseconds passed, std::uint64_t before) const {
    const std::uint64_t more = left();
    threads = static_cast<int>(std::min<std::uint64_t>(more, static_cast<std::uint64_t>(threads)));
    const double each = 1e-9 * static_cast<double>(passed.count()) / static_cast<double>(before - more + 1);
    return threads > 1 && team_cost().is_worth(each * static_cast<double>(more), threads, Clock::now());
  }

  // Runs on `threads` threads, or fewer if the system has no more.
  void run_team(int threads) {
    std::exception_ptr failure;  // an exception may not leave a parallel region
    std::atomic<std::chrono::nanoseconds::rep> worked{0};
    std::atomic<std::uint64_t> spent{0}, from{from_};
    const Clock::time_point begin = Clock::now();
#pragma omp parallel num_threads(threads)
    {
      const std::chrono::nanoseconds begun = thread_time();
      try {
        const FpEnvironment environment;
        spent += work(omp_get_thread_num(), omp_get_num_threads(), slice_.share(),
                      [&] { return from.fetch_add(1, std::memory_order_relaxed); });
      } catch (...) {
#pragma omp critical(clearance_job_failure)
        failure = std::current_exception();
      }
      worked.fetch_add((thread_time() - begun).count(), std::memory_order_relaxed);
    }
    from_ = from;
    slice_.count(spent);
    const Clock::time_point end = Clock::now();
    team_cost().learn(end - begin, std::chrono::nanoseconds(worked), end);
    if (runner_.teams_) runner_.teams_->fetch_add(1, std::memory_order_relaxed);
    if (failure) std::rethrow_exception(failure);
  }

  UnitRunner& runner_;
  std::uint64_t& next_;
  const std::uint64_t count_;
  WorkMeter& slice_;
  const Unit& unit_;
  std::uint64_t from_;
};

bool UnitRunner::run(std::uint64_t& next, std::uint64_t count, WorkMeter& slice, const Unit& unit, bool alone) {
  Pass pass(*this, next, count, slice, unit);
  const int threads = alone ? 1 : static_cast<int>(std::min(pass.left(), static_cast<std::uint64_t>(workers())));
  return threads <= 1 ? pass.run_alone(slice.share()) : pass.run_with_team(threads);
}

}  // namespace clearance
