#include "server/tasks/background_request.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "engine/narrow/work_meter.h"

namespace clearance {
namespace {

constexpr std::uint64_t kBytesAtOnce = 256 << 10;

}  // namespace

bool BackgroundRequest::advance(std::chrono::nanoseconds budget, Clock::time_point& now) {
  if (step_ == Step::kMake) {
    bool is_made = true;
    failure_ = ReplyWriter::rejection_of(pending_.header, [&] {
      std::optional<std::vector<std::byte>> made = make_(budget, ignored_);
      is_made = made.has_value();
      if (is_made) payload_ = std::move(*made);
    });
    if (!is_made) {
      now = Clock::now();
      return false;
    }
    payload_bytes_ = payload_.size();
    step_ = Step::kReserve;
  } else if (step_ == Step::kCopy) {
    if (!copy(now + budget)) {
      now = Clock::now();
      return false;
    }
    step_ = Step::kPublish;
  }
  if (failure_ || step_ != Step::kReserve) free_memory();
  now = Clock::now();
  return true;
}

bool BackgroundRequest::copy(Clock::time_point end) {
  while (copied_ < payload_.size()) {
    const std::uint64_t some = std::min(kBytesAtOnce, payload_.size() - copied_);
    std::memcpy(frame_ + sizeof(wire::FrameHeader) + copied_, payload_.data() + copied_, some);
    copied_ += some;
    count_copied(some);
    if (copied_ < payload_.size() && Clock::now() >= end) return false;
  }
  return true;
}

void BackgroundRequest::free_memory() {
  make_ = nullptr;
  payload_ = {};
}

void BackgroundRequest::check_client() {
  // Poses are applied even if their client is gone.
  gone_.store(type_ != wire::FrameType::kPosesDone && !pending_.sink->alive(), std::memory_order_relaxed);
}

bool BackgroundRequest::advance_on_loop() {
  if (step_ == Step::kOver) return true;
  if (step_ == Step::kReserve) {
    if (done_ && !done_(!failure_)) {
      step_ = Step::kMake;
      ignored_ = 0;
      return false;
    }
    answers_.count_ignored(ignored_);
  }
  if (failure_) {
    answers_.reject(*pending_.sink, pending_.header, *failure_);
    return true;
  }
  if (!pending_.sink->alive()) {
    answers_.count_dropped();
    step_ = Step::kOver;
    return false;
  }
  const bool went_well = answers_.guard(*pending_.sink, pending_.header, [&] {
    if (weight_ == Weight::kLight)
      answers_.reply(*pending_.sink, pending_.header, type_, payload_);
    else if (step_ == Step::kPublish)
      answers_.publish(*pending_.sink, pending_.header, type_, frame_, payload_bytes_);
    else
      frame_ = answers_.reserve(*pending_.sink, payload_bytes_);
  });
  if (step_ == Step::kPublish || weight_ == Weight::kLight) return true;
  step_ = went_well ? Step::kCopy : Step::kOver;
  return false;
}

}  // namespace clearance
