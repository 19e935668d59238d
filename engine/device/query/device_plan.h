// A query whose poses and answers stay in a device's memory, for planners that live there.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/selection/query.h"

namespace clearance {

struct JobContext;
struct Plan;

/// What a plan's configurations give, in device memory. Read as the stream gets there.
struct GivenOnDevice {
  const Pose* poses = nullptr;        ///< (K, M) of the query's bodies
  const double* positions = nullptr;  ///< (K, J) radians and metres of the query's joints
};

/// Made by Engine::plan_on_device(), which has to outlive it. Rows of every configuration and pair (Reduce::kNone), or
/// one of each configuration (kMin, kAny). It keeps the snapshot that it was made for: what it does not move stays
/// where it was then.
class DevicePlan {
 public:
  virtual ~DevicePlan() = default;
  virtual const QuerySize& size() const = 0;
  /// The device's number.
  virtual int device() const = 0;
  virtual std::uint64_t scene_revision() const = 0;     ///< of the scene that it keeps
  virtual std::uint64_t snapshot_revision() const = 0;  ///< of the poses, likewise
  /// All columns of the plan in device memory of its own, which are there as long as it is.
  virtual ReplyView own_rows() = 0;
  /// Puts the query into a stream and returns: nothing waits for the host or takes memory, so it may be captured in a
  /// graph. Runs share memory: those in several streams must follow each other, which is the caller's to see to.
  /// Throws QueryError for a column that the plan was not made for, or that is not aligned, and where the device says
  /// no.
  /// \param rows columns of QuerySize::rows in device memory, those that are wanted, with `joints` where
  /// gradient_joints is among them; `compact` from a multiple of 16 bytes on. A pair that the device cannot settle has
  /// the bounds that it could prove, status kUnconverged unless these deserve a better one, and points that may be
  /// farther apart than `upper` by rounding. So has the row of a configuration for which such a pair stands: of
  /// Reduce::kAny it is kUnconverged then, and nobody has found the configuration to be free.
  /// \param stream cudaStream_t; null: the default stream
  virtual void run(const GivenOnDevice& given, const ReplyView& rows, void* stream) = 0;
  /// The same for some configurations alone, from `first` on, so that a stream never holds much at a time. Returns
  /// where the next begin: QuerySize::configurations once these were the last. `given` and `rows` are those of the
  /// whole plan.
  virtual std::uint64_t run_from(std::uint64_t first, const GivenOnDevice& given, const ReplyView& rows,
                                 void* stream) = 0;
  /// Device memory that it holds for itself, own_rows() included where they were asked for.
  virtual std::uint64_t bytes() const = 0;
};

namespace cuda {

/// Throws QueryError where a device cannot answer the plan, and names the reason.
std::unique_ptr<DevicePlan> make_device_plan(const JobContext& context, Plan&& plan);

}  // namespace cuda
}  // namespace clearance
