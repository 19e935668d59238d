// Computes link frames from joint positions, using engine/robot/kinematics_step.h.
#pragma once

#include "engine/device/layout.h"
#include "engine/scene/link_motion.h"

namespace clearance::cuda {

// A robot's joint columns in a configuration, with the rules of LinkMotion.
struct JointRow {
  const JointColumn* columns;
  const double* row;

  __device__ std::uint8_t fact(std::uint32_t c) const {
    const JointColumn& column = columns[c];
    return column.at == kNone ? column.fact : position_fact(column.lower, column.upper, row[column.at]);
  }
  __device__ double operator()(std::uint32_t c) const {
    const JointColumn& column = columns[c];
    if (column.at == kNone) return column.position;
    return fact(c) & kLinkBad ? 0 : row[column.at];
  }
};

__device__ inline std::uint8_t fact_of_step(const KinematicStep& step, const JointRow& row) {
  using Kind = KinematicStep::Kind;
  const std::uint32_t width = step.kind == Kind::kFixed ? 0 : step.kind == Kind::kPlanar ? 3 : 1;
  std::uint8_t fact = 0;
  for (std::uint32_t c = 0; c < width; ++c) fact |= row.fact(step.column + c);
  return fact;
}

// Accesses a frame in FramesView::numbers. Neighbouring threads access neighbouring numbers.
__device__ inline KinematicFrame<double> load_frame(const FramesView& f, std::uint32_t frame, std::uint32_t k,
                                                    std::uint32_t configurations) {
  const double* p = f.numbers + std::size_t{frame} * 7 * configurations + k;
  const auto part = [&](std::size_t i) { return p[i * configurations]; };
  return {{part(0), part(1), part(2), part(3)}, {part(4), part(5), part(6)}};
}
__device__ inline void store_frame(const FramesView& f, std::uint32_t frame, std::uint32_t k,
                                   std::uint32_t configurations, const KinematicFrame<double>& x) {
  double* p = f.numbers + std::size_t{frame} * 7 * configurations + k;
  const auto put = [&](std::size_t i, double part) { p[i * configurations] = part; };
  put(0, x.q.w);
  put(1, x.q.x);
  put(2, x.q.y);
  put(3, x.q.z);
  put(4, x.t.x);
  put(5, x.t.y);
  put(6, x.t.z);
}

// Places a robot's links in configuration k.
// \param seen called for each step with its index in the robot, the frame of the parent link, and the link's frame
struct NothingSeen {
  __device__ void operator()(std::uint32_t, const KinematicFrame<double>&, const KinematicFrame<double>&) const {}
};
template <class Seen = NothingSeen>
__device__ inline void place_links_of(const FramesView& f, std::uint32_t which, std::uint32_t k,
                                      std::uint32_t configurations, const Seen& seen = Seen()) {
  const JointRobot robot = f.robots[which];
  const JointRow row{f.columns + robot.first_column, f.positions + std::size_t{k} * f.joints};
  const auto facts = [&](std::uint32_t frame) -> std::uint8_t& {
    return f.facts[std::size_t{robot.first_frame + frame} * configurations + k];
  };
  KinematicFrame<double> last{{1, 0, 0, 0}, {0, 0, 0}};  // links are placed relative to their root
  std::uint8_t last_fact = 0;
  std::uint32_t at = 0;  // index of the frame in `last`
  for (; at < robot.roots; ++at) {
    store_frame(f, robot.first_frame + at, k, configurations, last);
    facts(at) = 0;
  }
  bool good = true;
  for (std::uint32_t i = 0; i < robot.steps; ++i) {
    const KinematicStep& step = f.steps[robot.first_step + i];
    if (step.from + 1 != at) {
      last = load_frame(f, robot.first_frame + step.from, k, configurations);
      last_fact = facts(step.from);
    }
    const KinematicFrame<double> from = last;
    last = carried(from, step, row, &good);
    seen(i, from, last);
    last_fact |= fact_of_step(step, row);
    at = robot.roots + i + 1;
    store_frame(f, robot.first_frame + at - 1, k, configurations, last);
    facts(at - 1) = last_fact;
  }
  if (good) return;
  for (std::uint32_t i = 0; i < robot.steps; ++i) facts(robot.roots + i) |= kLinkBad;  // a mimic joint is out of range
}

// Kinematics::travels() for a robot's frame in configuration k.
__device__ inline double travel_to(const FramesView& f, std::uint32_t which, std::uint32_t frame, std::uint32_t k) {
  const JointRobot robot = f.robots[which];
  const JointRow row{f.columns + robot.first_column, f.positions + std::size_t{k} * f.joints};
  double travel = 0;
  for (std::uint32_t at = frame - robot.first_frame; at >= robot.roots;) {
    const KinematicStep& step = f.steps[robot.first_step + at - robot.roots];
    const double out = travel_of(step, row);
    if (travel < out) travel = out;
    at = step.from;
  }
  return travel;
}

}  // namespace clearance::cuda
