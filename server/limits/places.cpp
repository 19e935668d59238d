#include "server/limits/places.h"

#include <cassert>

namespace clearance {
namespace {

void drop_one(std::unordered_map<std::uint64_t, std::uint64_t>& counts, std::uint64_t of) {
  const auto found = counts.find(of);
  if (found != counts.end() && --found->second == 0) counts.erase(found);
}

}  // namespace

std::uint64_t Places::count(const std::unordered_map<std::uint64_t, std::uint64_t>& counts, std::uint64_t of) {
  const auto found = counts.find(of);
  return found == counts.end() ? 0 : found->second;
}

std::string Places::why_not(const ucred& who, const char* what, ServiceClass service) const {
  const std::uint64_t quarter = places_ / 4, left = places_ - taken_;
  const auto already_has = [what](const std::string& name, std::uint64_t number) {
    return name + " already has " + std::to_string(number) + " " + what;
  };
  if (left == 0) return already_has("this daemon", places_);
  if (service == ServiceClass::kControl) return "";
  if (left <= kept_for_control_)
    return already_has("this daemon", taken_) + "; the last " + std::to_string(left) +
           " places are for the class control";
  const std::uint64_t users = count(by_user_, who.uid),
                      process = count(by_process_, static_cast<std::uint64_t>(who.pid));
  if (left <= quarter && users >= quarter)
    return already_has("user " + std::to_string(who.uid), users) + "; the last " + std::to_string(left) +
           " places are for others";
  if (left <= 2 * quarter && process >= (places_ + 15) / 16)
    return already_has("process " + std::to_string(who.pid), process) + "; the last " + std::to_string(left) +
           " places are for others";
  return "";
}

void Places::take(const ucred& who) {
  ++taken_;
  ++by_user_[who.uid];
  ++by_process_[static_cast<std::uint64_t>(who.pid)];
}

void Places::leave(const ucred& who) {
  assert(taken_ > 0 && count(by_user_, who.uid) > 0);
  --taken_;
  drop_one(by_user_, who.uid);
  drop_one(by_process_, static_cast<std::uint64_t>(who.pid));
}

}  // namespace clearance
