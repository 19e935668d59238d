// The naive baselines: every face of one mesh against every face of the other.
#pragma once

#include "bench/report/narrow.h"

namespace clearance::baselines {

/// \param threads 1 for naive; otherwise naive_omp
std::unique_ptr<NarrowBaseline> make_naive(int threads);

}  // namespace clearance::baselines
