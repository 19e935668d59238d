#include "server/tasks/pair_listing.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "engine/narrow/work_meter.h"

namespace clearance {
namespace {

constexpr std::uint64_t kPairsAtOnce = 8192;  // copied

}  // namespace

std::optional<std::vector<std::byte>> PairListing::advance(std::chrono::nanoseconds budget, std::uint64_t& ignored) {
  const Clock::time_point end = Clock::now() + budget;
  if (!prepared_) prepared_ = engine_->begin_preparing(for_pairs(view_of(read(ignored), request_.scene_revision)));
  if (!prepared_->advance({.time = budget}) || !copy(end)) return std::nullopt;
  prepared_.reset();
  return std::move(reply_);
}

bool PairListing::copy(Clock::time_point end) {
  const std::uint64_t count = prepared_->size().pairs;
  if (reply_.empty()) {
    wire::PairsHeader table;
    table.scene_revision = request_.scene_revision ? request_.scene_revision : engine_->scene_revision();
    table.count = count;
    reply_.reserve(sizeof table + count * sizeof(BodyPair));
    wire::append(reply_, table);
  }
  while (copied_ < count) {
    const std::uint64_t some = std::min(kPairsAtOnce, count - copied_);
    const std::size_t at = reply_.size();
    reply_.resize(at + some * sizeof(BodyPair));
    prepared_->copy_pairs(copied_, some, reinterpret_cast<BodyPair*>(reply_.data() + at));
    copied_ += some;
    count_copied(some * sizeof(BodyPair));
    if (copied_ < count && Clock::now() >= end) return false;
  }
  return true;
}

}  // namespace clearance
