#include "server/limits/places.h"

namespace clearance {

std::string Places::why_not(const ucred& who, const char* what, ServiceClass service) const {
  const std::uint64_t quarter = places_ / 4, left = places_ - taken();
  const auto already_has = [what](const std::string& name, std::uint64_t number) {
    return name + " already has " + std::to_string(number) + " " + what;
  };
  const auto last_are = [left](const char* whose) {
    return "; the last " + std::to_string(left) + " places are for " + whose;
  };
  if (left == 0) return already_has("this daemon", places_);
  if (service == ServiceClass::kControl) return "";
  if (left <= kept_for_control_) return already_has("this daemon", taken()) + last_are("the class control");
  const std::uint64_t of_user = users_.of(who.uid), of_process = processes_.of(static_cast<std::uint64_t>(who.pid));
  if (left <= quarter && of_user >= quarter)
    return already_has("user " + std::to_string(who.uid), of_user) + last_are("others");
  if (left <= 2 * quarter && of_process >= (places_ + 15) / 16)
    return already_has("process " + std::to_string(who.pid), of_process) + last_are("others");
  return "";
}

}  // namespace clearance
