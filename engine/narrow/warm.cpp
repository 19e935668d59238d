#include "engine/narrow/warm.h"

#include <cassert>
#include <new>

namespace clearance {

std::unique_ptr<WarmTable> WarmStore::take(std::uint64_t client, std::uint64_t question, std::uint64_t size) {
  if (size == 0 || size > kMostSimplices) return nullptr;
  const std::uint64_t bytes = size * sizeof(WarmSimplex);
  std::vector<std::unique_ptr<WarmTable>> gone;  // freed outside the lock
  std::unique_ptr<WarmTable> table;
  {
    const std::lock_guard lock(mutex_);
    if (in_use_ + bytes > limit_) {
      ++without_room_;
      return nullptr;
    }
    table = tables_.take(client);
    if (table && table->simplices.size() != size) gone.push_back(std::move(table));
    while (in_use_ + bytes + kept_bytes() > limit_) {
      gone.push_back(tables_.take_oldest());
      if (!gone.back()) break;
    }
    in_use_ += bytes;
  }
  if (table && table->question == question) return table;
  try {
    if (!table) table = std::make_unique<WarmTable>();
    table->client = client;
    table->question = question;
    table->simplices.assign(size, WarmSimplex{});
  } catch (const std::bad_alloc&) {
    const std::lock_guard lock(mutex_);
    in_use_ -= bytes;
    ++without_room_;
    return nullptr;
  }
  return table;
}

void WarmStore::put_back(std::unique_ptr<WarmTable> table) {
  const std::lock_guard lock(mutex_);
  assert(in_use_ >= table->bytes());
  in_use_ -= table->bytes();
  tables_.put_back(std::move(table));
}

std::unique_ptr<WarmTable> WarmStore::trim(std::uint64_t client, std::uint64_t room) {
  const std::lock_guard lock(mutex_);
  std::unique_ptr<WarmTable> table = tables_.take(client);
  if (table && table->bytes() <= room) tables_.put_back(std::move(table));
  return table;
}

std::uint64_t WarmStore::bytes() const {
  const std::lock_guard lock(mutex_);
  return in_use_ + kept_bytes();
}

std::uint64_t WarmStore::without_room() const {
  const std::lock_guard lock(mutex_);
  return without_room_;
}

std::uint64_t WarmStore::kept_bytes() const {
  std::uint64_t sum = 0;
  tables_.for_each([&](const WarmTable& t) { sum += t.bytes(); });
  return sum;
}

}  // namespace clearance
