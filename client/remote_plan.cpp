// Plans in the memory of a daemon's GPU.
#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "client/client.h"
#include "client/client_impl.h"

namespace clearance {

using wire::FrameType;

/// The connection that opens, runs and closes the plan, which keeps it open.
struct RemotePlan::Connection {
  std::shared_ptr<Client::Impl> client;

  static std::vector<std::byte> payload(std::uint64_t number) {
    std::vector<std::byte> bytes;
    wire::append(bytes, wire::PlanRecord{number, 0});
    return bytes;
  }
  std::uint64_t send(FrameType type, std::uint64_t number, std::uint64_t scene_revision = 0) const {
    return client->send(type, payload(number), sizeof(wire::FrameHeader) + sizeof(wire::PlanResult), scene_revision);
  }
};

const PlanColumn& PlanInfo::column(Field field) const {
  const auto found = std::ranges::find(columns, field, &PlanColumn::field);
  if (found == columns.end())
    throw std::invalid_argument("the plan has no column of the field " +
                                std::to_string(static_cast<std::uint32_t>(field)));
  return *found;
}

RemotePlan Client::plan_on_device(const Query& query, std::uint32_t configurations) {
  const std::uint64_t request = impl().send_query(FrameType::kOpenPlan, query, {.plan = configurations});
  const auto frame = impl().receive(request, FrameType::kPlan);
  const wire::PlanParts parts = impl().checked([&] { return wire::parse_plan(impl().body_of(*frame)); });
  const wire::PlanHeader& h = parts.header;
  PlanInfo info;
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
  return RemotePlan(std::make_shared<RemotePlan::Connection>(RemotePlan::Connection{impl_}), std::move(info));
}

RemotePlan::RemotePlan(std::shared_ptr<Connection> connection, PlanInfo info)
    : connection_(std::move(connection)), info_(std::move(info)) {}
RemotePlan::RemotePlan(RemotePlan&&) noexcept = default;
RemotePlan& RemotePlan::operator=(RemotePlan&& other) noexcept {
  std::swap(connection_, other.connection_);
  std::swap(info_, other.info_);
  return *this;
}

RemotePlan::~RemotePlan() {
  if (!connection_ || connection_->client->connection.forked()) return;
  try {
    connection_->client->connection.forget(connection_->send(FrameType::kClosePlan, info_.number));
  } catch (const std::exception&) {
    // The connection and its plan are lost.
  }
}

PlanRun RemotePlan::run(std::optional<std::chrono::nanoseconds> timeout, bool check_scene) {
  if (!connection_) throw std::logic_error("this plan was closed");
  Client::Impl& client = *connection_->client;
  const std::uint64_t request =
      connection_->send(FrameType::kRunPlan, info_.number, check_scene ? info_.scene_revision : 0);
  const auto frame = client.receive(request, FrameType::kPlanDone, timeout.value_or(client.connection.timeout()));
  const auto result = client.checked([&] { return wire::parse_plan_done(client.body_of(*frame)); });
  return {result.snapshot_revision, std::chrono::nanoseconds(result.took_ns)};
}

void RemotePlan::close() {
  if (!connection_) throw std::logic_error("this plan was closed");
  // Released first, so that the plan ends even if this throws.
  const std::shared_ptr<Connection> connection = std::move(connection_);
  connection->client->receive(connection->send(FrameType::kClosePlan, info_.number), FrameType::kPlanDone);
}

}  // namespace clearance
