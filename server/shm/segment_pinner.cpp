#include "server/shm/segment_pinner.h"

#include <sys/mman.h>

#include <algorithm>
#include <cassert>
#include <exception>

#include "engine/device/device.h"
#include "server/base/log.h"
#include "server/base/log_text.h"

namespace clearance {

Mapping::~Mapping() {
  ::munmap(begin_, bytes_);
}

std::shared_ptr<void> SegmentPinner::pin_for_device(std::byte* begin, std::size_t bytes) {
  return std::make_shared<cuda::RegisteredMemory>(begin, bytes);
}

SegmentPinner::~SegmentPinner() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

SegmentPinner::Ticket* SegmentPinner::pin(std::shared_ptr<Mapping> mapping) noexcept {
  const std::lock_guard lock(mutex_);
  try {
    if (!thread_.joinable()) thread_ = std::thread([this] { work(); });
    tickets_.push_back({std::move(mapping), nullptr});
  } catch (const std::exception&) {
    ++rejections_;
    return nullptr;
  }
  wake_.notify_one();
  return &tickets_.back();
}

void SegmentPinner::let_go(Ticket* ticket) noexcept {
  const std::lock_guard lock(mutex_);
  assert(!ticket->done);
  ticket->done = true;
  wake_.notify_one();
}

void SegmentPinner::work() {
  const auto is_due = [](const Ticket& ticket) { return ticket.waits || ticket.done; };
  std::unique_lock lock(mutex_);
  while (true) {
    const auto due = std::find_if(tickets_.begin(), tickets_.end(), is_due);
    if (due == tickets_.end()) {
      if (ending_) return;
      wake_.wait(lock);
    } else if (due->done) {
      std::list<Ticket> last;
      last.splice(last.end(), tickets_, due);
      lock.unlock();
      if (last.front().pinned) bytes_ -= last.front().mapping->bytes();
      last.front().pinned.reset();
      last.clear();
      lock.lock();
    } else {
      due->waits = false;
      lock.unlock();
      std::shared_ptr<void> pinned = try_to_pin(*due->mapping);
      lock.lock();
      due->pinned = std::move(pinned);
    }
  }
}

std::shared_ptr<void> SegmentPinner::try_to_pin(const Mapping& mapping) {
  if (mapping.bytes() > budget_ - bytes_) {
    ++rejections_;
    return nullptr;
  }
  try {
    std::shared_ptr<void> pinned = pin_(mapping.begin(), mapping.bytes());
    bytes_ += mapping.bytes();
    return pinned;
  } catch (const std::exception& error) {
    if (rejections_++ == 0)
      log::warn("event=pinning_failed bytes={} error=\"{}\"", mapping.bytes(), log_text(error.what()));
    return nullptr;
  }
}

}  // namespace clearance
