#include "engine/cover/obstacle_shapes.h"

#include <algorithm>
#include <utility>

namespace clearance {

std::shared_ptr<const ObstacleShape> ObstacleShapes::of(const ConvexPartPtr& part) {
  if (part->surface) {  // quickly made, and must not outlive its points
    std::optional<ObstacleShape> shape = obstacle_shape(*part);
    return shape ? std::make_shared<const ObstacleShape>(std::move(*shape)) : nullptr;
  }
  {
    const std::lock_guard lock(mutex_);
    const auto at = known_.find(part.get());
    if (at != known_.end() && at->second.part.lock() == part) return at->second.shape;
  }
  std::optional<ObstacleShape> made = obstacle_shape(*part);
  Known known{part, made ? std::make_shared<const ObstacleShape>(std::move(*made)) : nullptr};
  const std::lock_guard lock(mutex_);
  if (known_.size() >= swept_at_) {
    std::erase_if(known_, [](const auto& entry) { return entry.second.part.expired(); });
    swept_at_ = std::max<std::size_t>(64, 2 * known_.size());
  }
  return known_.insert_or_assign(part.get(), std::move(known)).first->second.shape;
}

}  // namespace clearance
