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

/// Wake-ups that brought nothing, after which a descriptor that stays readable (a listener without descriptors left,
/// say) may no longer keep the loop from sleeping.
constexpr int kWakesForNothing = 100;
/// How often a loop that is kept awake looks at transports that are polled by system calls: so late may a request or a
/// pose be seen there, while the look, of a microsecond or two, delays requests in memory that seldom.
constexpr auto kLookEvery = std::chrono::microseconds(50);
/// A transport that is polled in memory is in use for so long after its last frame.
constexpr auto kInUse = std::chrono::milliseconds(100);

/// Of the worker for the class planning, where anybody may have the class control: where CPUs are few, what it computes
/// stands back behind the loop and the other worker.
constexpr int kNiceOfPlanning = 10;

ResourceQuota::Limit point_limit(std::uint64_t most, std::string whose, std::string option, wire::ErrorCode code) {
  return {most, code, [=](std::uint64_t held, std::uint64_t more) {
            return "points: " + std::to_string(held + more) + " points " + whose +
                   ", with those that they replace are more than the " + std::to_string(most) +
                   " that there may be (" + option + ")";
          }};
}

std::string scheme_of(const std::string& url) {
  return url.substr(0, url.find(':'));
}

}  // namespace

Loop::Loop(Engine& engine, const Options& options)
    : Loop(std::shared_ptr<Engine>(std::shared_ptr<Engine>(), &engine), options) {}

Loop::Loop(std::shared_ptr<Engine> engine, const Options& options)
    : options_(options),
      wake_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      engine_(std::move(engine)),
      points_(point_limit(options.max_points_of_client, "of this client", "limit max-client-points",
                          wire::ErrorCode::kTooLarge),
              point_limit(options.max_points, "of all clients", "limit max-points", wire::ErrorCode::kBusy)),
      started_(Clock::now()),
      next_tick_(started_),
      plan_worker_({options.slice, options.worker_thread, kNiceOfPlanning}, [this] { wake(); }),
      control_worker_({options.slice, options.worker_thread}, [this] { wake(); }),
      planning_worker_({options.slice, options.worker_thread, options.has_control ? kNiceOfPlanning : 0},
                       [this] { wake(); }),
      points_worker_({options.slice, options.worker_thread, kNiceOfPlanning}, [this] { wake(); }),
      run_worker_({options.slice, options.worker_thread}, [this] { wake(); }) {
  if (!wake_fd_) throw std::runtime_error(std::string("eventfd: ") + std::strerror(errno));
}

void Loop::add(std::unique_ptr<Transport> transport) {
  transport_frames_.push_back(&stats_[scheme_of(transport->url()) + ".frames"]);
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
  scenes_.allow(std::move(make), std::move(build), [this] { wake(); });
}

void Loop::reload() noexcept {
  if (scenes_.reload()) wake();
}

std::optional<Stats::MetricsSnapshot> Loop::read_metrics(std::chrono::nanoseconds patience) {
  return stats_.read(patience, [this] { wake(); });
}

void Loop::run() {
  while (!stopping_) {
    if (turn() || spin()) continue;
    if (!looked_at_all_) {  // nothing that has arrived or is due may be slept over
      next_look_ = {};
      if (turn()) continue;
    }
    sleep();
    next_look_ = {};
  }
}

/// Whether the wait that begins is to poll for a while before it sleeps: it may where somebody uses a transport that is
/// polled in memory, and does as long as that has been seen to pay.
bool Loop::spin_pays() {
  return options_.spin > options_.spin.zero() && last_frame_in_memory_ + kInUse > Clock::now() && spins_.opens();
}

/// Polls for a while, if that pays. Returns whether something came meanwhile.
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
  bool worked = settle_what_was_worked_on();
  const std::shared_ptr<Engine> before = scenes_.is_busy() ? engine_ : nullptr;
  if (scenes_.turn()) {
    poses_changed_ = true;
    drop(before);
  }
  if (stats_.are_wanted()) stats_.hand_out(all_counters());
  worked |= poll_in_memory();
  if (!held_.empty())
    worked |= held_.release(*engine_, turn_began_, [this](DeferredQuery held) { begin_held(std::move(held)); });
  if (poses_changed_ || turn_began_ >= next_tick_) tick();
  worked |= work_for_a_slice();
  worked |= poll_by_system_call();  // after the work, so that no request in memory waits for it
  if (!worked) return false;
  wakes_for_nothing_ = 0;
  note_section();
  return true;
}

/// What the loop has done since it looked at its transports last.
void Loop::note_section() {
  const auto took = static_cast<std::uint64_t>(std::chrono::nanoseconds(Clock::now() - section_began_).count());
  stats_.longest_section_ns = std::max(stats_.longest_section_ns, took);
  stats_.longest_section_units = std::max(stats_.longest_section_units, units_of_this_thread - units_before_);
}

bool Loop::poll_in_memory() {
  int frames = 0;
  for (std::size_t i = 0; i < transports_.size(); ++i)
    if (!transports_[i]->polls_by_system_call()) frames += poll_transport(i);
  if (frames > 0) last_frame_in_memory_ = turn_began_;
  return frames > 0;
}

