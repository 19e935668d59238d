// Device queries of the installed Engine.
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "engine/api/engine_impl.h"
#include "engine/device/device_error.h"
#include "engine/device/query/device_layout.h"
#include "engine/device/shared_memory.h"

namespace clearance {

namespace {

/// Calls a function that uses the device, and converts its errors to QueryError.
template <class F>
auto on_the_device(F&& f) {
  try {
    return f();
  } catch (const cuda::DeviceError& error) {
    const bool is_out_of_memory = error.kind == cuda::DeviceError::kNoMemory;
    throw engine::QueryError(is_out_of_memory ? QueryErrorCode::kTooLarge : QueryErrorCode::kNotSupported,
                             std::string("a device query: ") + error.what());
  }
}

}  // namespace

struct Engine::Impl::OpenDevice final : DeviceQuery::Runner {
  OpenDevice(std::shared_ptr<Impl> of, const QueryView& query)
      : impl(std::move(of)), engine(impl->engine()), layout(query), plan(engine->plan_on_device(query)) {
    layout.add_columns(plan->size());
    memory = std::make_unique<cuda::SharedMemory>(plan->device(), layout.bytes);
  }

  DeviceRun run(std::optional<std::chrono::nanoseconds>, bool check_scene) override {
    return translated([&] {
      const std::shared_ptr<engine::Engine> now = impl->engine();
      if (check_scene && now->scene_revision() != plan->scene_revision())
        throw engine::QueryError(QueryErrorCode::kWrongScene,
                                 "the device query is for another scene: prepare it again, or do not check the scene");
      const auto begin = std::chrono::steady_clock::now();
      on_the_device([&] {
        launch(memory->stream());
        memory->wait();
      });
      return DeviceRun{now->pose_revision(), std::chrono::steady_clock::now() - begin};
    });
  }
  void enqueue(void* stream) override {
    translated([&] { on_the_device([&] { launch(stream); }); });
  }
  void close() override {}  // by the destructor

  DeviceQueryInfo info() const {
    DeviceQueryInfo info;
    info.memory = memory->data();
    info.stream = memory->stream();
    info.memory_handle = memory->handle().ipc;
    info.device_uuid = memory->handle().uuid;
    info.memory_bytes = memory->size();
    info.positions_offset = layout.joints ? layout.positions_offset : 0;
    info.bodies = layout.bodies;
    info.joints = layout.joints;
    info.rows = layout.size.rows;
    info.configurations = layout.size.configurations;
    info.pairs = layout.size.pairs;
    layout.for_each_column([&](std::uint32_t field, std::uint32_t row_bytes, std::uint64_t offset) {
      info.columns.push_back({static_cast<Field>(field), row_bytes, offset});
    });
    info.scene_revision = plan->scene_revision();
    info.snapshot_revision = plan->snapshot_revision();
    return info;
  }

 private:
  void launch(void* stream) const { plan->run(layout.given(memory->data()), layout.rows(memory->data()), stream); }

  const std::shared_ptr<Impl> impl;
  const std::shared_ptr<engine::Engine> engine;  // of the plan, which it outlives
  DeviceLayout layout;
  const std::unique_ptr<DevicePlan> plan;
  std::unique_ptr<cuda::SharedMemory> memory;  // destroyed first, as it waits for its stream
};

DeviceQuery Engine::Impl::on_device(const std::shared_ptr<Impl>& self, const QueryView& query) {
  return on_the_device([&] {
    auto runner = std::make_unique<OpenDevice>(self, query);
    DeviceQueryInfo info = runner->info();
    return DeviceQuery(std::move(runner), std::move(info));
  });
}

}  // namespace clearance
