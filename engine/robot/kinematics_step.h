// Kinematics of one joint, from the same source for a scalar, a SIMD pack (a configuration per lane) and a GPU thread.
// Uses only additions and products.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/base/placement_error.h"
#include "engine/pose/pose.h"
#include "engine/pose/quaternion.h"
#include "engine/pose/sin_cos.h"

namespace clearance {

/// A link in its parent frame: fixed, revolute, sliding along a direction, or planar. The constants include fixed
/// joints in between, and are exact values rounded once.
struct KinematicStep {
  enum class Kind : std::uint8_t { kFixed, kTurning, kSliding, kPlanar };
  Kind kind = Kind::kFixed;
  std::uint32_t from = 0;                   ///< parent frame: a root, or roots + the index of an earlier step
  std::uint32_t link = 0;                   ///< the link of this frame
  std::uint32_t column = 0;                 ///< column of its position, or of the first of three
  bool mimics = false;                      ///< whether its position is multiplier * q + offset
  double multiplier = 1, offset = 0;        ///< of a mimic joint
  Quaternion<double> still{1, 0, 0, 0};     ///< the turn at position 0 ...
  Quaternion<double> turning{0, 0, 0, 0};   ///< ... which is cos(q/2) still + sin(q/2) turning elsewhere
  Vec3d at{0, 0, 0};                        ///< origin of the joint in the parent frame, metres
  Vec3d along[2] = {{0, 0, 0}, {0, 0, 0}};  ///< metres per metre of travel
};

/// Largest position, in radians or metres.
inline constexpr double kMaxPosition = kMaxAngle;

template <class T>
struct KinematicFrame {
  Quaternion<T> q;  ///< within 4 roundings of length 1
  Vec3<T> t;        ///< metres
};

namespace detail {

template <class T>
CLEARANCE_INLINE Vec3<T> constant(const Vec3d& v) {
  return {T(v.x), T(v.y), T(v.z)};
}
template <class T>
CLEARANCE_INLINE Quaternion<T> constant(const Quaternion<double>& q) {
  return {T(q.w), T(q.x), T(q.y), T(q.z)};
}
template <class T, class Mask>
CLEARANCE_INLINE void limit(const T& position, Mask* good) {
  *good = *good & (position <= T(kMaxPosition)) & (T(-kMaxPosition) <= position);
}

/// cos(q/2) still + sin(q/2) turning.
template <class T>
CLEARANCE_INLINE Quaternion<T> turn_of(const KinematicStep& step, const SinCos<T>& half) {
  const Quaternion<T> a = constant<T>(step.still), b = constant<T>(step.turning);
  return {half.cosine * a.w + half.sine * b.w, half.cosine * a.x + half.sine * b.x, half.cosine * a.y + half.sine * b.y,
          half.cosine * a.z + half.sine * b.z};
}

}  // namespace detail

/// Position of a step's joint.
template <class T>
struct JointMove {
  TwoPart<T> half_angle;  ///< radians; meaningful if turns()
  Vec3<T> offset;         ///< of the link's origin in the parent frame, metres
};
CLEARANCE_INLINE bool turns(const KinematicStep& step) {
  return step.kind == KinematicStep::Kind::kTurning || step.kind == KinematicStep::Kind::kPlanar;
}
/// \param position returns the position of a column in the configuration
/// \param good cleared for an invalid position
template <class T, class Mask, class Load>
CLEARANCE_INLINE JointMove<T> joint_move(const KinematicStep& step, const Load& position, Mask* good) {
  using Kind = KinematicStep::Kind;
  JointMove<T> move{{T(0.0), T(0.0)}, detail::constant<T>(step.at)};
  if (step.kind == Kind::kFixed) return move;
  TwoPart<T> q{position(step.column), T(0.0)};
  detail::limit(q.value, good);
  if (step.mimics) {
    const TwoPart<T> scaled = exact_product(T(step.multiplier), q.value);
    q = exact_sum(scaled.value, T(step.offset));
    q.rest = q.rest + scaled.rest;
    detail::limit(q.value, good);
  }
  if (step.kind != Kind::kTurning) move.offset = move.offset + detail::constant<T>(step.along[0]) * q.value;
  if (step.kind == Kind::kPlanar) {
    const T y = position(step.column + 1);
    detail::limit(y, good);
    move.offset = move.offset + detail::constant<T>(step.along[1]) * y;
    q = {position(step.column + 2), T(0.0)};
    detail::limit(q.value, good);
  }
  move.half_angle = {q.value * T(0.5), q.rest * T(0.5)};
  return move;
}

/// Returns the frame of a step's link.
/// \param position, good as those of joint_move()
template <class T, class Mask, class Load>
CLEARANCE_INLINE KinematicFrame<T> carried(const KinematicFrame<T>& from, const KinematicStep& step,
                                           const Load& position, Mask* good) {
  const JointMove<T> move = joint_move<T>(step, position, good);
  Quaternion<T> turn = detail::constant<T>(step.still);
  if (turns(step)) turn = detail::turn_of(step, sin_cos(move.half_angle.value, move.half_angle.rest));
  return {renormalised(product(from.q, turn)), from.t + turned(from.q, move.offset)};
}

/// Returns the travel of a step's joint (Kinematics::travel() is their maximum), in metres, rounded up. The value is 0
/// for a joint that does not slide, and for an invalid position.
template <class Load>
CLEARANCE_INLINE double travel_of(const KinematicStep& step, const Load& position) {
  const auto out = [&](double q) {
    if (!(-kMaxPosition <= q && q <= kMaxPosition)) return 0.0;
    const double at = step.mimics ? step.multiplier * q + step.offset : q;
    return (at < 0 ? -at : at) * kPlacementSlack;
  };
  const bool planar = step.kind == KinematicStep::Kind::kPlanar;
  if (!planar && step.kind != KinematicStep::Kind::kSliding) return 0;
  const double along = out(position(step.column)), across = planar ? out(position(step.column + 1)) : 0;
  return along < across ? across : along;
}

/// A batch of configurations for a kernel, as plain arrays.
struct KinematicBatch {
  const KinematicStep* steps;  ///< each after its parent
  std::size_t count;           ///< number of steps
  const double* roots;         ///< (root_count, 7) qw, qx, qy, qz, x, y, z; unit quaternions within 4 roundings
  std::size_t root_count;
  const double* positions;  ///< (configurations, columns)
  std::size_t columns, configurations;
  Pose* poses;  ///< (configurations, links); only those of the steps' links are written
  std::size_t links;
  std::uint8_t* bad;  ///< (configurations,) 1 for NaN or a position beyond kMaxPosition; the poses are then NaN
  double* scratch;    ///< (columns + 7 (root_count + count), kMostLanes), aligned to 64 bytes
};
inline constexpr std::size_t kMostLanes = 8;

/// Writes the frames of a block of lanes to the poses of their configurations.
/// \param usable 0 for a lane with invalid positions
template <std::size_t kLanes>
CLEARANCE_INLINE void hand_out(const KinematicBatch& batch, std::size_t first, std::size_t lanes, const double* frames,
                               const double* usable) {
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const bool bad = usable[lane] == 0;
    batch.bad[first + lane] = bad;
    Pose* const poses = batch.poses + (first + lane) * batch.links;
    for (std::size_t i = 0; i < batch.count; ++i) {
      const double* at = frames + (batch.root_count + i) * 7 * kLanes + lane;
      const auto part = [&](std::size_t k) { return bad ? __builtin_nan("") : at[k * kLanes]; };
      poses[batch.steps[i].link] = {{part(4), part(5), part(6)}, part(0), part(1), part(2), part(3)};
    }
  }
}

