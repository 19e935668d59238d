#include "server/core/loop.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "engine/narrow/work_meter.h"
#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {
namespace {

/// Wake-ups without work after which a descriptor that stays readable (such as a listener when no descriptors are left)
/// no longer keeps the loop from sleeping.
constexpr int kWakesForNothing = 100;
/// Interval between polls by system call while the loop is busy. It is the latency that such a transport may add; the
/// poll itself delays requests in memory by a microsecond or two.
constexpr auto kPollInterval = std::chrono::microseconds(50);
/// Time after its last frame for which a transport that is polled in memory counts as in use.
constexpr auto kInUse = std::chrono::milliseconds(100);

std::string scheme_of(const std::string& url) {
  return url.substr(0, url.find(':'));
}

}  // namespace

Loop::Loop(engine::Engine& engine, const Options& options)
    : Loop(std::shared_ptr<engine::Engine>(std::shared_ptr<engine::Engine>(), &engine), options) {}

Loop::Loop(std::shared_ptr<engine::Engine> engine, const Options& options)
    : options_(options),
      wake_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      router_(std::move(engine), workers_, options_, std::min<std::chrono::nanoseconds>(options.slice, kEnough)),
      next_tick_(Clock::now()),
      workers_(options, options.has_control, [this] { wake(); }) {
  if (!wake_fd_) throw std::runtime_error(std::string("eventfd: ") + std::strerror(errno));
}

void Loop::add(std::unique_ptr<Transport> transport) {
  transport_frames_.push_back(&stats()[scheme_of(transport->url()) + ".frames"]);
  transports_.push_back(std::move(transport));
}

void Loop::stop() noexcept {
  stopping_ = true;
  wake();
}

void Loop::wake() noexcept {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_fd_.get(), &one, sizeof one);
}

void Loop::reload_by(Reloader::Make make, Reloader::Build build) {
  router_.scenes.allow(std::move(make), std::move(build), [this] { wake(); });
}

void Loop::reload() noexcept {
  if (router_.scenes.reload()) wake();
}

std::optional<Stats::MetricsSnapshot> Loop::read_metrics(std::chrono::nanoseconds patience) {
  return stats().read(patience, [this] { wake(); });
}

void Loop::run() {
  while (!stopping_) {
    if (turn() || spin()) continue;
    if (!polled_all_) {  // no request that has arrived may wait for the end of a sleep
      next_poll_ = {};
      if (turn()) continue;
    }
    sleep();
    next_poll_ = {};
  }
}

/// Whether to poll for a while before sleeping: if a transport that is polled in memory is in use, and if that has paid
/// lately.
bool Loop::spin_pays() {
  return options_.spin > options_.spin.zero() && last_frame_in_memory_ + kInUse > Clock::now() && spins_.opens();
}

/// Polls for a while if that pays. Returns whether there was anything to do.
bool Loop::spin() {
  if (!spin_pays()) return false;
  const auto end = Clock::now() + options_.spin;
  bool paid = false;
  while (!paid && !stopping_ && turn_began_ < end) paid = turn();
  paid ? spins_.paid() : spins_.missed();
  return paid;
}

bool Loop::turn() {
  section_began_ = turn_began_ = Clock::now();
  units_before_ = units_of_this_thread;
  bool worked = workers_.advance_returned(turn_began_);
  take_new_scene();
  if (stats().are_wanted()) stats().hand_out(router_.counters());
  worked |= poll_in_memory();
  worked |= router_.queries.begin_deferred(turn_began_);
  if (router_.context.poses_changed || turn_began_ >= next_tick_) tick();
  worked |= work_for_a_slice();
  worked |= poll_by_system_call();  // after the work, so that no request in memory waits for it
  if (!worked) return false;
  wakes_for_nothing_ = 0;
  note_section();
  return true;
}

/// Replaces the engine if another one is ready, and frees the old one on a worker.
void Loop::take_new_scene() {
  const std::shared_ptr<engine::Engine> before = router_.scenes.is_busy() ? router_.context.engine : nullptr;
  if (!router_.scenes.turn()) return;
  router_.context.poses_changed = true;
  drop(before);
}

/// Records the time and work since the last poll.
void Loop::note_section() {
  const auto took = static_cast<std::uint64_t>(std::chrono::nanoseconds(Clock::now() - section_began_).count());
  stats().longest_section_ns = std::max(stats().longest_section_ns, took);
  stats().longest_section_units = std::max(stats().longest_section_units, units_of_this_thread - units_before_);
}

