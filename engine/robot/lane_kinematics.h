// Forward kinematics of eight configurations side by side, for callers that continue in lanes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/robot/kinematics.h"
#include "engine/robot/motion_path_step.h"

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

/// The frames are those of place_batch(). Those of a configuration that it cannot place have no number as their x.
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
    if (!any(!good)) continue;
    for (std::size_t i = 0; i < block.count; ++i) {
      double* const x = block.frames[block.steps[i].link].part[4].lane + first;
      Io::store(select(good, Io::load(x), T(__builtin_nan(""))), x);
    }
  }
}

/// Velocities of links in kMostLanes configurations: angular, and of the origin.
struct TwistInLanes {
  DoubleInLanes part[6];
};
/// Their computation, as plain arrays.
struct TwistLanes {
  const KinematicStep* steps;  ///< each after its parent
  const std::uint32_t* from;   ///< (count,) the parent link of each step
  const Vec3d* axes;           ///< (count,) axis_of_step()
  std::size_t count;
  const double* change;        ///< (columns,) change of each position per unit of time
  const FrameInLanes* frames;  ///< (links,)
  TwistInLanes* twists;        ///< (links,) roots given, others results
};
template <class T, class Io>
CLEARANCE_INLINE void twist_lanes(const TwistLanes& block) {
  const auto change = [&](std::uint32_t column) { return block.change[column]; };
  for (std::size_t first = 0; first < kMostLanes; first += Io::kLanes)
    for (std::size_t i = 0; i < block.count; ++i) {
      const auto load = [&](const DoubleInLanes& lanes) { return Io::load(lanes.lane + first); };
      const auto frame_of = [&](const FrameInLanes& f) -> KinematicFrame<T> {
        return {{load(f.part[0]), load(f.part[1]), load(f.part[2]), load(f.part[3])},
                {load(f.part[4]), load(f.part[5]), load(f.part[6])}};
      };
      const DoubleInLanes* const at = block.twists[block.from[i]].part;
      const TwistOf<T> carrier{{load(at[0]), load(at[1]), load(at[2])}, {load(at[3]), load(at[4]), load(at[5])}};
      const KinematicStep& step = block.steps[i];
      const TwistOf<T> t = twist_of_step(step, block.axes[i], frame_of(block.frames[block.from[i]]), carrier,
                                         frame_of(block.frames[step.link]), change);
      DoubleInLanes* to = block.twists[step.link].part;
      for (const T* x : {&t.turn.x, &t.turn.y, &t.turn.z, &t.shift.x, &t.shift.y, &t.shift.z})
        Io::store(*x, (to++)->lane + first);
    }
}

/// These functions for one instruction set.
struct LaneFunctions {
  void (*place)(const KinematicLanes&);
  void (*twists)(const TwistLanes&);
};
template <class T, class Io>
constexpr LaneFunctions lane_functions() {
  return {place_lanes<T, Io>, twist_lanes<T, Io>};
}

/// The versions that this machine can run, the fastest first. All give the same bits.
std::span<const LaneFunctions> lane_kinematics();

/// Kinematics of one robot in lanes, with its roots at the identity.
class LaneKinematics {
 public:
  /// \param robot must outlive this
  explicit LaneKinematics(const Kinematics& robot);

  /// Computes the poses of all links, with the bits of Kinematics::place(). The caller has an FpEnvironment.
  /// \param positions (columns,) within kMaxPosition
  void place(std::span<const DoubleInLanes> positions, const LaneFunctions& kernel = lane_kinematics()[0]);
  /// Computes the twists of all links where place() has put them, with the bits of LinkTwists::at().
  /// \param change (columns,) change of each position per unit of time
  void take_twists(std::span<const double> change, const LaneFunctions& kernel = lane_kinematics()[0]);
  /// (links,) results
  const std::vector<FrameInLanes>& frames() const { return frames_; }
  Pose pose(std::uint32_t link, std::size_t lane) const {
    const auto part = [&](int i) { return frames_[link].part[i].lane[lane]; };
    return {{part(4), part(5), part(6)}, part(0), part(1), part(2), part(3)};
  }
  /// (links,) results of take_twists()
  const std::vector<TwistInLanes>& twists() const { return twists_; }
  Twist twist(std::uint32_t link, std::size_t lane) const {
    const auto part = [&](int i) { return twists_[link].part[i].lane[lane]; };
    return {{part(0), part(1), part(2)}, {part(3), part(4), part(5)}};
  }

 private:
  const Kinematics& robot_;
  std::vector<std::uint32_t> from_;  // by step: the parent link
  std::vector<Vec3d> axes_;          // likewise: of turning steps
  std::vector<FrameInLanes> frames_;
  std::vector<TwistInLanes> twists_;
};

}  // namespace clearance
