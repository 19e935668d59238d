// Implementation of Client: a connection, the pending requests, and the scene that the caller has read.
#pragma once

#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/client.h"
#include "client/connection.h"
#include "client/requests.h"
#include "wire/wire.h"

namespace clearance {

struct Client::Impl {
  Impl(std::span<const std::string> urls, const ConnectOptions& options) : connection(urls, options) {}

  const std::string& url() const { return connection.url(); }

  /// Runs a parser of the daemon's data, and converts its errors to ConnectionError.
  template <class Parse>
  auto checked(Parse parse) const {
    try {
      return parse();
    } catch (const wire::WireError& error) {
      throw ConnectionError(url() + ": the daemon sent a malformed frame: " + error.what());
    }
  }

  /// Returns memory for a request; throws RequestError beyond the maximum size of every transport.
  std::byte* begin(std::uint64_t payload_bytes, std::uint64_t reply_bytes) {
    const std::uint64_t bytes = sizeof(wire::FrameHeader) + payload_bytes;
    if (bytes > wire::kMaxRequestBytes)
      throw RequestError(static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge),
                         "a request of " + std::to_string(bytes) + " bytes is more than the " +
                             std::to_string(wire::kMaxRequestBytes) + " allowed: split it");
    return connection.begin(bytes, reply_bytes ? reply_bytes + wire::kEpochRecordBytes : 0);
  }

  /// Returns the payload of a reply without its records.
  std::span<const std::byte> body_of(const Frame& frame) const {
    return checked([&] { return wire::split_payload(frame.header(), frame.payload()).body; });
  }

  /// Sends a frame that is not a query and returns its request id.
  std::uint64_t send(wire::FrameType type, std::span<const std::byte> payload, std::uint64_t reply_bytes,
                     std::uint64_t scene_revision = 0, std::vector<std::byte> records = {}) {
    return send(type, payload, {}, reply_bytes, scene_revision, std::move(records));
  }
  /// \param rest remainder of the payload
  std::uint64_t send(wire::FrameType type, std::span<const std::byte> payload, std::span<const std::byte> rest,
                     std::uint64_t reply_bytes, std::uint64_t scene_revision, std::vector<std::byte> records) {
    const std::uint64_t bytes = payload.size() + rest.size();
    const std::vector<std::byte>& epoch = connection.prepare();
    records.insert(records.end(), epoch.begin(), epoch.end());
    std::byte* room = begin(bytes + records.size(), reply_bytes);
    const wire::FrameHeader header = connection.next_header(type, bytes, scene_revision, records.size());
    std::memcpy(room, &header, sizeof header);
    room += sizeof header;
    for (const std::span<const std::byte> part : {payload, rest, std::span<const std::byte>(records)}) {
      if (!part.empty()) std::memcpy(room, part.data(), part.size());
      room += part.size();
    }
    connection.send();
    return header.request_id;
  }

  std::uint64_t send_query(wire::FrameType type, const Query& query, const QueryExtras& extras = {}) {
    const auto& [rows, plan, revision] = extras;
    wire::QueryHeader q;
    try {
      q = header_of(query, plan);
    } catch (const wire::WireError& error) {
      throw RequestError(static_cast<std::uint16_t>(error.code), error.what());
    }
    const bool is_query = type == wire::FrameType::kQuery, has_configurations = wire::has_configurations(type);
    // Before begin(), since it can send a request.
    const std::uint64_t scene_revision = !query.check_scene ? 0 : revision ? *revision : revision_of_ids();
    const std::uint64_t payload_bytes =
        wire::query_payload_bytes(q.pair_count, q.body_count, has_configurations ? q.configuration_count : 0);
    RecordList records(query_records(query));
    add_inputs(query, has_configurations, records);
    if (rows) records.insert(wire::QueryRecord::kRows, std::as_bytes(*rows));
    records.append(connection.prepare());
    const std::uint64_t records_bytes = records.bytes();
    std::uint64_t reply_bytes = 0;
    if (is_query)
      reply_bytes = expected_reply_bytes(q, query.pairs, query.joints.size(), scene ? &*scene : nullptr, query.k);
    if (plan)
      reply_bytes = sizeof(wire::FrameHeader) + sizeof(wire::PlanHeader) +
                    std::size_t{kFieldCount} * sizeof(wire::PlanColumnRecord);
    std::byte* room = begin(payload_bytes + records_bytes, reply_bytes);
    const wire::FrameHeader header = connection.next_header(type, payload_bytes, scene_revision, records_bytes);
    wire::write_query(room, header, q, query.pairs.data(), query.bodies.data(), query.configurations.data());
    records.write(room + sizeof header + payload_bytes);
    connection.send();
    return header.request_id;
  }

  /// Returns the frame if it has `type`; throws for error frames and malformed ones.
  std::unique_ptr<Frame> interpret(std::unique_ptr<Frame> frame, wire::FrameType type) {
    const std::uint16_t got = frame->header().type;
    if (got == static_cast<std::uint16_t>(wire::FrameType::kError)) {
      const auto error = checked([&] { return wire::parse_error(body_of(*frame)); });
      const auto code = static_cast<wire::ErrorCode>(error.header.code);
      if (code == wire::ErrorCode::kWrongScene) scene_is_old = true;
      if (code == wire::ErrorCode::kNewEpoch) throw NewEpoch(error.header.code, url() + ": " + error.text);
      throw RequestError(error.header.code, error.text);
    }
    if (got != static_cast<std::uint16_t>(type))
      throw ConnectionError(url() + ": the daemon answered with " + wire::type_name(got) + ", expected " +
                            wire::type_name(static_cast<std::uint16_t>(type)));
    return frame;
  }