bool Loop::poll_by_system_call() {
  looked_at_all_ = turn_began_ >= next_look_ || !held_.empty();  // by whichever the poses come
  if (!looked_at_all_) return false;
  turn_began_ = Clock::now();  // when these arrive; the work may have taken a slice
  int frames = 0;
  for (std::size_t i = 0; i < transports_.size(); ++i)
    if (transports_[i]->polls_by_system_call()) frames += poll_transport(i);
  // Where something arrived there may be more.
  next_look_ = frames > 0 ? Clock::time_point() : turn_began_ + kLookEvery;
  return frames > 0;
}

int Loop::poll_transport(std::size_t i) {
  try {
    const int taken = transports_[i]->poll(*this);
    *transport_frames_[i] += static_cast<std::uint64_t>(taken);
    return taken;
  } catch (const std::exception& error) {
    ++stats_["errors.transport"];
    if (const auto now = Clock::now(); now >= next_warning_) {
      next_warning_ = now + std::chrono::seconds(1);
      log::warn("event=poll_failed url={} error=\"{}\"", transports_[i]->url(), log_text(error.what()));
    }
    return 0;
  }
}

bool Loop::work_for_a_slice() {
  bool worked = !small_.empty();
  if (worked) small_.work(Clock::now(), [this](Worker::QueryPtr query) { settle(std::move(query)); });
  const auto work = [](Worker* worker) { return worker->work(); };
  if (const auto all = workers(); !options_.worker_thread && std::any_of(all.begin(), all.end(), work))
    worked = settle_what_was_worked_on() || true;
  if (worked) warn_of_contradictions();
  return worked;
}

bool Loop::settle_what_was_worked_on() {
  bool any = false;
  for (Worker* worker : workers()) {
    worker->expire(turn_began_);
    if (!worker->has_done()) continue;
    for (Worker::QueryPtr& query : worker->take()) settle(std::move(query));
    any = true;
  }
  return any;
}

/// Does what only the loop may; what is not over then is a worker's.
void Loop::settle(Worker::QueryPtr query) {
  if (query->settle()) return;
  Worker& worker = worker_of(query->service_class());
  worker.add(std::move(query));
}

void Loop::warn_of_contradictions() {
  if (engine_->contradictions() > 0 && !std::exchange(contradiction_logged_, true))
    log::error(
        "event=contradiction text=\"bounds of a pair contradicted each other, and it was answered anew: this machine, "
        "this build or a table of the scene is broken; clearance selftest may tell which; engine.contradictions "
        "counts\"");
}

void Loop::tick() {
  poses_changed_ = false;
  const auto now = Clock::now();
  if (now >= next_tick_) {
    next_tick_ = now + options_.tick;
    drop_gone();
    if (options_.on_tick) options_.on_tick();
  }
  for (const auto& transport : transports_) {
    try {
      transport->tick(*this);
    } catch (const std::exception& error) {
      ++stats_["errors.transport"];
      log::warn("event=tick_failed url={} error=\"{}\"", transport->url(), log_text(error.what()));
    }
  }
}

/// Lets go of requests whose clients are gone.
void Loop::drop_gone() {
  for (Worker* worker : workers()) worker->look();
  count_closed(plans_.drop_gone());
  if (const std::size_t queries = held_.drop_gone()) count_dropped(queries);
  stats_.dropped += scenes_.drop_gone();
}

void Loop::count_dropped(std::size_t queries) {
  stats_.dropped += queries;
  stats_["queries.dropped"] += queries;
}

void Loop::sleep() {
  // poll() and not epoll: descriptors come and go with clients, and one that was closed and is used again for another
  // would silently be missing from an epoll set. For tens of descriptors it takes no longer.
  std::vector<pollfd> fds{{wake_fd_.get(), POLLIN, 0}};
  for (const auto& transport : transports_)
    for (const int fd : transport->descriptors()) fds.push_back({fd, POLLIN, 0});

  std::size_t prepared = 0;
  bool work = false;
  while (prepared < transports_.size() && !work) work = transports_[prepared++]->prepare_sleep();
  if (!work && !stopping_) wait_for(fds);
  for (std::size_t i = 0; i < prepared; ++i) transports_[i]->finish_sleep();
}

/// Until one is readable, somebody calls wake(), or something is due. \param fds the one that wake() writes to, and
/// others.
void Loop::wait_for(std::span<pollfd> fds) {
  const auto until = std::min({next_tick_, held_.deadline(), control_worker_.deadline(), planning_worker_.deadline()});
  const auto left = std::max<std::chrono::nanoseconds>(until - Clock::now(), std::chrono::nanoseconds(0));
  timespec timeout{left.count() / 1'000'000'000, left.count() % 1'000'000'000};
  // A descriptor that stays readable though there is nothing to take is not listened to for a while.
  const bool nagged = ++wakes_for_nothing_ > kWakesForNothing;
  if (nagged) timeout = {0, std::min<long>(1'000'000, timeout.tv_sec ? 1'000'000 : timeout.tv_nsec)};
  ++stats_["loop.sleeps"];
  const int ready = ppoll(fds.data(), nagged ? 1 : fds.size(), &timeout, nullptr);
  if (ready == 0 && !nagged) wakes_for_nothing_ = 0;
  // Only now: who wakes the loop has said before what for, and the turn that follows sees it.
  std::uint64_t woken;
  [[maybe_unused]] const auto taken = read(wake_fd_.get(), &woken, sizeof woken);
}

}  // namespace clearance
