// Prepared queries whose input and columns are in the memory of a GPU, of this process or of a daemon.
#pragma once

#include <clearance/query.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace clearance {

/// A column in the memory of a device query.
struct DeviceColumn {
  Field field{};
  std::uint32_t row_bytes = 0;
  std::uint64_t offset = 0;  ///< a multiple of 64
};

/// The memory of a device query, and its size. Offsets are into that memory. A client maps it with
/// cudaIpcOpenMemHandle() on the device of that UUID, whose number can differ there.
struct DeviceQueryInfo {
  std::byte* memory = nullptr;                ///< of an engine: its address on the device; null for a client
  void* stream = nullptr;                     ///< of an engine: cudaStream_t of run(); null for a client
  std::uint64_t number = 0;                   ///< of a client: for direct use of the wire protocol
  std::array<std::byte, 64> memory_handle{};  ///< cudaIpcMemHandle_t
  std::array<std::byte, 16> device_uuid{};    ///< cudaUUID_t
  std::uint64_t memory_bytes = 0;
  std::uint64_t poses_offset = 0;               ///< (K, M) Pose7 of the query's bodies; valid if bodies > 0
  std::uint64_t positions_offset = 0;           ///< (K, J) float64, radians and metres; valid if joints > 0
  std::uint32_t bodies = 0, joints = 0;         ///< M, J
  std::uint64_t rows = 0;                       ///< of each column: K P, or K for a reduction
  std::uint64_t configurations = 0, pairs = 0;  ///< K (1 for the current poses), P
  std::vector<DeviceColumn> columns;            ///< in the order of Field
  std::uint64_t scene_revision = 0;             ///< of the scene, fixed when the query is opened
  std::uint64_t snapshot_revision = 0;          ///< of the other bodies' poses, fixed likewise

  /// Throws std::invalid_argument for an absent column.
  const DeviceColumn& column(Field field) const {
    const auto found = std::find_if(columns.begin(), columns.end(), [&](const auto& c) { return c.field == field; });
    if (found == columns.end())
      throw std::invalid_argument("the device query has no column of the field " +
                                  std::to_string(static_cast<std::uint32_t>(field)));
    return *found;
  }
};

/// Result of a run of a device query.
struct DeviceRun {
  std::uint64_t snapshot_revision = 0;  ///< of the current poses, not necessarily the query's
  std::chrono::nanoseconds took{0};     ///< from the first launch to the complete rows
};

/// An open device query, closed by the destructor, by close(), and with a client's connection. Not thread-safe, also
/// with respect to its client.
class DeviceQuery {
 public:
  /// Implemented by the engine and by the client. The destructor closes the query without waiting for a daemon.
  struct Runner {
    virtual ~Runner() = default;
    virtual DeviceRun run(std::optional<std::chrono::nanoseconds> timeout, bool check_scene) = 0;
    virtual void enqueue(void* stream) = 0;
    virtual void close() = 0;
  };
  DeviceQuery(std::unique_ptr<Runner> runner, DeviceQueryInfo info)
      : runner_(std::move(runner)), info_(std::move(info)) {}

  const DeviceQueryInfo& info() const { return info_; }
  /// Runs the query on the poses and positions in the memory, and returns when the rows are complete. Synchronise the
  /// stream that writes the input first, also the default one after cudaMemcpy(), which may return early. Throws as distances(); QueryError (kWrongScene) if the scene differs from the
  /// query's, and of a client RequestError (kBusy) while an earlier run that timed out here is still running.
  /// \param timeout of a client's call, by default the client's
  /// \param check_scene if false, the answer is for the query's scene
  DeviceRun run(std::optional<std::chrono::nanoseconds> timeout = {}, bool check_scene = true) {
    return runner().run(timeout, check_scene);
  }
  /// Of an engine: enqueues a run in a stream (cudaStream_t, null for the default one) and returns, so that a graph can
  /// capture it. Throws QueryError, and std::logic_error for a client.
  void enqueue(void* stream) { runner().enqueue(stream); }
  /// Closes the query and frees its memory, which must be unmapped before. Throws as run().
  void close() {
    runner();
    const std::unique_ptr<Runner> closing = std::move(runner_);  // so that the query ends even if this throws
    closing->close();
  }

 private:
  Runner& runner() const {
    if (!runner_) throw std::logic_error("this device query was closed");
    return *runner_;
  }
  std::unique_ptr<Runner> runner_;
  DeviceQueryInfo info_;
};

}  // namespace clearance
