#include "server/core/heap_counters.h"

#include <malloc.h>

#include <cstdlib>

#include "engine/base/sanitizers.h"

namespace clearance {
namespace {

/// mallinfo2() visits each freed chunk with its heap locked: 1 to 4 ms for 60,000 of them. So the counters are for tests
/// of memory alone, which set this variable.
constexpr const char* kVariable = "CLEARANCE_HEAP_COUNTERS";
constexpr std::chrono::seconds kReadEvery{1};

std::optional<HeapCounters::Bytes> read_heaps() {
  static const bool wanted = std::getenv(kVariable) != nullptr;
  if (!wanted) return std::nullopt;
#if defined(__GLIBC__) && !defined(CLEARANCE_ASAN) && !defined(CLEARANCE_TSAN)
  const struct mallinfo2 info = mallinfo2();
  return HeapCounters::Bytes{info.uordblks + info.hblkhd, info.fordblks};
#else
  return std::nullopt;
#endif
}

}  // namespace

void HeapCounters::append_to(Stats::Named& counters) {
  const auto now = std::chrono::steady_clock::now();
  if (!read_at_ || now >= *read_at_ + kReadEvery) {
    read_at_ = now;
    bytes_ = read_heaps();
  }
  if (!bytes_) return;
  counters.emplace_back("heap.used_bytes", bytes_->used);
  counters.emplace_back("heap.kept_bytes", bytes_->kept);
}

}  // namespace clearance
