#include "engine/query/run_units.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>

#include "engine/base/fp_environment.h"
#include "engine/cost/helping_threads.h"
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
    bool is_done = true;
    for (int worker = 0; is_done && worker < runner_.workers(); ++worker)
      if (open_of(worker) != kNone64) is_done = resume(worker, meter);
    if (is_done) run_new(0, meter, [&] { return from_++; });
    slice_.count(meter.spent());
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

  // The workers' states, each of which one thread has at a time.
  class States {
   public:
    explicit States(const std::vector<std::uint64_t>& interrupted) : taken_(interrupted.size()) {
      for (std::size_t w = 0; w < interrupted.size(); ++w)
        if (interrupted[w] != kNone64) {
          taken_[w] = true;
          interrupted_.push_back(static_cast<int>(w));
        }
    }
    // The next worker with an interrupted unit; -1 if all are taken.
    int take_interrupted() {
      const std::size_t i = next_.fetch_add(1, std::memory_order_relaxed);
      return i < interrupted_.size() ? interrupted_[i] : -1;
    }
    void give_back(int worker) { taken_[static_cast<std::size_t>(worker)].store(false, std::memory_order_release); }
    // After take_interrupted() has returned -1; there is one for each thread that has no other.
    int take_free() {
      for (std::size_t w = 0;; w = (w + 1) % taken_.size())
        if (!taken_[w].exchange(true, std::memory_order_acquire)) return static_cast<int>(w);
    }

   private:
    std::vector<std::atomic<bool>> taken_;  // by worker
    std::vector<int> interrupted_;
    std::atomic<std::size_t> next_{0};
  };

  std::uint64_t& open_of(int worker) { return runner_.interrupted_[static_cast<std::size_t>(worker)]; }

  // Returns whether a worker's unit is done.
  bool resume(int worker, WorkMeter& meter) {
    if (!unit_(open_of(worker), worker, meter)) return false;
    open_of(worker) = kNone64;
    return true;
  }

  // Runs new units with a worker's state.
  // \param take returns the next unit
  template <class Take>
  void run_new(int worker, WorkMeter& meter, const Take& take) {
    while (!(meter.spent() > 0 && meter.is_over())) {
      const std::uint64_t i = take();
      if (i >= count_) return;
      open_of(worker) = i;
      if (!resume(worker, meter)) return;
    }
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

  // Runs on `threads` threads, or as many as begin in time.
  void run_team(int threads) {
    std::exception_ptr failure;  // of any thread
    std::mutex failing;
    std::atomic<std::chrono::nanoseconds::rep> worked{0};
    std::atomic<std::uint64_t> spent{0}, from{from_};
    States states(runner_.interrupted_);
    const auto share = [&](WorkMeter& meter) {
      for (int worker; (worker = states.take_interrupted()) >= 0; states.give_back(worker))
        if (!resume(worker, meter)) return;
      run_new(states.take_free(), meter, [&] { return from.fetch_add(1, std::memory_order_relaxed); });
    };
    const auto work = [&] {
      const std::chrono::nanoseconds begun = thread_time();
      WorkMeter meter = slice_.share();
      try {
        const FpEnvironment environment;
        share(meter);
      } catch (...) {
        const std::lock_guard lock(failing);
        failure = std::current_exception();
      }
      spent.fetch_add(meter.spent(), std::memory_order_relaxed);
      worked.fetch_add((thread_time() - begun).count(), std::memory_order_relaxed);
    };
    const Clock::time_point begin = Clock::now();
    {
      const HelpingThreads help(threads - 1, work);
      work();
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
