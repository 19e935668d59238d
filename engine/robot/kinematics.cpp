#include "engine/robot/kinematics.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <new>

#include "engine/base/fp_environment.h"
#include "engine/base/instruction_sets.h"

namespace clearance {

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr Pose kNoPlace{{kNaN, kNaN, kNaN}, kNaN, kNaN, kNaN, kNaN};

// Loads and stores one configuration at a time.
struct AloneIo {
  static constexpr std::size_t kLanes = 1;
  static double load(const double* at) { return *at; }
  static void store(double x, double* at) { *at = x; }
};

// Doubles aligned to 64 bytes, in place if they are few.
class Scratch {
 public:
  explicit Scratch(std::size_t doubles)
      : at_(doubles <= kFew ? few_
                            : static_cast<double*>(::operator new(doubles * sizeof(double), std::align_val_t{64}))) {}
  ~Scratch() {
    if (at_ != few_) ::operator delete(at_, std::align_val_t{64});
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  double* get() const { return at_; }

 private:
  static constexpr std::size_t kFew = 2048;
  alignas(64) double few_[kFew];
  double* at_;
};

constexpr std::size_t padded(std::size_t count) {
  return (count + kMostLanes - 1) / kMostLanes * kMostLanes;
}

// Places one configuration, whose steps are lanes where they do not wait for one another. The bits are those of
// place_batch().
// \param scratch (9 padded(count) + 7 (root_count + count),)
void place_one(const KinematicBatch& batch, const KinematicFunctions& lanes) {
  const std::size_t width = padded(batch.count),
                    turning =
                        padded(static_cast<std::size_t>(std::count_if(batch.steps, batch.steps + batch.count, turns)));
  double *const angles = batch.scratch, *const q = angles + 2 * width, *const offsets = q + 4 * width;
  auto* const frames = reinterpret_cast<KinematicFrame<double>*>(offsets + 3 * width);
  std::fill(angles, offsets + 3 * width, 0.0);
  bool good = true;
  const auto position = [&](std::uint32_t column) { return batch.positions[column]; };
  std::size_t at = 0;
  for (std::size_t i = 0; i < batch.count; ++i) {
    const JointMove<double> move = joint_move<double>(batch.steps[i], position, &good);
    for (std::size_t k = 0; k < 3; ++k) offsets[k * width + i] = move.offset[static_cast<int>(k)];
    if (!turns(batch.steps[i])) continue;
    angles[at] = move.half_angle.value;
    angles[turning + at++] = move.half_angle.rest;
  }
  lanes.sin_cos(angles, turning);
  for (std::size_t r = 0; r < batch.root_count; ++r) {
    const double* x = batch.roots + 7 * r;
    frames[r] = {{x[0], x[1], x[2], x[3]}, {x[4], x[5], x[6]}};
  }
  at = 0;
  // Most steps follow the one before, whose frame is read from a register: one that was just stored would arrive later.
  Quaternion<double> last = frames[0].q;
  std::size_t last_frame = 0;
  for (std::size_t i = 0; i < batch.count; ++i) {
    const KinematicStep& step = batch.steps[i];
    Quaternion<double> from = last;
    if (step.from != last_frame) from = frames[step.from].q;
    for (std::size_t k = 0; const double x : {from.w, from.x, from.y, from.z}) q[k++ * width + i] = x;
    Quaternion<double> turn = step.still;
    if (turns(step)) {
      turn = detail::turn_of(step, SinCos<double>{angles[at], angles[turning + at]});
      ++at;
    }
    last_frame = batch.root_count + i;
    last = frames[last_frame].q = renormalised(product(from, turn));
  }
  lanes.turned(q, offsets, width);
  Vec3d last_t = frames[0].t;
  last_frame = 0;
  for (std::size_t i = 0; i < batch.count; ++i) {
    Vec3d from = last_t;
    if (batch.steps[i].from != last_frame) from = frames[batch.steps[i].from].t;
    last_frame = batch.root_count + i;
    KinematicFrame<double>& frame = frames[last_frame];
    last_t = frame.t = from + Vec3d{offsets[i], offsets[width + i], offsets[2 * width + i]};
    batch.poses[batch.steps[i].link] = good ? Pose{frame.t, frame.q.w, frame.q.x, frame.q.y, frame.q.z} : kNoPlace;
  }
  *batch.bad = !good;
}

}  // namespace

#ifdef CLEARANCE_LANES_X86
extern const KinematicFunctions kKinematicsAvx512, kKinematicsAvx2;
#endif
extern const KinematicFunctions kKinematicsBaseline;

std::span<const KinematicKernel> kinematic_kernels() {
  static const auto& kernels = *new std::vector<KinematicKernel>([] {  // queries may outlast main()
    std::vector<KinematicKernel> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back({"avx512", kKinematicsAvx512});
    if (has_avx2_lanes()) k.push_back({"avx2", kKinematicsAvx2});
#endif
    k.push_back({"baseline", kKinematicsBaseline});
    k.push_back({"scalar", kinematic_functions<double, AloneIo>()});
    return k;
  }());
  return kernels;
}

void Kinematics::place(std::span<const double> positions, std::span<const Pose> roots, std::span<Pose> poses,
                       std::span<Status> status, const KinematicKernel& kernel) const {
  const FpEnvironment environment;
  assert(positions.size() == status.size() * columns_ && poses.size() == status.size() * links());
  assert(roots.empty() || roots.size() == roots_.size());
  const bool is_one = status.size() == 1;
  const std::size_t frames = roots_.size() + steps_.size(),
                    doubles = is_one ? 9 * padded(steps_.size()) + 7 * frames : (columns_ + 7 * frames) * kMostLanes;
  const Scratch scratch(doubles + 7 * roots_.size());
  double* const unit_roots = scratch.get() + doubles;
  for (std::size_t r = 0; r < roots_.size(); ++r) {
    const Pose root = roots.empty() ? Pose{} : roots[r];
    assert(check(root) != PoseQuality::kBad);
    const double length = detail::quaternion_norm(root);
    double* at = unit_roots + 7 * r;
    for (const double x : {root.qw, root.qx, root.qy, root.qz}) *at++ = x / length;
    for (int k = 0; k < 3; ++k) *at++ = root.translation[k];
  }
  std::uint8_t one_bad = 0;
  std::vector<std::uint8_t> bad;
  KinematicBatch batch{steps_.data(), steps_.size(), unit_roots, roots_.size(), positions.data(), columns_,
                       status.size(), poses.data(),  links(),    &one_bad,      scratch.get()};
  if (is_one) {
    place_one(batch, kernel.of);
  } else {
    bad.resize(status.size());
    batch.bad = bad.data();
    kernel.of.place_batch(batch);
  }
  for (std::size_t k = 0; k < status.size(); ++k) {
    status[k] = batch.bad[k] ? Status::kBadPose : Status::kOk;
    for (std::size_t r = 0; r < roots_.size(); ++r) poses[k * links() + roots_[r]] = roots.empty() ? Pose{} : roots[r];
  }
}

}  // namespace clearance
