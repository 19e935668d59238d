// Number of repetitions of faults: a few in `make test`, a configurable number in `make soak`.
#pragma once

#include <cstdlib>

namespace clearance::faults {

/// \param short_run number in `make test`; CLEARANCE_FAULT_ROUNDS=N in the environment multiplies it
inline int rounds(int short_run) {
  const char* times = std::getenv("CLEARANCE_FAULT_ROUNDS");
  const int factor = times ? std::atoi(times) : 1;
  return short_run * (factor > 0 ? factor : 1);
}

}  // namespace clearance::faults
