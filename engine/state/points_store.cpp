// Replaces the points of bodies: builds the tree, then publishes a snapshot with a new scene.
#include <algorithm>
#include <stdexcept>
#include <utility>

#include "engine/bvh/surface.h"
#include "engine/geometry/cloud_geometry.h"
#include "engine/state/pose_store.h"

namespace clearance {

const ReceivedPoints* PoseSnapshot::points_of(std::uint32_t body) const {
  if (!points) return nullptr;
  const auto found = std::ranges::find(*points, body, &ReceivedPoints::body);
  return found == points->end() ? nullptr : &*found;
}

void PoseStore::note_points(PoseSnapshot& next, ReceivedPoints received) {
  auto all = next.points ? std::make_shared<std::vector<ReceivedPoints>>(*next.points)
                         : std::make_shared<std::vector<ReceivedPoints>>();
  if (!next.scene->bodies()[received.body].is_static) next.velocity[received.body] = kUnknownTwist;  // they may move
  std::erase_if(*all, [&](const ReceivedPoints& of) { return of.body == received.body; });
  all->push_back(std::move(received));
  next.points = std::move(all);
}

PoseUpdateResult PoseStore::set_points(std::uint32_t body, std::span<const CloudPoint> points,
                                       std::optional<double> radius, std::int64_t stamp_ns, std::int64_t sequence,
                                       std::uint64_t publisher) {
  const auto reject = [](const std::string& why) {
    throw engine::QueryError(QueryErrorCode::kBadQuery, "points: " + why);
  };
  check_stamp(stamp_ns);
  if (body >= scene_.bodies().size()) reject("unknown body " + std::to_string(body));
  const Body& of = scene_.bodies()[body];
  if (!is_cloud(of)) reject("'" + of.name + "' is not a point cloud");
  ConvexPartPtr cloud;
  try {
    if (!points.empty()) cloud = make_cloud_part(points, of.voxel, radius.value_or(of.cloud_radius));
  } catch (const std::invalid_argument& e) {
    reject("'" + of.name + "': " + e.what());
  }

  const std::lock_guard one_at_a_time(points_writers_);
  // points_writers_ excludes other new scenes; poses may be set concurrently.
  auto scene = std::make_shared<const engine::Scene>(snapshot()->scene->with_points(body, cloud));
  std::erase_if(scenes_, [](const std::shared_ptr<const engine::Scene>& old) { return old.use_count() == 1; });
  scenes_.push_back(scene);

  const auto lock = lock_for_update();
  check_not_late(points_marks_, body, of.name, stamp_ns, publisher);
  points_marks_.note(body, publisher, stamp_ns);
  const std::shared_ptr<PoseSnapshot> next = copy();
  next->scene = std::move(scene);
  note_points(*next, {body, std::move(cloud), points.size(), stamp_ns, monotonic_ns(), sequence});
  publish_moved(next, std::span(&body, 1));
  PoseUpdateResult result;
  result.revision = next->revision;
  result.applied = static_cast<std::uint32_t>(points.size());
  result.copied_bytes = std::exchange(copied_bytes_, 0) + points.size_bytes();
  return result;
}

void PoseStore::take_over_points(const PoseStore& old_store, PoseSnapshot& next, std::string_view reshaped) {
  const PoseSnapshot& old = *old_store.current_;
  if (!old.points) return;
  for (ReceivedPoints received : *old.points) {
    const std::string& name = old_store.scene_.bodies()[received.body].name;
    const std::uint32_t now = scene_.find_body(name);
    if (now == kNone || name == reshaped || !is_cloud(scene_.bodies()[now])) continue;
    if (received.cloud && received.cloud->surface->edge() != scene_.bodies()[now].voxel) continue;
    received.body = now;
    next.scene = std::make_shared<const engine::Scene>(next.scene->with_points(now, received.cloud));
    note_points(next, std::move(received));
  }
}

}  // namespace clearance
