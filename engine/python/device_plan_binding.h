// Queries from device memory to device memory, for clearance/_device/plan.py.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <utility>
#include <vector>

#include "client/python/bindings/answer.h"
#include "client/python/bindings/gil.h"
#include "client/python/bindings/process_guard.h"
#include "engine/device/query/device_plan.h"
#include "engine/engine.h"

namespace clearance::python {

/// Addresses are plain numbers, validated by the caller.
class PyDevicePlan {
 public:
  PyDevicePlan(std::shared_ptr<engine::Engine> engine, ProcessGuard guard, std::unique_ptr<DevicePlan> plan)
      : engine_(std::move(engine)), guard_(guard), plan_(std::move(plan)) {}

  /// Configurations, pairs, Field bits.
  nb::tuple shape() const {
    const QuerySize& size = plan_->size();
    return nb::make_tuple(size.configurations, size.pairs, size.fields);
  }
  int device() const { return plan_->device(); }

  /// An address per bit of a field, or 0 without such a column.
  std::vector<std::uintptr_t> own_columns() {
    guard_.check("this plan");
    std::vector<std::uintptr_t> addresses;
    ReplyView rows = plan_->own_rows();
    for_each_column([&](auto*& column, int) { addresses.push_back(reinterpret_cast<std::uintptr_t>(column)); }, rows);
    return addresses;
  }

  void run(std::uintptr_t poses, std::uintptr_t positions, const std::vector<std::uintptr_t>& columns,
           std::uintptr_t stream) {
    guard_.check("this plan");
    ReplyView rows;
    rows.joints = plan_->size().joints;
    std::size_t bit = 0;
    for_each_column(
        [&]<class Column>(Column*& column, int) {
          const std::size_t at = bit++;
          if (at < columns.size() && columns[at] != 0) column = reinterpret_cast<Column*>(columns[at]);
        },
        rows);
    const GilRelease release;
    plan_->run({reinterpret_cast<const Pose*>(poses), reinterpret_cast<const double*>(positions)}, rows,
               reinterpret_cast<void*>(stream));
  }

 private:
  std::shared_ptr<engine::Engine> engine_;  // outlives the plan
  ProcessGuard guard_;
  std::unique_ptr<DevicePlan> plan_;
};

/// Adds the class DevicePlan and exported_array() to the module.
void bind_device_plan(nb::module_& m);

}  // namespace clearance::python
