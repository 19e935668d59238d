// Why a device did not answer.
#pragma once

#include <stdexcept>
#include <string>

namespace clearance::cuda {

struct DeviceError : std::runtime_error {
  enum Kind {
    kLost,     ///< it answers nothing any more in this process
    kOneLost,  ///< the same of one of several devices: the others go on
    kNoRoom,   ///< not this time: memory would be needed that it lacks, or that the budget does not allow
  };
  DeviceError(Kind k, const std::string& what) : std::runtime_error(what), kind(k) {}
  Kind kind;
};

}  // namespace clearance::cuda
