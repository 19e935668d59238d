// Device queries in the memory of a daemon's GPU.
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "client/client_impl.h"

namespace clearance {

using wire::FrameType;

namespace {

DeviceQueryInfo info_of(const wire::PlanParts& parts) {
  const wire::PlanHeader& h = parts.header;
  DeviceQueryInfo info;
  info.number = h.plan;
  std::memcpy(info.memory_handle.data(), h.memory_handle, sizeof h.memory_handle);
  std::memcpy(info.device_uuid.data(), h.device_uuid, sizeof h.device_uuid);
  info.memory_bytes = h.memory_bytes;
  info.poses_offset = h.poses_offset;
  info.positions_offset = h.positions_offset;
  info.bodies = h.body_count;
  info.joints = h.joint_count;
  info.rows = h.rows;
  info.configurations = h.configurations;
  info.pairs = h.pairs;
  info.scene_revision = h.scene_revision;
  info.snapshot_revision = h.snapshot_revision;
  for (std::uint64_t i = 0; i < parts.columns.size(); ++i) {
    const wire::PlanColumnRecord column = parts.columns[i];
    info.columns.push_back({static_cast<Field>(column.field), column.row_bytes, column.offset});
  }
  return info;
}

}  // namespace

/// Opens, runs and closes a plan of the daemon. Keeps the connection open.
struct Client::Impl::OpenPlan final : DeviceQuery::Runner {
  OpenPlan(std::shared_ptr<Impl> of, const DeviceQueryInfo& info)
      : client(std::move(of)), number(info.number), scene_revision(info.scene_revision) {}

  ~OpenPlan() override {
    if (is_closed || client->connection.forked()) return;
    try {
      client->connection.forget(send(FrameType::kClosePlan));
    } catch (const std::exception&) {
      // The connection and its plan are lost.
    }
  }

  DeviceRun run(std::optional<std::chrono::nanoseconds> timeout, bool check_scene) override {
    const std::uint64_t request = send(FrameType::kRunPlan, check_scene ? scene_revision : 0);
    const auto frame = client->receive(request, FrameType::kPlanDone, timeout.value_or(client->connection.timeout()));
    const auto result = client->checked([&] { return wire::parse_plan_done(client->body_of(*frame)); });
    return {result.snapshot_revision, std::chrono::nanoseconds(result.took_ns)};
  }

  void enqueue(void*) override {
    throw std::logic_error(client->url() + ": enqueue() is for device queries of an engine");
  }

  void close() override {
    is_closed = true;
    client->receive(send(FrameType::kClosePlan), FrameType::kPlanDone);
  }

 private:
  std::uint64_t send(FrameType type, std::uint64_t revision = 0) const {
    std::vector<std::byte> payload;
    wire::append(payload, wire::PlanRecord{number, 0});
    return client->send(type, payload, sizeof(wire::FrameHeader) + sizeof(wire::PlanResult), revision);
  }

  const std::shared_ptr<Impl> client;
  const std::uint64_t number, scene_revision;
  bool is_closed = false;
};

DeviceQuery Client::Impl::open_plan(const std::shared_ptr<Impl>& self, const Query& query, const QueryExtras& extras) {
  const std::uint64_t request = self->send_query(FrameType::kOpenPlan, query, extras);
  const auto frame = self->receive(request, FrameType::kPlan);
  DeviceQueryInfo info = info_of(self->checked([&] { return wire::parse_plan(self->body_of(*frame)); }));
  auto runner = std::make_unique<OpenPlan>(self, info);
  return {std::move(runner), std::move(info)};
}

}  // namespace clearance