/// Runs a batch, `Io::kLanes` configurations at a time.
/// \tparam Io loads and stores a T
template <class T, class Io>
CLEARANCE_INLINE void place_batch(const KinematicBatch& batch) {
  constexpr std::size_t kLanes = Io::kLanes;
  double* const positions = batch.scratch;
  double* const frames = positions + batch.columns * kLanes;
  const auto store = [&](std::size_t frame, const KinematicFrame<T>& f) {
    double* to = frames + frame * 7 * kLanes;
    for (const T* part : {&f.q.w, &f.q.x, &f.q.y, &f.q.z, &f.t.x, &f.t.y, &f.t.z}) {
      Io::store(*part, to);
      to += kLanes;
    }
  };
  for (std::size_t r = 0; r < batch.root_count; ++r) {
    const double* x = batch.roots + 7 * r;
    store(r, {{T(x[0]), T(x[1]), T(x[2]), T(x[3])}, {T(x[4]), T(x[5]), T(x[6])}});
  }
  for (std::size_t first = 0; first < batch.configurations; first += kLanes) {
    const std::size_t left = batch.configurations - first, lanes = left < kLanes ? left : kLanes;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const double* row = batch.positions + (first + (lane < lanes ? lane : 0)) * batch.columns;
      for (std::size_t c = 0; c < batch.columns; ++c) positions[c * kLanes + lane] = row[c];
    }
    const auto position = [&](std::uint32_t column) { return Io::load(positions + column * kLanes); };
    typename Lane<T>::Mask good = T(0.0) == T(0.0);
    for (std::size_t i = 0; i < batch.count; ++i) {
      const double* at = frames + batch.steps[i].from * 7 * kLanes;
      const auto part = [&](int k) { return Io::load(at + static_cast<std::size_t>(k) * kLanes); };
      store(batch.root_count + i,
            carried(KinematicFrame<T>{{part(0), part(1), part(2), part(3)}, {part(4), part(5), part(6)}},
                    batch.steps[i], position, &good));
    }
    alignas(64) double usable[kMostLanes];
    Io::store(select(good, T(1.0), T(0.0)), usable);
    hand_out<kLanes>(batch, first, lanes, frames, usable);
  }
}

