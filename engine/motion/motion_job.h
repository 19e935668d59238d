// Jobs for motions, on the CPU: docs/trust/bounds_robots.md, "Motion".
#pragma once

#include <memory>

#include "engine/query/job_state.h"

namespace clearance {

/// Throws QueryError for more pairs than motions may have.
void check_motion_pairs(const Plan& plan);
/// For a plan with max_evaluations > 0. Throws QueryError for more pairs than motions may have.
std::unique_ptr<Job::State> make_motion_job(const JobContext& context, Plan plan, const ReplyView& reply);

}  // namespace clearance
