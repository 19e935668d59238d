#include "engine/cover/cover_store.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "engine/base/digest.h"
#include "engine/cover/cover_record.h"

namespace clearance {

namespace {

std::uint64_t hash_of_body(std::span<const ConvexPartPtr> parts) {
  Digest digest;
  for (const ConvexPartPtr& part : parts) digest.add(part->digest);
  return digest.value();
}

}  // namespace

class CoverStore::Entry final : public BackgroundTask {
 public:
  Entry(Parts parts, CoverStore& store, const Cache& cache) : parts_(std::move(parts)), store_(store), cache_(cache) {}
  ~Entry() override {
    if (!is_done_) return;
    --(cover_ ? store_.made_ : store_.impossible_);
    store_.bytes_ -= cover_ ? cover_->resident_bytes() : 0;
  }

  bool is_of(std::span<const ConvexPartPtr> parts) const { return same_parts(parts, parts_); }
  std::shared_ptr<const Cover> cover() const { return is_done_.load(std::memory_order_acquire) ? cover_ : nullptr; }
  TaskOwners owners;

  Result read() const override { return kept(read_cover(cache_, cover_name(parts_))); }
  Result make(const std::atomic<bool>& stopped) const override {
    return kept(make_timed_cover(cache_, cover_name(parts_), parts_, &stopped));
  }
  void take(Result result, std::chrono::nanoseconds took) override {
    auto cover = std::static_pointer_cast<const Cover>(result);
    const std::uint64_t more = cover ? cover->resident_bytes() : 0;
    store_.spent_ = store_.spent_.load() + took;
    if (cover && store_.bytes_ + more <= store_.most_bytes_) {
      cover_ = std::move(cover);
      store_.bytes_ += more;
      ++store_.made_;
    } else {
      ++store_.impossible_;
    }
    is_done_.store(true, std::memory_order_release);
    if (cover_) store_.arrived_.fetch_add(1, std::memory_order_release);
  }

 private:
  static Result kept(std::optional<TimedCover> made) {
    return made ? std::make_shared<const Cover>(std::move(made->cover)) : nullptr;
  }

  const Parts parts_;
  CoverStore& store_;
  const Cache& cache_;
  std::shared_ptr<const Cover> cover_;  // null if impossible
  std::atomic<bool> is_done_{false};    // set after `cover_`
};

CoverStore::Entry* CoverStore::find_entry(std::uint64_t hash, std::span<const ConvexPartPtr> parts) const {
  const auto [begin, end] = entries_.equal_range(hash);
  const auto it = std::find_if(begin, end, [&](const auto& entry) { return entry.second->is_of(parts); });
  return it == end ? nullptr : it->second.get();
}

std::shared_ptr<const Cover> CoverStore::find(std::span<const ConvexPartPtr> parts) const {
  const std::uint64_t hash = hash_of_body(parts);
  const std::lock_guard lock(mutex_);
  const Entry* const entry = find_entry(hash, parts);
  return entry ? entry->cover() : nullptr;
}

void CoverStore::request(std::vector<Parts> bodies, const TaskOwner& owner, bool in_cache) {
  const std::lock_guard requests(requests_);
  std::vector<std::shared_ptr<BackgroundTask>> tasks;
  std::unique_lock lock(mutex_);
  std::erase_if(entries_, [](const auto& entry) { return entry.second->owners.are_gone(); });
  for (Parts& parts : bodies) {
    if (!may_have_cover(parts)) continue;
    const std::uint64_t hash = hash_of_body(parts);
    if (Entry* const known = find_entry(hash, parts)) {
      known->owners.add(owner);
      continue;
    }
    const auto entry = std::make_shared<Entry>(std::move(parts), *this, in_cache ? cache_ : no_cache_);
    entry->owners.add(owner);
    entries_.emplace(hash, entry);
    tasks.push_back(entry);
  }
  lock.unlock();
  worker_.add(tasks);
}

CoverStore::Progress CoverStore::progress() const {
  return {made_, worker_.pending(), impossible_, bytes_, std::chrono::duration<double>(spent_.load()).count()};
}

}  // namespace clearance
