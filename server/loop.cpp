#include "loop.h"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "log_text.h"
#include "loop_task.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

/// First slices given out before one of the long queries gets its turn.
constexpr int kFreshBeforeLong = 4;
/// Wake-ups that brought nothing, after which a descriptor that stays readable (a listener without descriptors left,
/// say) may no longer keep the loop from sleeping.
constexpr int kWakesForNothing = 100;
/// Queries that are answered as one batch with the one whose turn it is.
constexpr std::size_t kMostJoined = 63;
/// Clients whose counts of queries under way are kept at a tick though they are 0: one that asks again and again
/// allocates nothing.
constexpr std::size_t kIdleClientsKept = 256;
/// How often a loop that is kept awake looks at transports that are polled by system calls: so late may a request or a
/// pose be seen there, while the look, of a microsecond or two, delays requests in memory that seldom.
constexpr auto kLookEvery = std::chrono::microseconds(50);
/// A transport that is polled in memory is in use for so long after its last frame.
constexpr auto kInUse = std::chrono::milliseconds(100);

/// A device's reply from this size on is worth memory that the device writes to itself: some ten microseconds of
/// copying.
constexpr std::uint64_t kWorthPinning = 64 << 10;

std::string scheme_of(const std::string& url) {
  return url.substr(0, url.find(':'));
}

/// Moves columns that have room for `from_rows` rows to where they lie with `to_rows` (fewer) rows.
void close_up_columns(std::byte* columns, std::uint32_t fields, std::uint64_t from_rows, std::uint64_t to_rows) {
  // Each column moves towards the front, the first ones first: nothing is overwritten before it has moved.
  for (int f = 0; f < kFieldCount; ++f) {
    const Field field = Field(1u << f);
    if (!(fields & field)) continue;
    std::memmove(columns + wire::column_offset(to_rows, fields, field),
                 columns + wire::column_offset(from_rows, fields, field), to_rows * kFieldBytes[f]);
  }
}

/// Zeroes what lies between the columns: whatever was in that memory is nobody's business.
void clear_gaps(std::byte* columns, std::uint32_t fields, std::uint64_t rows) {
  std::byte* column = columns;
  for (int f = 0; f < kFieldCount; ++f) {
    if (!(fields >> f & 1)) continue;
    std::byte* end = column + rows * kFieldBytes[f];
    column += wire::columns_bytes(rows, 1u << f);
    std::memset(end, 0, static_cast<std::size_t>(column - end));
  }
}

}  // namespace

bool Loop::DueFirst::operator()(const TaskPtr& a, const TaskPtr& b) const {
  return a->due < b->due;
}

Loop::Loop(Engine& engine, const Options& options)
    : Loop(std::shared_ptr<Engine>(std::shared_ptr<Engine>(), &engine), options) {}

Loop::Loop(std::shared_ptr<Engine> engine, const Options& options)
    : engine_(std::move(engine)), options_(options), started_(Clock::now()), next_tick_(started_) {
  for (int i = 0; i < kLatencyBuckets; ++i)
    latency_[i] = &counter("latency_us." + (i + 1 < kLatencyBuckets ? std::to_string(1u << i) : "more"));
  joined_.reserve(kMostJoined + 1);
  batch_.reserve(kMostJoined + 1);
  wake_fd_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_fd_ < 0) throw std::runtime_error(std::string("eventfd: ") + std::strerror(errno));
}

Loop::~Loop() {
  close(wake_fd_);
}

void Loop::add(std::unique_ptr<Transport> transport) {
  transport_frames_.push_back(&counter(scheme_of(transport->url()) + ".frames"));
  transports_.push_back(std::move(transport));
}

void Loop::stop() noexcept {
  stopping_ = true;
  wake();
}

void Loop::wake() noexcept {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_fd_, &one, sizeof one);
}

void Loop::reload_by(Reloader::Make make, Reloader::Build build) {
  reloader_ = std::make_unique<Reloader>(std::move(make), std::move(build), [this] { wake(); });
}

void Loop::reload() noexcept {
  if (!reloader_) return;
  reloader_->ask();
  wake();
}

