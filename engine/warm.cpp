#include "warm.h"

#include <algorithm>
#include <utility>

namespace clearance {

std::unique_ptr<WarmTable> WarmStore::take(std::uint64_t client, std::uint64_t question, std::uint64_t size) {
  if (size == 0 || size > kMostSimplices) return nullptr;
  std::unique_ptr<WarmTable> table;
  {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(tables_.begin(), tables_.end(), [&](const auto& t) { return t->client == client; });
    if (found != tables_.end()) {
      table = std::move(*found);
      tables_.erase(found);
    }
  }
  if (!table) table = std::make_unique<WarmTable>();
  table->client = client;
  if (table->question != question || table->simplices.size() != size) table->simplices.assign(size, WarmSimplex{});
  table->question = question;
  return table;
}

void WarmStore::put_back(std::unique_ptr<WarmTable> table) {
  const std::lock_guard lock(mutex_);
  std::erase_if(tables_, [&](const auto& t) { return t->client == table->client; });
  if (tables_.size() >= kClients) tables_.erase(tables_.begin());
  tables_.push_back(std::move(table));
}

std::uint64_t WarmStore::bytes() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t sum = 0;
  for (const auto& t : tables_) sum += t->simplices.capacity() * sizeof(WarmSimplex);
  return sum;
}

}  // namespace clearance