// Parts of one configuration, with its joints as lanes. Arrays are aligned to 64 bytes, and `count` is a multiple of
// kMostLanes.

/// sin_cos() of angles.
/// \param angles (2, count) value and rest; replaced by sine and cosine
template <class T, class Io>
CLEARANCE_INLINE void sin_cos_in_lanes(double* angles, std::size_t count) {
  for (std::size_t i = 0; i < count; i += Io::kLanes) {
    const SinCos<T> found = sin_cos(Io::load(angles + i), Io::load(angles + count + i));
    Io::store(found.sine, angles + i);
    Io::store(found.cosine, angles + count + i);
  }
}
/// turned() of vectors.
/// \param q (4, count)
/// \param v (3, count), replaced by the results
template <class T, class Io>
CLEARANCE_INLINE void turned_in_lanes(const double* q, double* v, std::size_t count) {
  const auto load = [&](const double* from, std::size_t k) { return Io::load(from + k * count); };
  for (std::size_t i = 0; i < count; i += Io::kLanes, q += Io::kLanes, v += Io::kLanes) {
    const Vec3<T> u = turned(Quaternion<T>{load(q, 0), load(q, 1), load(q, 2), load(q, 3)},
                             Vec3<T>{load(v, 0), load(v, 1), load(v, 2)});
    Io::store(u.x, v);
    Io::store(u.y, v + count);
    Io::store(u.z, v + 2 * count);
  }
}

/// These functions for one instruction set.
struct KinematicFunctions {
  void (*place_batch)(const KinematicBatch&);
  void (*sin_cos)(double* angles, std::size_t count);
  void (*turned)(const double* q, double* v, std::size_t count);
};
template <class T, class Io>
constexpr KinematicFunctions kinematic_functions() {
  return {[](const KinematicBatch& batch) { place_batch<T, Io>(batch); },
          [](double* angles, std::size_t count) { sin_cos_in_lanes<T, Io>(angles, count); },
          [](const double* q, double* v, std::size_t count) { turned_in_lanes<T, Io>(q, v, count); }};
}

}  // namespace clearance
