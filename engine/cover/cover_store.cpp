#include "engine/cover/cover_store.h"

#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

#include "engine/base/digest.h"
#include "engine/cache/cache.h"
#include "engine/cover/cover_record.h"

namespace clearance {

namespace {

using std::chrono::steady_clock;

/// Time without new covers after the thread has started, so that short programs and first answers are not disturbed.
constexpr std::chrono::milliseconds kGrace{100};

std::uint64_t hash_of_body(std::span<const ConvexPartPtr> parts) {
  Digest digest;
  for (const ConvexPartPtr& part : parts) digest.add(part->digest);
  return digest.value();
}

/// Gives the calling thread the lowest priority, and leaves signals to other threads. Not SCHED_IDLE: on a machine whose
/// planners take all cores, covers would never be made.
void run_last() {
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), 19);
}

}  // namespace

struct CoverStore::State {
  /// A body in the table, from which none is removed.
  struct Entry {
    Parts parts;
    std::uint64_t hash = 0;
    Entry* next = nullptr;               ///< in the bucket
    std::atomic<bool> is_done{false};    ///< set after `cover`
    std::shared_ptr<const Cover> cover;  ///< null if impossible
    int makers = 0;                      ///< threads at work on it
  };
  /// The stores of this process, whose threads have to end before the libraries that they use do.
  struct Stores {
    std::mutex mutex;
    std::vector<State*> all;
  };

  explicit State(std::uint64_t most);
  ~State();
  static Stores& stores();
  static void stop_all();

  const Entry* find(std::span<const ConvexPartPtr> parts, std::uint64_t hash) const;
  void add(Parts parts);
  void start();
  void stop();
  void work();
  Entry* next(int most_makers) const;
  void make(Entry& entry, std::unique_lock<std::mutex>& lock, bool in_background);
  void finish(Entry& entry, std::optional<TimedCover> made, std::chrono::nanoseconds took);

  const std::uint64_t most_bytes;
  const Cache cache = Cache::of_environment();
  std::array<std::atomic<Entry*>, 1024> buckets{};
  std::atomic<std::uint64_t> made_count{0}, pending_count{0}, impossible_count{0}, bytes{0};
  std::atomic<std::chrono::nanoseconds> spent{};

  std::mutex mutex;  // guards all below, and additions to the table
  std::condition_variable changed;
  std::deque<Entry*> pending;
  std::thread thread;
  bool is_running = false;
  std::atomic<bool> is_stopping{false};
  steady_clock::time_point begin;
};

CoverStore::State::Stores& CoverStore::State::stores() {
  static Stores* const of_process = [] {
    Sha256().digest();  // libcrypto's cleanup is registered before stop_all(), and so runs after it
    std::atexit(stop_all);
    pthread_atfork([] { stores().mutex.lock(); }, [] { stores().mutex.unlock(); },
                   [] { stores().all.clear(), stores().mutex.unlock(); });
    return new Stores;
  }();
  return *of_process;
}

void CoverStore::State::stop_all() {
  const std::lock_guard lock(stores().mutex);
  for (State* store : stores().all) store->stop();
}

CoverStore::State::State(std::uint64_t most) : most_bytes(most) {
  const std::lock_guard lock(stores().mutex);
  stores().all.push_back(this);
}

CoverStore::State::~State() {
  {
    const std::lock_guard lock(stores().mutex);
    std::erase(stores().all, this);
  }
  stop();
  for (std::atomic<Entry*>& bucket : buckets)
    for (Entry* entry = bucket; entry;) delete std::exchange(entry, entry->next);
}

const CoverStore::State::Entry* CoverStore::State::find(std::span<const ConvexPartPtr> parts,
                                                        std::uint64_t hash) const {
  const Entry* entry = buckets[hash % buckets.size()].load(std::memory_order_acquire);
  while (entry && (entry->hash != hash || !same_parts(parts, entry->parts))) entry = entry->next;
  return entry;
}

void CoverStore::State::add(Parts parts) {
  const std::uint64_t hash = hash_of_body(parts);
  if (!may_have_cover(parts) || find(parts, hash)) return;
  std::atomic<Entry*>& bucket = buckets[hash % buckets.size()];
  auto* const entry = new Entry;
  entry->parts = std::move(parts);
  entry->hash = hash;
  entry->next = bucket.load(std::memory_order_relaxed);
  pending.push_back(entry);
  bucket.store(entry, std::memory_order_release);
  pending_count = pending.size();
}

