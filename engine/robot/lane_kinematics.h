// Forward kinematics of eight configurations side by side, for callers that continue in lanes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/robot/kinematics.h"

namespace clearance {

/// A number of kMostLanes configurations.
struct alignas(64) DoubleInLanes {
  double lane[kMostLanes];
};
/// A frame in kMostLanes configurations: qw, qx, qy, qz, x, y, z.
struct FrameInLanes {
  DoubleInLanes part[7];
};

/// A block of configurations for a kernel, as plain arrays.
struct KinematicLanes {
  const KinematicStep* steps;  ///< each after its parent
  const std::uint32_t* from;   ///< (count,) the parent link of each step
  std::size_t count;
  const DoubleInLanes* positions;  ///< (columns,) within kMaxPosition
  FrameInLanes* frames;            ///< (links,) those of the roots are given
};

/// The frames are those of place_batch().
template <class T, class Io>
CLEARANCE_INLINE void place_lanes(const KinematicLanes& block) {
  for (std::size_t first = 0; first < kMostLanes; first += Io::kLanes) {
    const auto position = [&](std::uint32_t column) { return Io::load(block.positions[column].lane + first); };
    typename Lane<T>::Mask good = T(0.0) == T(0.0);
    for (std::size_t i = 0; i < block.count; ++i) {
      const DoubleInLanes* at = block.frames[block.from[i]].part;
      const auto part = [&](int k) { return Io::load(at[k].lane + first); };
      const KinematicFrame<T> from{{part(0), part(1), part(2), part(3)}, {part(4), part(5), part(6)}};
      const KinematicFrame<T> f = carried(from, block.steps[i], position, &good);
      DoubleInLanes* to = block.frames[block.steps[i].link].part;
      for (const T* x : {&f.q.w, &f.q.x, &f.q.y, &f.q.z, &f.t.x, &f.t.y, &f.t.z}) Io::store(*x, (to++)->lane + first);
    }
  }
}
using PlaceLanes = void (*)(const KinematicLanes&);

/// The versions that this machine can run, the fastest first. All give the same bits.
std::span<const PlaceLanes> lane_kinematics();

/// Kinematics of one robot in lanes, with its roots at the identity.
class LaneKinematics {
 public:
  /// \param robot must outlive this
  explicit LaneKinematics(const Kinematics& robot);

  /// Computes the poses of all links, with the bits of Kinematics::place(). The caller has an FpEnvironment.
  /// \param positions (columns,) within kMaxPosition
  void place(std::span<const DoubleInLanes> positions, PlaceLanes kernel = lane_kinematics()[0]);
  /// (links,) results
  const std::vector<FrameInLanes>& frames() const { return frames_; }
  Pose pose(std::uint32_t link, std::size_t lane) const {
    const auto part = [&](int i) { return frames_[link].part[i].lane[lane]; };
    return {{part(4), part(5), part(6)}, part(0), part(1), part(2), part(3)};
  }

 private:
  const Kinematics& robot_;
  std::vector<std::uint32_t> from_;  // by step: the parent link
  std::vector<FrameInLanes> frames_;
};

}  // namespace clearance
