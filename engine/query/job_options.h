// Options of the narrow phase, derived from a query.
#pragma once

#include "engine/evaluate/evaluate.h"
#include "engine/query/job_state.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Whether the query rejects pairs by their bounding boxes.
bool needs_boxes(const QueryView& query);
/// \param gradient of the query's joints; null unless its column is requested
EvaluateOptions evaluate_options(const JobContext& context, const QueryView& query, const JointGradient* gradient);
/// The boxes of all bodies in the plan's snapshot, grown by uncertainty. Empty if the query has too few pairs for this
/// to pay.
std::vector<Aabb> boxes_of_bodies(const engine::Scene& scene, const Plan& plan);
/// The part of the reply about the snapshot.
ReplyInfo snapshot_info(const Plan& plan, bool reference);

}  // namespace clearance