  std::unique_ptr<Frame> receive(std::uint64_t request_id, wire::FrameType type) {
    return receive(request_id, type, connection.timeout());
  }
  std::unique_ptr<Frame> receive(std::uint64_t request_id, wire::FrameType type, std::chrono::nanoseconds limit) {
    std::unique_ptr<Frame> frame = connection.await(request_id, deadline_in(limit));
    if (!frame) {
      connection.forget(request_id);
      throw TimeoutError(url() + ": no " + wire::type_name(static_cast<std::uint16_t>(type)) + " within " +
                         seconds(limit));
    }
    return interpret(std::move(frame), type);
  }

  std::unique_ptr<Frame> call(wire::FrameType request, std::span<const std::byte> payload, wire::FrameType reply,
                              std::uint64_t reply_bytes, std::uint64_t scene_revision = 0) {
    return receive(send(request, payload, reply_bytes, scene_revision), reply);
  }

  /// Returns the scene to which the caller's ids refer from now on.
  const SceneInfo& get_scene() {
    if (!scene || scene_is_old) look_at_scene();
    return *scene;
  }
  void look_at_scene() {
    scene = fetch_scene();
    scene_is_old = changed_by_us = false;
    known_revision = poses_revision = scene->revision;
  }
  SceneInfo fetch_scene();
  JointsInfo fetch_joints();
  /// Returns the cached joints of a scene with their limits.
  /// \param snapshot_revision snapshot of their positions; 0 for any
  const JointsInfo& joints_at(std::uint64_t scene_revision, std::uint64_t snapshot_revision);
  /// Returns the revision of the scene of the caller's ids, for a request that uses them, or 0. After a change by
  /// another client, requests are rejected (kWrongScene) until the caller reads the scene again, since ids can refer to
  /// other bodies. After a change by this client, they are accepted if ids are unchanged.
  std::uint64_t revision_of_ids() {
    if (known_revision && std::exchange(changed_by_us, false))
      if (const SceneInfo now = fetch_scene(); ids_mean_the_same(now, false))
        known_revision = poses_revision = now.revision;
    return known_revision;
  }
  /// Whether the ids common to both scenes have the same names of bodies and groups and, with `parents`, the same
  /// parents.
  bool ids_mean_the_same(const SceneInfo& now, bool parents) const;

  UpdateResult send_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns,
                          std::int64_t sequence, std::span<const Twist6> velocities);
  UpdateResult poses_done(const Frame& frame) const {
    const auto r = checked([&] { return wire::parse_poses_done(body_of(frame)); });
    return {r.revision, r.scene_revision, r.applied, r.bad, r.unknown, r.fixed};
  }

  /// Sends a request that changes the enabled pairs but no ids.
  UpdateResult change_pairs(wire::FrameType type, std::span<const std::byte> payload,
                            std::vector<std::byte> records = {}) {
    const std::uint64_t revision = revision_of_ids();
    const auto frame = receive(send(type, payload, 0, revision, std::move(records)), wire::FrameType::kPosesDone);
    scene_is_old = true;
    const UpdateResult done = poses_done(*frame);
    if (revision) known_revision = poses_revision = done.scene_revision;
    return done;
  }

  /// Sends a request that is answered when the daemon has a new scene.
  /// \param scene_revision scene of its ids; 0 without ids
  SceneChanged change_scene(wire::FrameType type, std::span<const std::byte> payload, std::chrono::nanoseconds limit,
                            std::uint64_t scene_revision = 0, std::vector<std::byte> records = {}) {
    const std::uint64_t request = send(type, payload, 0, scene_revision, std::move(records));
    const auto frame = receive(request, wire::FrameType::kSceneChanged, limit);
    scene_is_old = changed_by_us = true;
    const auto change = checked([&] { return wire::parse_scene_changed(body_of(*frame)); });
    return {change.scene_revision, change.body_count, change.body, change.seconds};
  }

  struct Request;   // a pending query: client_pending.cpp
  struct Prepared;  // a prepared query: client_prepared.cpp
  struct OpenPlan;  // a device query: client_device.cpp
  /// \param extras with the number of configurations
  static DeviceQuery open_plan(const std::shared_ptr<Impl>& self, const Query& query, const QueryExtras& extras);
  static Pending submit(const std::shared_ptr<Impl>& self, const Query& query, WhenDone when_done,
                        const QueryExtras& extras = {});

  Connection connection;
  std::optional<SceneInfo> scene;    // the scene that the caller has read
  std::optional<JointsInfo> joints;  // cache of joints_at()
  std::uint64_t joints_snapshot = 0;
  bool scene_is_old = false;         // reported by the daemon; the caller's next read fetches it again
  bool changed_by_us = false;        // whether this client has since made a change that can alter ids
  std::uint64_t known_revision = 0;  // revision of the scene of the caller's ids, or 0
  std::uint64_t poses_revision = 0;  // last known revision in which these ids have the same bodies and parents
};

}  // namespace clearance
