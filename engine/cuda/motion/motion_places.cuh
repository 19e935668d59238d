// Kernels that place the bodies of a level at the middles of its spans, with their velocities.
#pragma once

#include "engine/cuda/motion/motion_least.cuh"
#include "engine/cuda/place/place_body.cuh"

namespace clearance::cuda {

// One thread per joint and span: the position at the span's middle.
__global__ void __launch_bounds__(kMotionThreads) place_spans(const __grid_constant__ MotionsView m) {
  const std::uint32_t joints = m.moves.frames.joints;
  const std::uint32_t s = thread_index() / joints, j = thread_index() % joints;
  if (s >= span_count(m)) return;
  const MotionSpan span = m.spans[s];
  const double* const ends = m.ends + std::size_t{span.motion} * 2 * joints + j;
  // Use the end's exact position: rounding could place it beyond the joint's limits.
  const bool is_end = span.begin == 1;
  m.positions[std::size_t{s} * joints + j] = is_end ? ends[joints] : position_at(ends[0], ends[joints], span.middle());
  if (j != 0) return;
  m.shares[2 * s] = m.shares[2 * s + 1] = ~0u;
  atomicAdd(m.steps + span.motion, 1);
}

// An end beyond a joint's limits flags the links that the joint places over the whole motion, as in MotionPoses.
__device__ inline void flag_ends(const MotionsView& m, const JointRobot& robot, std::uint32_t s) {
  const FramesView& f = m.moves.frames;
  const double* const ends = m.ends + std::size_t{m.spans[s].motion} * 2 * f.joints;
  const JointColumn* const columns = f.columns + robot.first_column;
  const auto facts = [&](std::uint32_t frame) -> std::uint8_t& {
    return f.facts[std::size_t{robot.first_frame + frame} * m.span_capacity + s];
  };
  for (std::uint32_t i = 0; i < robot.steps; ++i) {
    const KinematicStep& step = f.steps[robot.first_step + i];
    const std::uint8_t of_ends =
        fact_of_step(step, JointRow{columns, ends}) | fact_of_step(step, JointRow{columns, ends + f.joints});
    facts(robot.roots + i) |= (facts(step.from) | of_ends) & kLinkBeyondLimits;
  }
}

// One thread per robot and span: poses and velocities of its links.
__global__ void __launch_bounds__(kMotionThreads) place_span_links(const __grid_constant__ MotionsView m) {
  const FramesView& f = m.moves.frames;
  const std::uint32_t which = thread_index() / m.span_capacity, s = thread_index() % m.span_capacity;
  if (which >= f.robot_count || s >= span_count(m)) return;
  const JointRobot robot = f.robots[which];
  const MotionOf motion(m, m.spans[s].motion);
  const JointColumn* const columns = f.columns + robot.first_column;
  for (std::uint32_t r = 0; r < robot.roots; ++r) store_twist(m, robot.first_frame + r, s, {});
  place_links_of(f, which, s, m.span_capacity,
                 [&](std::uint32_t i, const KinematicFrame<double>& from, const KinematicFrame<double>& to) {
                   const KinematicStep& step = f.steps[robot.first_step + i];
                   const auto change = [&](std::uint32_t column) {
                     const std::uint32_t at = columns[column].at;
                     return at == kNone ? 0.0 : motion.joint(at).along;
                   };
                   const Twist carrier = load_twist(m, robot.first_frame + step.from, s);
                   store_twist(m, robot.first_frame + robot.roots + i, s,
                               twist_of_step(step, axis_of_step(step), from, carrier, to, change));
                 });
  if (m.chunk.pair_limits.want_nonsmooth) flag_ends(m, robot, s);
}

// One thread per moved body and span: its pose, uncertainty and speed.
__global__ void __launch_bounds__(kMotionThreads) place_span_bodies(const __grid_constant__ MotionsView m) {
  const std::uint32_t slot = thread_index() / m.span_capacity, s = thread_index() % m.span_capacity;
  if (slot >= m.chunk.bodies.moved_count || s >= span_count(m)) return;
  const std::uint32_t chain = m.tables.chain_of_slot[slot];
  const ChainMotion own = motion_of_chain(m, chain, m.spans[s].motion);
  const PlacedUncertainty uncertainty =
      place_body<true>(m.chunk.hulls, m.chunk.bodies, m.moves, slot, s, m.span_capacity, own.error);
  const double turn_uncertainty = uncertainty.known.turn + uncertainty.placed.turn + 4 * kMotionUnit;
  const double drift = chain == kNone ? 0 : drift_of_chain(own.rates, own.error, own.turn_error, turn_uncertainty);
  set_number(m, kOwnSpeed, slot, s, own.rates.speed);
  set_number(m, kOwnAcceleration, slot, s, own.rates.acceleration);
  set_number(m, kOwnDrift, slot, s, drift);
  m.speeds[std::size_t{slot} * m.span_capacity + s] = __double2float_ru((own.rates.speed + drift) * kMotionSlack);
}

// Runs after place_span_bodies(): twists of bodies in world axes, down the chain that carries each.
__global__ void __launch_bounds__(kMotionThreads) move_span_bodies(const __grid_constant__ MotionsView m) {
  const std::uint32_t slot = thread_index() / m.span_capacity, s = thread_index() % m.span_capacity;
  if (slot >= m.chunk.bodies.moved_count || s >= span_count(m)) return;
  Twist twist;
  for (std::uint32_t i = m.moves.chain_begin[slot]; i < m.moves.chain_begin[slot + 1]; ++i) {
    const bool is_first = i == m.moves.chain_begin[slot];
    const std::uint32_t body = m.moves.chain[i], source = m.moves.source[body];
    const PlacedFrame here = moved_frame(m, body, s);
    Twist own;
    if (source != kNone) {  // in the axes of its parent
      own = load_twist(m, source, s);
      if (!is_first || m.moves.has_base[slot]) {
        const Mat3d R_wp = is_first ? m.moves.base[slot].pose.R_wb : moved_frame(m, m.moves.chain[i - 1], s).R_wb;
        own = {R_wp * own.turn, R_wp * own.shift};
      }
    }
    if (!is_first) {
      const Vec3d away = here.t_w - moved_frame(m, m.moves.chain[i - 1], s).t_w;
      own.turn += twist.turn;
      own.shift += twist.shift + cross(twist.turn, away);
    }
    twist = own;
  }
  for (int c = 0; c < 3; ++c) {
    set_number(m, kOwnTurn + c, slot, s, twist.turn[c]);
    set_number(m, kOwnShift + c, slot, s, twist.shift[c]);
  }
}

}  // namespace clearance::cuda
