#include "engine/robot/kinematics.h"

#include <cassert>
#include <cmath>
#include <new>

#include "engine/base/fp_environment.h"
#include "engine/base/instruction_sets.h"

namespace clearance {

namespace {

// Loads and stores one configuration at a time.
struct AloneIo {
  static constexpr std::size_t kLanes = 1;
  static double load(const double* at) { return *at; }
  static void store(double x, double* at) { *at = x; }
};

void run_alone(const KinematicBatch& batch) {
  place_batch<double, AloneIo>(batch);
}

// Doubles aligned to 64 bytes.
class Scratch {
 public:
  explicit Scratch(std::size_t doubles)
      : at_(static_cast<double*>(::operator new(doubles * sizeof(double), std::align_val_t{64}))) {}
  ~Scratch() { ::operator delete(at_, std::align_val_t{64}); }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  double* get() const { return at_; }

 private:
  double* at_;
};

}  // namespace

#ifdef CLEARANCE_LANES_X86
void run_lanes_kinematics_avx512(const KinematicBatch&);
void run_lanes_kinematics_avx2(const KinematicBatch&);
#endif
void run_lanes_kinematics_baseline(const KinematicBatch&);

std::span<const KinematicKernel> kinematic_kernels() {
  static const auto& kernels = *new std::vector<KinematicKernel>([] {  // queries may outlast main()
    std::vector<KinematicKernel> k;
#ifdef CLEARANCE_LANES_X86
    if (has_avx512_lanes()) k.push_back({"avx512", run_lanes_kinematics_avx512});
    if (has_avx2_lanes()) k.push_back({"avx2", run_lanes_kinematics_avx2});
#endif
    k.push_back({"baseline", run_lanes_kinematics_baseline});
    k.push_back({"scalar", run_alone});
    return k;
  }());
  return kernels;
}

void Kinematics::place(std::span<const double> positions, std::span<const Pose> roots, std::span<Pose> poses,
                       std::span<Status> status, const KinematicKernel& kernel) const {
  const FpEnvironment environment;
  assert(positions.size() == status.size() * columns_ && poses.size() == status.size() * links());
  assert(roots.size() == roots_.size());
  std::vector<double> unit_roots;
  for (const Pose& root : roots) {
    assert(check(root) != PoseQuality::kBad);
    const double length = detail::quaternion_norm(root);
    for (const double x : {root.qw, root.qx, root.qy, root.qz}) unit_roots.push_back(x / length);
    for (int k = 0; k < 3; ++k) unit_roots.push_back(root.translation[k]);
  }
  std::vector<std::uint8_t> bad(status.size());
  const Scratch scratch((columns_ + 7 * (roots_.size() + steps_.size())) * kMostLanes);
  kernel.run({steps_.data(), steps_.size(), unit_roots.data(), roots_.size(), positions.data(), columns_, status.size(),
              poses.data(), links(), bad.data(), scratch.get()});
  for (std::size_t k = 0; k < status.size(); ++k) {
    status[k] = bad[k] ? Status::kBadPose : Status::kOk;
    for (std::size_t r = 0; r < roots_.size(); ++r) poses[k * links() + roots_[r]] = roots[r];
  }
}

}  // namespace clearance