/// Starts the thread unless it runs. Without one, wait() makes the covers.
void CoverStore::State::start() {
  if (is_running || is_stopping || pending.empty()) return;
  if (thread.joinable()) thread.join();
  begin = steady_clock::now();
  try {
    thread = std::thread([this] { work(); });
    is_running = true;
  } catch (const std::system_error&) {
  }
}

void CoverStore::State::stop() {
  {
    const std::lock_guard lock(mutex);
    is_stopping = true;
  }
  changed.notify_all();
  if (thread.joinable()) thread.join();
}

void CoverStore::State::work() {
  run_last();
  std::unique_lock lock(mutex);
  while (Entry* entry = is_stopping ? nullptr : next(0)) make(*entry, lock, true);
  is_running = false;
}

/// The first pending body on which at most so many threads work, or null.
CoverStore::State::Entry* CoverStore::State::next(int most_makers) const {
  for (int makers = 0; makers <= most_makers; ++makers)
    for (Entry* entry : pending)
      if (entry->makers == makers) return entry;
  return nullptr;
}

void CoverStore::State::make(Entry& entry, std::unique_lock<std::mutex>& lock, bool in_background) {
  ++entry.makers;
  lock.unlock();
  const steady_clock::time_point before = steady_clock::now();
  std::optional<TimedCover> made;
  try {
    const std::string name = cover_name(entry.parts);
    made = read_cover(cache, name);
    if (!made && in_background) {
      lock.lock();
      changed.wait_until(lock, begin + kGrace, [&] { return is_stopping || entry.is_done; });
      lock.unlock();
    }
    if (!made && !is_stopping && !entry.is_done) made = make_timed_cover(cache, name, entry.parts, &is_stopping);
  } catch (const std::exception&) {  // no memory
  }
  lock.lock();
  --entry.makers;
  if (!entry.is_done && (made || !is_stopping)) finish(entry, std::move(made), steady_clock::now() - before);
}

void CoverStore::State::finish(Entry& entry, std::optional<TimedCover> made, std::chrono::nanoseconds took) {
  spent = spent.load() + took;
  const std::uint64_t more = made ? made->cover.resident_bytes() : 0;
  const bool is_kept = made && bytes + more <= most_bytes;
  if (is_kept) {
    entry.cover = std::make_shared<const Cover>(std::move(made->cover));
    bytes += more;
  } else {
    ++impossible_count;
  }
  entry.is_done.store(true, std::memory_order_release);
  if (is_kept) made_count.fetch_add(1, std::memory_order_release);
  std::erase(pending, &entry);
  pending_count = pending.size();
  changed.notify_all();
}

CoverStore::CoverStore(std::uint64_t most_bytes) : state_(std::make_unique<State>(most_bytes)), process_(getpid()) {}

CoverStore::~CoverStore() {
  if (getpid() != process_) static_cast<void>(state_.release());  // a lock or the condition may be in use for ever
}

std::shared_ptr<const Cover> CoverStore::find(std::span<const ConvexPartPtr> parts) const {
  const State::Entry* const entry = state_->find(parts, hash_of_body(parts));
  return entry && entry->is_done.load(std::memory_order_acquire) ? entry->cover : nullptr;
}

void CoverStore::request(std::vector<Parts> bodies) {
  const std::lock_guard lock(state_->mutex);
  for (Parts& parts : bodies) state_->add(std::move(parts));
  state_->start();
}

bool CoverStore::wait(std::chrono::nanoseconds timeout) {
  const steady_clock::time_point begin = steady_clock::now();
  const steady_clock::time_point until =
      timeout < steady_clock::time_point::max() - begin ? begin + timeout : steady_clock::time_point::max();
  std::unique_lock lock(state_->mutex);
  while (!state_->pending.empty() && steady_clock::now() < until) {
    if (State::Entry* entry = state_->next(1))
      state_->make(*entry, lock, false);
    else
      state_->changed.wait_until(lock, until);
  }
  return state_->pending.empty();
}

CoverStore::Progress CoverStore::progress() const {
  return {state_->made_count, state_->pending_count, state_->impossible_count, state_->bytes,
          std::chrono::duration<double>(state_->spent.load()).count()};
}

std::uint64_t CoverStore::revision() const {
  return state_->made_count.load(std::memory_order_acquire);
}

}  // namespace clearance
