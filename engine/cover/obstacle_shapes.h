// Shapes of obstacles, made once for each part.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "engine/cover/obstacle.h"

namespace clearance {

/// Thread-safe.
class ObstacleShapes {
 public:
  /// obstacle_shape() of a part: from memory, or made now. Null if there is none.
  std::shared_ptr<const ObstacleShape> of(const ConvexPartPtr& part);

 private:
  struct Known {
    std::weak_ptr<const ConvexPart> part;
    std::shared_ptr<const ObstacleShape> shape;
  };
  std::mutex mutex_;
  std::map<const ConvexPart*, Known> known_;
  std::size_t swept_at_ = 64;  // entries at which those of parts that are gone are removed
};

}  // namespace clearance
