// A device query: its poses and answers stay in device memory, for planners that run there.
#pragma once

#include <cstdint>
#include <memory>

#include "engine/selection/query.h"

namespace clearance {

struct JobContext;
struct Plan;

/// Input of a device query's configurations, in device memory. Read when the stream reaches it.
struct GivenOnDevice {
  const Pose* poses = nullptr;        ///< (K, M) of the query's bodies
  const double* positions = nullptr;  ///< (K, J) radians and metres of the query's joints
};

/// Created by Engine::plan_on_device(); the engine must outlive it. Gives a row per configuration and pair
/// (Reduce::kNone) or per configuration (kMin, kAny). Bodies that it does not move keep their poses of the snapshot it
/// was made with.
class DevicePlan {
 public:
  virtual ~DevicePlan() = default;
  virtual const QuerySize& size() const = 0;
  /// The device's number.
  virtual int device() const = 0;
  virtual std::uint64_t scene_revision() const = 0;     ///< of its scene
  virtual std::uint64_t snapshot_revision() const = 0;  ///< of its snapshot's poses
  /// All columns of the query in its own device memory, valid during its lifetime.
  virtual ReplyView own_rows() = 0;
  /// Enqueues the query and returns. Nothing waits for the host or allocates memory, so a graph can capture it. Runs
  /// share memory: the caller must order runs in different streams.
  ///
  /// A pair that the device cannot resolve gets the bounds it could prove, points that rounding may place farther apart
  /// than `upper`, and status kUnconverged unless the bounds allow a better one. The same holds for a configuration's
  /// row that depends on such a pair; for Reduce::kAny its status is then kUnconverged and it is not proved free.
  ///
  /// Throws QueryError for a column that the query was not made for or that is misaligned, and if the device fails.
  /// \param rows columns of QuerySize::rows in device memory, null if not wanted; `joints` with gradient_joints;
  /// float32 columns aligned to 8 bytes
  /// \param stream cudaStream_t; null for the default stream
  virtual void run(const GivenOnDevice& given, const ReplyView& rows, void* stream) = 0;
  /// Enqueues some configurations only, starting at `first`, which limits the work in the stream. Returns the next
  /// `first`, QuerySize::configurations at the end. `given` and `rows` are those of the whole query.
  virtual std::uint64_t run_from(std::uint64_t first, const GivenOnDevice& given, const ReplyView& rows,
                                 void* stream) = 0;
  /// Device memory it holds, including own_rows() if requested.
  virtual std::uint64_t bytes() const = 0;
};

namespace cuda {

/// Throws QueryError with the reason if a device cannot answer the query.
std::unique_ptr<DevicePlan> make_device_plan(const JobContext& context, Plan&& plan);

}  // namespace cuda
}  // namespace clearance
