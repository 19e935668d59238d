#include "engine/query/job_options.h"

#include <limits>

namespace clearance {

bool needs_boxes(const QueryView& query) {
  return query.reduce != Reduce::kNone || query.max_distance < std::numeric_limits<double>::infinity();
}

EvaluateOptions evaluate_options(const JobContext& context, const QueryView& query, const JointGradient* gradient) {
  constexpr std::uint32_t kIntervalFields =
      kDefaultFields | kFieldBounds | kFieldFlags | kFieldPair | kFieldConfiguration | kFieldPairLower | kFieldVerdict;
  EvaluateOptions options;
  options.limits.max_distance = query.max_distance;
  options.limits.abs_tol = query.abs_tol;
  options.limits.rel_tol = query.rel_tol;
  options.limits.signed_distance = query.signed_distance;
  options.reference = context.reference;
  options.lanes = context.lanes;
  options.contradictions = context.contradictions;
  options.drops_beyond = query.reduce == Reduce::kWithin && !context.reference;
  options.cull = needs_boxes(query) && !context.reference;
  // Reductions evaluate few pairs of many hulls, for which float32 lanes gain nothing (docs/notes/performance.md).
  options.f32 = query.precision == Precision::kF32 && query.reduce == Reduce::kNone && !query.signed_distance;
  options.want_flags = (query.fields & (kFieldFlags | kFieldGradient)) != 0;
  options.want_points = (query.fields & ~kIntervalFields) != 0 || options.want_flags;
  options.joint_gradient = gradient;
  return options;
}

std::vector<Aabb> boxes_of_bodies(const engine::Scene& scene, const Plan& plan) {
  std::vector<Aabb> boxes;
  if (!needs_boxes(plan.query) || 2 * plan.pairs.size() < scene.bodies().size()) return boxes;
  for (std::uint32_t b = 0; b < scene.bodies().size(); ++b)
    boxes.push_back(body_box(scene.bodies()[b], plan.snapshot->placed[b],
                             plan.uncertainties.empty() ? Slack() : plan.uncertainties[b].slack));
  return boxes;
}

ReplyInfo snapshot_info(const Plan& plan, bool reference) {
  const PoseSnapshot& snapshot = *plan.snapshot;
  const std::uint64_t query_revision = plan.query.scene_revision;
  ReplyInfo info;
  info.backend = reference ? "reference" : "cpu";
  info.snapshot_revision = snapshot.revision;
  info.snapshot_stamp_ns = snapshot.newest_stamp_ns;
  info.snapshot_sequence = snapshot.newest_sequence;
  info.scene_revision = query_revision ? query_revision : snapshot.scene_revision;  // the answer is the same for both
  info.oldest_receipt_ns = snapshot.oldest_receipt_ns;
  if (snapshot.oldest_receipt_ns != 0) info.pose_age_ns = plan.begun_ns - snapshot.oldest_receipt_ns;
  return info;
}

}  // namespace clearance