bool Loop::poll_in_memory() {
  int frames = 0;
  for (std::size_t i = 0; i < transports_.size(); ++i)
    if (!transports_[i]->polls_by_system_call()) frames += poll_transport(i);
  if (frames > 0) last_frame_in_memory_ = turn_began_;
  return frames > 0;
}

bool Loop::poll_by_system_call() {
  // Poses that a query waits for may come by any transport.
  polled_all_ = turn_began_ >= next_poll_ || !router_.queries.deferred().empty();
  if (!polled_all_) return false;
  turn_began_ = Clock::now();  // arrival of these requests, after the work
  int frames = 0;
  for (std::size_t i = 0; i < transports_.size(); ++i)
    if (transports_[i]->polls_by_system_call()) frames += poll_transport(i);
  // More may have arrived.
  next_poll_ = frames > 0 ? Clock::time_point() : turn_began_ + kPollInterval;
  return frames > 0;
}

int Loop::poll_transport(std::size_t i) {
  try {
    const int taken = transports_[i]->poll(*this);
    *transport_frames_[i] += static_cast<std::uint64_t>(taken);
    return taken;
  } catch (const std::exception& error) {
    ++stats()["errors.transport"];
    if (const auto now = Clock::now(); now >= next_warning_) {
      next_warning_ = now + std::chrono::seconds(1);
      log::warn("event=poll_failed url={} error=\"{}\"", transports_[i]->url(), log_text(error.what()));
    }
    return 0;
  }
}

bool Loop::work_for_a_slice() {
  bool worked = router_.queries.work();
  if (!options_.worker_thread && workers_.work()) {
    workers_.advance_returned(turn_began_);
    worked = true;
  }
  if (worked) warn_of_contradictions();
  return worked;
}

void Loop::warn_of_contradictions() {
  if (engine().contradictions() > 0 && !std::exchange(contradiction_logged_, true))
    log::error(
        "event=contradiction text=\"bounds of a pair contradicted each other, and it was evaluated again: this "
        "machine, "
        "this build or a table of the scene is broken; clearance selftest may find which; engine.contradictions "
        "counts\"");
}

void Loop::tick() {
  router_.context.poses_changed = false;
  const auto now = Clock::now();
  if (now >= next_tick_) {
    next_tick_ = now + options_.tick;
    router_.drop_gone();
    if (options_.on_tick) options_.on_tick();
  }
  for (const auto& transport : transports_) {
    try {
      transport->tick(*this);
    } catch (const std::exception& error) {
      ++stats()["errors.transport"];
      log::warn("event=tick_failed url={} error=\"{}\"", transport->url(), log_text(error.what()));
    }
  }
}

void Loop::sleep() {
  // poll() instead of epoll, as a descriptor that was closed and reused for another client would silently be missing
  // from an epoll set. For tens of descriptors it is as fast.
  std::vector<pollfd> fds{{wake_fd_.get(), POLLIN, 0}};
  for (const auto& transport : transports_)
    for (const int fd : transport->descriptors()) fds.push_back({fd, POLLIN, 0});

  std::size_t prepared = 0;
  bool work = false;
  while (prepared < transports_.size() && !work) work = transports_[prepared++]->prepare_sleep();
  if (!work && !stopping_) wait_for(fds);
  for (std::size_t i = 0; i < prepared; ++i) transports_[i]->finish_sleep();
}

/// Sleeps until a descriptor is readable, wake() is called, or a deadline or the tick is due.
/// @param fds the one that wake() writes to, and the transports'
void Loop::wait_for(std::span<pollfd> fds) {
  const auto until = std::min({next_tick_, router_.queries.deferred().deadline(), workers_.deadline()});
  const auto left = std::max<std::chrono::nanoseconds>(until - Clock::now(), std::chrono::nanoseconds(0));
  timespec timeout{left.count() / 1'000'000'000, left.count() % 1'000'000'000};
  // A descriptor that stays readable without work is ignored for a while.
  const bool nagged = ++wakes_for_nothing_ > kWakesForNothing;
  if (nagged) timeout = {0, std::min<long>(1'000'000, timeout.tv_sec ? 1'000'000 : timeout.tv_nsec)};
  ++stats()["loop.sleeps"];
  const int ready = ppoll(fds.data(), nagged ? 1 : fds.size(), &timeout, nullptr);
  if (ready == 0 && !nagged) wakes_for_nothing_ = 0;
  // After the wait: the reason for the wake-up was set before it, so the next turn sees it.
  std::uint64_t woken;
  [[maybe_unused]] const auto taken = read(wake_fd_.get(), &woken, sizeof woken);
}

}  // namespace clearance
