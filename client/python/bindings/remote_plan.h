// Plans in the memory of a daemon's GPU, for _device/remote_plan.py.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>

#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "client/client.h"
#include "client/python/bindings/connection.h"

namespace clearance::python {

class PyRemotePlan {
 public:
  PyRemotePlan(ConnectionPtr connection, DeviceQuery plan)
      : connection_(std::move(connection)), plan_(std::move(plan)) {}
  ~PyRemotePlan() {
    if (plan_) connection_->discard(std::move(*plan_));
  }
  PyRemotePlan(const PyRemotePlan&) = delete;
  PyRemotePlan& operator=(const PyRemotePlan&) = delete;

  /// Handle, UUID, and the members of DeviceQueryInfo: bytes, offsets of poses and positions, configurations, pairs, columns,
  /// revisions of scene and snapshot.
  nb::tuple info() const {
    const DeviceQueryInfo& info = plan().info();
    nb::list columns;
    for (const DeviceColumn& column : info.columns)
      columns.append(nb::make_tuple(static_cast<std::uint32_t>(column.field), column.row_bytes, column.offset));
    return nb::make_tuple(
        nb::bytes(reinterpret_cast<const char*>(info.memory_handle.data()), info.memory_handle.size()),
        nb::bytes(reinterpret_cast<const char*>(info.device_uuid.data()), info.device_uuid.size()), info.memory_bytes,
        info.poses_offset, info.positions_offset, info.configurations, info.pairs, columns, info.scene_revision,
        info.snapshot_revision);
  }

  /// Runs the plan. Returns the revision of the daemon's poses, and the time in nanoseconds.
  /// \param timeout_s by default the connection's
  std::pair<std::uint64_t, std::int64_t> run(std::optional<double> timeout_s, bool check_scene) {
    DeviceQuery& plan = this->plan();
    std::optional<std::chrono::nanoseconds> timeout;
    if (timeout_s) timeout = duration_of(*timeout_s);
    const DeviceRun run = connection_->with([&](Client&) { return plan.run(timeout, check_scene); });
    return {run.snapshot_revision, run.took.count()};
  }

  void close() {
    if (!plan_) return;
    DeviceQuery closing = std::move(*plan_);
    plan_.reset();
    connection_->with([&](Client&) { closing.close(); });
  }

 private:
  DeviceQuery& plan() {
    if (!plan_) throw nb::value_error("this plan is closed");
    return *plan_;
  }
  const DeviceQuery& plan() const { return const_cast<PyRemotePlan*>(this)->plan(); }

  ConnectionPtr connection_;
  std::optional<DeviceQuery> plan_;
};

inline void bind_remote_plan(nb::module_& m) {
  nb::class_<PyRemotePlan>(m, "RemotePlan")
      .def_prop_ro("info", &PyRemotePlan::info)
      .def("run", &PyRemotePlan::run, nb::arg("timeout_s").none(), nb::arg("check_scene"))
      .def("close", &PyRemotePlan::close);
}

}  // namespace clearance::python
