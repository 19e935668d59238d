// Device queries of a daemon, whose input and columns are in the memory of its GPU.
#pragma once

#include <clearance/query.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace clearance {

/// A column in a plan's memory.
struct PlanColumn {
  Field field{};
  std::uint32_t row_bytes = 0;
  std::uint64_t offset = 0;  ///< a multiple of 64
};

/// A plan in the memory of a daemon's GPU. Another process maps the memory with cudaIpcOpenMemHandle() on the device of
/// that UUID, whose number can differ there. Offsets are into that memory.
struct PlanInfo {
  std::uint64_t number = 0;                   ///< for direct use of the wire protocol
  std::array<std::byte, 64> memory_handle{};  ///< cudaIpcMemHandle_t
  std::array<std::byte, 16> device_uuid{};    ///< cudaUUID_t
  std::uint64_t memory_bytes = 0;
  std::uint64_t poses_offset = 0;               ///< (K, M) Pose7 of the query's bodies; valid if bodies > 0
  std::uint64_t positions_offset = 0;           ///< (K, J) float64, radians and metres; valid if joints > 0
  std::uint32_t bodies = 0, joints = 0;         ///< M, J
  std::uint64_t rows = 0;                       ///< of each column: K P, or K for a reduction
  std::uint64_t configurations = 0, pairs = 0;  ///< K (1 for the current poses), P
  std::vector<PlanColumn> columns;              ///< in the order of Field
  std::uint64_t scene_revision = 0;             ///< of the scene, fixed when the plan is opened
  std::uint64_t snapshot_revision = 0;          ///< of the other bodies' poses, fixed likewise

  /// Throws std::invalid_argument for an absent column.
  const PlanColumn& column(Field field) const;
};

/// Result of a run of a plan.
struct PlanRun {
  std::uint64_t snapshot_revision = 0;  ///< of the daemon's current poses, not necessarily the plan's
  std::chrono::nanoseconds took{0};     ///< time in the daemon, from the first launch to the complete rows
};

/// An open plan of this client, closed by the destructor, by close(), and with the client's connection. Not
/// thread-safe, also with respect to its client.
class CLEARANCE_API RemotePlan {
 public:
  RemotePlan(RemotePlan&&) noexcept;
  RemotePlan& operator=(RemotePlan&&) noexcept;
  ~RemotePlan();  ///< closes the plan without waiting

  const PlanInfo& info() const { return info_; }
  /// Runs the query on the poses and positions in the memory, and returns when the rows are complete. Synchronise the
  /// stream that writes the input first. Throws as Client::distances(); RequestError (kWrongScene) if the daemon's
  /// scene differs from the plan's, and (kBusy) while an earlier run that timed out here is still running.
  /// \param timeout of this call, by default the client's
  /// \param check_scene whether to check the daemon's scene; if false, the answer is for the plan's scene
  PlanRun run(std::optional<std::chrono::nanoseconds> timeout = {}, bool check_scene = true);
  /// Closes the plan and frees its memory, which must be unmapped before. Throws as run().
  void close();

 private:
  friend class Client;
  struct Connection;
  explicit RemotePlan(std::shared_ptr<Connection> connection, PlanInfo info);
  std::shared_ptr<Connection> connection_;
  PlanInfo info_;
};

}  // namespace clearance
