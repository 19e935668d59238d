#include "server/lcm/lcm_outbox.h"

#include <utility>

namespace clearance {

bool LcmOutbox::push(std::uint64_t parts, std::uint64_t bytes, SendPart send) {
  if (bytes_ + bytes > kMaxBytes) return false;
  items_.push_back({parts, 0, bytes, std::move(send)});
  bytes_ += bytes;
  return true;
}

void LcmOutbox::flush(Clock::time_point now) {
  while (!items_.empty()) {
    if (!pacer_.ready(now)) {
      due_ = now + pacer_.pause();
      return;
    }
    Item& item = items_.front();
    const std::size_t bytes = item.send(item.next);
    pacer_.sent(bytes);
    ++(bytes > 0 ? sent_ : failed_);
    if (++item.next < item.parts) {
      items_.splice(items_.end(), items_, items_.begin());
    } else {
      bytes_ -= item.bytes;
      items_.pop_front();
    }
  }
}

std::optional<LcmOutbox::Clock::time_point> LcmOutbox::due() const {
  if (items_.empty()) return std::nullopt;
  return due_;
}

}  // namespace clearance