void Loop::run() {
  while (!stopping_) {
    if (turn()) continue;
    if (spin_pays()) {
      const auto end = Clock::now() + options_.spin;
      bool paid = false;
      while (!paid && !stopping_ && turn_began_ < end) paid = turn();
      paid ? spins_.paid() : spins_.missed();
      if (paid) continue;
    }
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

bool Loop::turn() {
  turn_began_ = Clock::now();
  if (reloader_) take_new_engine();
  if (figures_wanted_.load(std::memory_order_relaxed)) hand_out_figures();
  bool worked = poll_in_memory();
  if (!held_.empty()) worked |= look_at_held();
  if (poses_changed_ || turn_began_ >= next_tick_) tick();
  worked |= work_for_a_slice();
  worked |= poll_by_system_call();  // after the work, so that no request in memory waits for it
  if (worked) wakes_for_nothing_ = 0;
  return worked;
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
    ++counter("errors.transport");
    if (const auto now = Clock::now(); now >= next_warning_) {
      next_warning_ = now + std::chrono::seconds(1);
      spdlog::warn("event=poll_failed url={} error=\"{}\"", transports_[i]->url(), log_text(error.what()));
    }
    return 0;
  }
}

void Loop::tick() {
  poses_changed_ = false;
  const auto now = Clock::now();
  if (now >= next_tick_) {
    next_tick_ = now + options_.tick;
    const auto gone = [](const TaskPtr& task) { return !task->sink->alive(); };
    const auto drop = [this](const TaskPtr& task) { forget(*task), ++dropped_, ++counter("queries.dropped"); };
    fresh_.remove_if(gone, drop);
    long_.remove_if(gone, drop);
    drop_held_of_the_gone();
    std::erase_if(scene_waiters_, [this](const SceneWaiter& waiter) {
      if (waiter.sink->alive() || waiter.removes) return false;  // a removal is looked at once more: why_not()
      leave(waiter.sink->client());
      ++dropped_;
      return true;
    });
    if (waiting_per_client_.size() > kIdleClientsKept)
      std::erase_if(waiting_per_client_, [](const auto& client) { return client.second.requests == 0; });
  }
  for (const auto& transport : transports_) {
    try {
      transport->tick(*this);
    } catch (const std::exception& error) {
      ++counter("errors.transport");
      spdlog::warn("event=tick_failed url={} error=\"{}\"", transport->url(), log_text(error.what()));
    }
  }
}

void Loop::sleep() {
  // poll() and not epoll: descriptors come and go with clients, and one that was closed and is used again for another
  // would silently be missing from an epoll set. For tens of descriptors it takes no longer.
  std::vector<pollfd> fds{{wake_fd_, POLLIN, 0}};
  for (const auto& transport : transports_)
    for (const int fd : transport->descriptors()) fds.push_back({fd, POLLIN, 0});

  std::size_t prepared = 0;
  bool work = false;
  while (prepared < transports_.size() && !work) work = transports_[prepared++]->prepare_sleep();
  if (!work && !stopping_) {
    const auto until = held_.empty() ? next_tick_ : std::min(next_tick_, held_deadline_);
    const auto left = std::max<std::chrono::nanoseconds>(until - Clock::now(), std::chrono::nanoseconds(0));
    timespec timeout{left.count() / 1'000'000'000, left.count() % 1'000'000'000};
    // A descriptor that stays readable though there is nothing to take is not listened to for a while.
    const bool nagged = ++wakes_for_nothing_ > kWakesForNothing;
    if (nagged) timeout = {0, std::min<long>(1'000'000, timeout.tv_sec ? 1'000'000 : timeout.tv_nsec)};
    ++counter("loop.sleeps");
    const int ready = ppoll(fds.data(), nagged ? 1 : fds.size(), &timeout, nullptr);
    if (ready == 0 && !nagged) wakes_for_nothing_ = 0;
    // Only now: who wakes the loop has said before what for, and the turn that follows sees it.
    std::uint64_t woken;
    [[maybe_unused]] const auto taken = read(wake_fd_, &woken, sizeof woken);
  }
  for (std::size_t i = 0; i < prepared; ++i) transports_[i]->finish_sleep();
}

// --- slices
// -----------------------------------------------------------------------------------------------------------

Loop::TaskPtr Loop::next_task() {
  const bool take_long = fresh_.empty() || (!long_.empty() && fresh_in_a_row_ >= kFreshBeforeLong);
  fresh_in_a_row_ = take_long ? 0 : fresh_in_a_row_ + 1;
  return take_long ? long_.pop() : fresh_.pop();
}

bool Loop::work_for_a_slice() {
  if (!waiting()) return false;
  const auto begin = Clock::now();
  auto now = begin;
  do {
    TaskPtr task = next_task();
    if (!task->sink->alive()) {
      forget(*task);
      ++dropped_;
      ++counter("queries.dropped");
      continue;
    }
    if (!task->begun) gather(*task);
    if (joined_.empty())
      take_slice(std::move(task), now);
    else
      answer_together(std::move(task), now);
  } while (waiting() && now - begin < options_.slice);
  return true;
}

void Loop::take_slice(TaskPtr task, Clock::time_point& now) {
  task->begun = true;
  bool done = false, failed = true;
  guarded(*task->sink, task->request, [&] {
    done = task->job.advance(options_.slice);
    failed = false;
  });
  const auto after = Clock::now();
  task->in_engine += after - now;
  now = after;
  if (done) guarded(*task->sink, task->request, [&] { finish(*task, now); });
  if (done || failed) {
    forget(*task);
  } else {
    const std::uint64_t client = task->sink->client();
    long_.push(client, std::move(task));
  }
}

/// Takes, out of what waits for its first slice, small queries that the engine can answer together with this one.
void Loop::gather(const Task& first) {
  if (fresh_.empty()) return;
  const auto pairs_of = [](const Task& task) { return task.job.size().configurations * task.job.size().pairs; };
  std::uint64_t pairs = pairs_of(first);
  if (pairs >= options_.batch_pairs) return;
  try {
    fresh_.take_each([&](TaskPtr& task) {
      const std::uint64_t more = pairs_of(*task);
      if (more > options_.batch_pairs - pairs || joined_.size() == kMostJoined || !task->sink->alive() ||
          !task->job.joins(first.job))
        return false;
      pairs += more;
      joined_.push_back(std::move(task));
      return true;
    });
  } catch (const std::bad_alloc&) {
    // Before any was taken: each is answered by itself.
  }
}

void Loop::answer_together(TaskPtr first, Clock::time_point& now) {
  joined_.insert(joined_.begin(), std::move(first));
  batch_.clear();
  for (const TaskPtr& task : joined_) batch_.push_back(&task->job);
  bool done = false;
  try {
    Job::finish_together(batch_);
    done = true;
  } catch (const std::exception& error) {
    spdlog::warn("event=batch_failed queries={} error=\"{}\"", joined_.size(), log_text(error.what()));
  }
  if (done) {
    const auto after = Clock::now();
    queries_joined_ += joined_.size();
    for (const TaskPtr& task : joined_) {
      task->in_engine += after - now;
      guarded(*task->sink, task->request, [&] { finish(*task, after); });
      forget(*task);
    }
    now = after;
  } else {  // whatever it was, it is the trouble of one of them
    for (TaskPtr& task : joined_) take_slice(std::move(task), now);
  }
  joined_.clear();
}

void Loop::forget(const Task& task) {
  waiting_bytes_ -= task.held_bytes;
  leave(task.sink->client(), task.held_bytes);
}

void Loop::leave(std::uint64_t client, std::uint64_t held_bytes) {
  Usage& usage = waiting_per_client_.find(client)->second;
  --usage.requests;
  usage.bytes -= held_bytes;
}

void Loop::finish(Task& task, Clock::time_point now) {
  if (engine_->contradictions() > 0 && !std::exchange(contradiction_logged_, true))
    spdlog::error(
        "event=contradiction text=\"bounds of a pair contradicted each other, and it was answered anew: this machine, "
        "this "
        "build or a table of the scene is broken; clearance selftest may tell which; engine.contradictions counts\"");
  const QuerySize& size = task.job.size();
  const ReplyInfo& info = task.job.info();
  std::byte* frame = task.frame;
  if (info.rows < size.rows) close_up_columns(frame + kColumnsBegin, size.fields, size.rows, info.rows);
  clear_gaps(frame + kColumnsBegin, size.fields, info.rows);
  const std::uint64_t columns_end = kColumnsBegin + wire::columns_bytes(info.rows, size.fields);
  const std::uint64_t bytes = columns_end + task.records.size();
  check_reply_size(info.rows, bytes, task.max_reply_bytes);
  if (task.own) {
    frame = task.sink->reserve(bytes);
    if (!frame)
      throw Refusal{ErrorCode::kTooLarge,
                    "the reply of " + std::to_string(info.rows) + " rows needs " + std::to_string(bytes) +
                        " bytes, more than this client has room for",
                    bytes};
    std::memcpy(frame + kColumnsBegin, task.own.get() + kColumnsBegin, columns_end - kColumnsBegin);
  }
  if (!task.records.empty()) std::memcpy(frame + columns_end, task.records.data(), task.records.size());

  wire::ReplyHeader reply;
  reply.rows = info.rows;
  reply.total = info.total;
  reply.configurations = size.configurations;
  reply.pairs = size.pairs;
  reply.fields = size.fields;
  reply.reduce = static_cast<std::uint8_t>(task.reduce);
  reply.format = static_cast<std::uint8_t>(task.format);
  reply.scene_revision = info.scene_revision;
  reply.snapshot_revision = info.snapshot_revision;
  reply.snapshot_stamp_ns = info.snapshot_stamp_ns;
  reply.oldest_receipt_ns = info.oldest_receipt_ns;
  reply.snapshot_sequence = info.snapshot_sequence;
  reply.pose_age_ns = info.pose_age_ns;
  reply.pairs_evaluated = info.pairs_evaluated;
  wire::set_name(reply.backend, info.backend);
  reply.engine_ns = static_cast<std::uint64_t>(task.in_engine.count());
  const auto header = wire::with_records(
      wire::make_reply_header(task.request, FrameType::kReply, columns_end - sizeof(FrameHeader), info.scene_revision),
      task.records.size());
  std::memcpy(frame, &header, sizeof header);
  reply.server_ns = static_cast<std::uint64_t>(std::chrono::nanoseconds(now - task.received).count());
  std::memcpy(frame + sizeof header, &reply, sizeof reply);
  if (bytes >= kWorthPinning && info.backend == "cuda") task.sink->written_by_device();
  task.sink->publish(bytes);
  ++replies_;
  ++answered_;
  const std::uint64_t us = (reply.server_ns + 999) / 1000;
  ++*latency_[std::min<int>(std::bit_width(us > 0 ? us - 1 : 0), kLatencyBuckets - 1)];
  rows_ += info.rows;
}

}  // namespace clearance
