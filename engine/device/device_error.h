// Reasons why a device did not answer.
#pragma once

#include <stdexcept>
#include <string>

namespace clearance::cuda {

struct DeviceError : std::runtime_error {
  enum Kind {
    kLost,      ///< permanent in this process
    kOneLost,   ///< one of several devices is lost; the others go on
    kNoMemory,  ///< temporary: out of memory, or over the memory budget
  };
  DeviceError(Kind k, const std::string& what) : std::runtime_error(what), kind(k) {}
  Kind kind;
};

}  // namespace clearance::cuda
