// Engine::stats().
#include <algorithm>

#include "engine/engine_impl.h"

namespace clearance::engine {

namespace {

// Appends the ages of poses and the numbers of bodies without a usable pose. Static bodies need none.
void append_ages(Counters& counters, const PoseSnapshot& snapshot) {
  std::uint64_t missing = 0, bad = 0;
  std::int64_t newest = 0, oldest = 0;
  for (std::size_t b = 0; b < snapshot.placed.size(); ++b) {
    const Body& body = snapshot.scene->bodies()[b];
    if (!body.parts.empty() || is_cloud(body)) {  // frames belong to no pair
      missing += snapshot.placed[b].status == Status::kNoPose;
      bad += snapshot.placed[b].status == Status::kBadPose;
    }
    const std::int64_t receipt = snapshot.receipt_ns[b];
    if (receipt == 0) continue;
    newest = std::max(newest, receipt);
    oldest = oldest == 0 ? receipt : std::min(oldest, receipt);
  }
  counters.emplace_back("engine.bodies_without_pose", missing);
  counters.emplace_back("engine.bodies_with_bad_pose", bad);
  if (oldest == 0) return;
  const std::int64_t now = monotonic_ns();
  counters.emplace_back("engine.newest_pose_age_ns",
                        static_cast<std::uint64_t>(std::max<std::int64_t>(now - newest, 0)));
  counters.emplace_back("engine.oldest_pose_age_ns",
                        static_cast<std::uint64_t>(std::max<std::int64_t>(now - oldest, 0)));
}

void append_covers(Counters& counters, const CoverStore::Progress& progress) {
  counters.emplace_back("engine.covers", progress.made);
  counters.emplace_back("engine.covers_pending", progress.pending);
  counters.emplace_back("engine.covers_impossible", progress.impossible);
  counters.emplace_back("engine.cover_bytes", progress.bytes);
}

void append_tables(Counters& counters, const JointTableStore& tables) {
  counters.emplace_back("engine.joint_tables", tables.count());
  counters.emplace_back("engine.joint_tables_pending", tables.pending());
  counters.emplace_back("engine.joint_table_bytes", tables.bytes());
}

}  // namespace

Counters Engine::stats() const {
  const auto snapshot = impl_->poses.snapshot();
  std::uint64_t vertices = 0, parts = 0, points = 0;
  for (const Body& body : snapshot->scene->bodies()) {
    points += point_count(body);
    for (const ConvexPartPtr& part : body.parts) {
      ++parts;
      vertices += part->vertices.size();
    }
  }
  Counters counters{{"engine.bodies", impl_->scene.bodies().size()},
                    {"engine.pieces", parts},
                    {"engine.box_trees", impl_->trees->builds()},
                    {"engine.box_tree_bytes", impl_->trees->bytes()},
                    {"engine.vertices", vertices},
                    {"engine.pairs", snapshot->pairs->size()},
                    {"engine.threads", static_cast<std::uint64_t>(impl_->options.threads)},
                    {"engine.teams", impl_->teams},
                    {"engine.queries", impl_->queries + impl_->answered_again},
                    {"engine.jobs_reused", impl_->repeated + impl_->answered_again},
                    {"engine.pairs_evaluated", impl_->pairs_evaluated},
                    {"engine.contradictions", impl_->contradictions},
                    {"engine.pose_revision", snapshot->revision},
                    {"engine.pose_updates", impl_->pose_updates},
                    {"engine.bad_poses", impl_->bad_poses},
                    {"engine.joint_updates", impl_->joint_updates},
                    {"engine.bad_joints", impl_->bad_joints},
                    {"engine.point_updates", impl_->point_updates},
                    {"engine.points", points},
                    {"engine.stamps_out_of_range", impl_->poses.stamps_out_of_range()},
                    {"engine.stamps_late", impl_->poses.stamps_late()}};
  append_ages(counters, *snapshot);
  if (impl_->covers) append_covers(counters, impl_->covers->progress());
  if (impl_->tables) append_tables(counters, *impl_->tables);
  if (impl_->device) impl_->device->append(counters);
  if (impl_->router) impl_->router->append(counters);
  return counters;
}

}  // namespace clearance::engine
