#include "warm.h"

namespace clearance {

std::unique_ptr<WarmTable> WarmStore::take(std::uint64_t client, std::uint64_t question, std::uint64_t size) {
  if (size == 0 || size > kMostSimplices) return nullptr;
  std::unique_ptr<WarmTable> table = tables_.take(client);
  if (!table) table = std::make_unique<WarmTable>();
  table->client = client;
  if (table->question != question || table->simplices.size() != size) table->simplices.assign(size, WarmSimplex{});
  table->question = question;
  return table;
}

std::uint64_t WarmStore::bytes() const {
  std::uint64_t sum = 0;
  tables_.for_each([&](const WarmTable& t) { sum += t.simplices.capacity() * sizeof(WarmSimplex); });
  return sum;
}

}  // namespace clearance
