#include "client.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <optional>

#include "channel.h"
#include "connection.h"
#include "requests.h"
#include "unknown_name.h"
#include "wire/wire.h"

namespace clearance {
namespace {

using wire::FrameType;

}  // namespace

struct Client::Impl {
  Impl(std::span<const std::string> urls, const ConnectOptions& options) : connection(urls, options) {}

  const std::string& url() const { return connection.url(); }

  /// Runs a parser; what it refuses is the daemon's fault.
  template <class Parse>
  auto checked(Parse parse) const {
    try {
      return parse();
    } catch (const wire::WireError& error) {
      throw ConnectionError(url() + ": the daemon sent a malformed frame: " + error.what());
    }
  }

  /// Room for a request; throws RequestError for one that no transport takes.
  std::byte* begin(std::uint64_t payload_bytes, std::uint64_t reply_bytes) {
    const std::uint64_t bytes = sizeof(wire::FrameHeader) + payload_bytes;
    if (bytes > wire::kMaxRequestBytes)
      throw RequestError(static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge),
                         "a request of " + std::to_string(bytes) + " bytes is more than the " +
                             std::to_string(wire::kMaxRequestBytes) + " allowed: split it");
    return connection.begin(bytes, reply_bytes ? reply_bytes + wire::kEpochRecordBytes : 0);
  }

  /// What a reply says, without its records.
  std::span<const std::byte> body_of(const Frame& frame) const {
    return checked([&] { return wire::split_payload(frame.header(), frame.payload()).body; });
  }

  /// Sends a frame that is not a query and returns its request id.
  std::uint64_t send(FrameType type, std::span<const std::byte> payload, std::uint64_t reply_bytes,
                     std::uint64_t scene_revision = 0, std::vector<std::byte> records = {}) {
    return send(type, payload, {}, reply_bytes, scene_revision, std::move(records));
  }
  /// \param rest of the payload
  std::uint64_t send(FrameType type, std::span<const std::byte> payload, std::span<const std::byte> rest,
                     std::uint64_t reply_bytes, std::uint64_t scene_revision, std::vector<std::byte> records) {
    const std::uint64_t bytes = payload.size() + rest.size();
    const std::vector<std::byte>& epoch = connection.prepare();
    records.insert(records.end(), epoch.begin(), epoch.end());
    std::byte* room = begin(bytes + records.size(), reply_bytes);
    const auto header = wire::with_records(wire::make_header(type, connection.next_request_id(), bytes, scene_revision),
                                           records.size());
    std::memcpy(room, &header, sizeof header);
    room += sizeof header;
    for (const std::span<const std::byte> part : {payload, rest, std::span<const std::byte>(records)}) {
      if (!part.empty()) std::memcpy(room, part.data(), part.size());
      room += part.size();
    }
    connection.send();
    return header.request_id;
  }

  /// \param rows of kCertify; none: all
  std::uint64_t send_query(FrameType type, const Query& query,
                           std::optional<std::span<const std::uint64_t>> rows = {}) {
    wire::QueryHeader q;
    try {
      q = header_of(query);
    } catch (const wire::WireError& error) {
      throw RequestError(static_cast<std::uint16_t>(error.code), error.what());
    }
    const bool is_query = type == FrameType::kQuery, has_configurations = type != FrameType::kPairs;
    const std::uint64_t scene_revision = query.check_scene ? revision_of_ids() : 0;  // before the room: it may ask, too
    const std::uint64_t payload_bytes =
        wire::query_payload_bytes(q.pair_count, q.body_count, has_configurations ? q.configuration_count : 0);
    // Without records a query is of version 1, which every daemon answers.
    std::vector<std::byte> records = query_records(query);
    wire::insert_joint_records(records, query.joints, has_configurations ? query.positions : std::span<const double>());
    if (rows)
      wire::insert_record(records, static_cast<std::uint16_t>(wire::QueryRecord::kRows), wire::kRecordRequired,
                          std::as_bytes(*rows));
    const bool has_options = !records.empty();
    const std::vector<std::byte>& epoch = connection.prepare();
    records.insert(records.end(), epoch.begin(), epoch.end());
    std::byte* room =
        begin(payload_bytes + records.size(),
              is_query ? expected_reply_bytes(q, query.pairs, query.joints.size(), scene ? &*scene : nullptr) : 0);
    const auto header = wire::with_records(
        wire::make_header(type, connection.next_request_id(), payload_bytes, scene_revision), records.size());
    wire::write_query(room, header, q, query.pairs.data(), query.bodies.data(), query.configurations.data(), records);
    connection.send();
    sent_in_records.erase(sent_in_records.begin(), sent_in_records.lower_bound(connection.oldest_request_id()));
    if (has_options) sent_in_records[header.request_id] = options_in_records(query);
    return header.request_id;
  }

  /// What arrived, if it is of `type`; errors and malformed frames are thrown.
  std::unique_ptr<Frame> interpret(std::unique_ptr<Frame> frame, FrameType type) {
    const std::uint16_t got = frame->header().type;
    const auto sent = sent_in_records.extract(frame->header().request_id);
    if (got == static_cast<std::uint16_t>(FrameType::kError)) {
      const auto error = checked([&] { return wire::parse_error(body_of(*frame)); });
      const auto code = static_cast<wire::ErrorCode>(error.header.code);
      if (code == wire::ErrorCode::kWrongScene) scene_is_old = true;
      if (code == wire::ErrorCode::kNewEpoch) throw NewEpoch(error.header.code, url() + ": " + error.text);
      const bool is_old = sent && (code == wire::ErrorCode::kWrongVersion || code == wire::ErrorCode::kNotSupported);
      throw RequestError(error.header.code,
                         error.text + (is_old ? "; the daemon is too old for one of: " + sent.mapped() : ""));
    }
    if (got != static_cast<std::uint16_t>(type))
      throw ConnectionError(url() + ": the daemon answered with " + wire::type_name(got) + ", expected " +
                            wire::type_name(static_cast<std::uint16_t>(type)));
    return frame;
  }

  std::unique_ptr<Frame> receive(std::uint64_t request_id, FrameType type) {
    return receive(request_id, type, connection.timeout());
  }
  std::unique_ptr<Frame> receive(std::uint64_t request_id, FrameType type, std::chrono::nanoseconds limit) {
    std::unique_ptr<Frame> frame = connection.await(request_id, deadline_in(limit));
    if (!frame) {
      sent_in_records.erase(request_id);
      connection.forget(request_id);
      throw TimeoutError(url() + ": no " + wire::type_name(static_cast<std::uint16_t>(type)) + " within " +
                         seconds(limit));
    }
    return interpret(std::move(frame), type);
  }

  std::unique_ptr<Frame> call(FrameType request, std::span<const std::byte> payload, FrameType reply,
                              std::uint64_t reply_bytes, std::uint64_t scene_revision = 0) {
    return receive(send(request, payload, reply_bytes, scene_revision), reply);
  }

  /// The scene as the caller knows it from now on.
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
  /// The revision of the scene that the caller's ids are of, for a request that uses them; 0: it knows none. What
  /// somebody else has changed is refused (kWrongScene) until the caller looks at the scene again, since its ids may
  /// mean other bodies; what this client has changed itself is not, where they mean the same.
  std::uint64_t revision_of_ids() {
    if (known_revision && std::exchange(changed_by_us, false))
      if (const SceneInfo now = fetch_scene(); ids_mean_the_same(now, false))
        known_revision = poses_revision = now.revision;
    return known_revision;
  }
  /// Whether the ids that both scenes have are of bodies and groups of the same names, and if asked for of the same
  /// parents.
  bool ids_mean_the_same(const SceneInfo& now, bool parents) const;

  PosesDone send_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns,
                       std::int64_t sequence);
  PosesDone poses_done(const Frame& frame) const {
    const auto r = checked([&] { return wire::parse_poses_done(body_of(frame)); });
    return {r.revision, r.scene_revision, r.applied, r.bad, r.unknown, r.fixed};
  }

  /// \param later names what is in the records, for a daemon that does not know of it
  std::uint64_t send_with(FrameType type, std::span<const std::byte> payload, std::uint64_t revision,
                          std::vector<std::byte> records, const char* later) {
    const bool has_records = !records.empty();
    const std::uint64_t request = send(type, payload, 0, revision, std::move(records));
    if (has_records) sent_in_records[request] = later;
    return request;
  }

  /// A request that changes which pairs are enabled, and no ids.
  PosesDone change_pairs(FrameType type, std::span<const std::byte> payload, std::vector<std::byte> records = {}) {
    const std::uint64_t revision = revision_of_ids();
    const std::uint64_t request = send_with(type, payload, revision, std::move(records), "attach: allow");
    const auto frame = receive(request, FrameType::kPosesDone);
    scene_is_old = true;
    const PosesDone done = poses_done(*frame);
    if (revision) known_revision = poses_revision = done.scene_revision;
    return done;
  }

  /// A request that is answered when the daemon has another scene. \param scene_revision of the ids in it; 0: there are
  /// none.
  SceneChanged change_scene(FrameType type, std::span<const std::byte> payload, std::chrono::nanoseconds limit,
                            std::uint64_t scene_revision = 0, std::vector<std::byte> records = {}) {
    const std::uint64_t request =
        send_with(type, payload, scene_revision, std::move(records), "add_body: uncertainty, padding, max_speed, mesh");
    const auto frame = receive(request, FrameType::kSceneChanged, limit);
    scene_is_old = changed_by_us = true;
    const auto change = checked([&] { return wire::parse_scene_changed(body_of(*frame)); });
    return {change.scene_revision, change.body_count, change.body, change.seconds};
  }

  Connection connection;
  std::map<std::uint64_t, std::string> sent_in_records;  // names of such options, by request under way
  std::optional<SceneInfo> scene;                        // as the caller has seen it
  bool scene_is_old = false;         // the daemon has said so: fetched anew before the caller's next look
  bool changed_by_us = false;        // since, in a way that may have given bodies other ids
  std::uint64_t known_revision = 0;  // of the scene that the caller's ids are of; 0: it has not looked
  std::uint64_t poses_revision = 0;  // of the last one known in which they are of the same bodies with the same parents
};

SceneInfo Client::Impl::fetch_scene() {
  const auto frame = call(FrameType::kDescribe, {}, FrameType::kScene, 0);
  const auto parts = checked([&] { return wire::parse_scene(body_of(*frame)); });
  SceneInfo info;
  info.revision = parts.header.scene_revision;
  info.pair_count = parts.header.pair_count;
  info.backend = wire::name_of(parts.header.backend);
  info.bodies.reserve(parts.bodies.size());
  for (std::uint64_t i = 0; i < parts.bodies.size(); ++i) {
    const wire::BodyRecord r = parts.bodies[i];
    info.bodies.push_back({wire::name_of(r.name), r.parent, r.is_static != 0, r.piece_count, r.vertex_count,
                           r.model_error, r.extent, r.hull_excess, r.empty_share, r.triangle_count, r.is_solid != 0,
                           r.is_cloud != 0});
  }
  for (std::uint64_t i = 0; i < parts.groups.size(); ++i) {
    const wire::GroupRecord r = parts.groups[i];
    GroupInfo group{wire::name_of(r.name), {}};
    for (std::uint32_t m = 0; m < r.member_count; ++m) group.bodies.push_back(parts.members[r.first_member + m]);
    info.groups.push_back(std::move(group));
  }
  return info;
}

bool Client::Impl::ids_mean_the_same(const SceneInfo& now, bool parents) const {
  const auto same = [](const auto& then, const auto& others, auto equal) {
    return std::equal(then.begin(), then.begin() + std::min(then.size(), others.size()), others.begin(), equal);
  };
  return same(scene->bodies, now.bodies,
              [parents](const BodyInfo& a, const BodyInfo& b) {
                return a.name == b.name && (!parents || a.parent == b.parent);
              }) &&
         same(scene->groups, now.groups, [](const GroupInfo& a, const GroupInfo& b) { return a.name == b.name; });
}

PosesDone Client::Impl::send_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns,
                                   std::int64_t sequence) {
  std::vector<std::byte> payload(sizeof(wire::PosesHeader) + poses.size() * sizeof(wire::PoseRecord));
  wire::PosesHeader header;
  header.count = poses.size();
  header.stamp_ns = stamp_ns;
  header.sequence = sequence;
  std::memcpy(payload.data(), &header, sizeof header);
  std::byte* at = payload.data() + sizeof header;
  for (const auto& [body, pose] : poses) {
    wire::PoseRecord record;
    record.body = body;
    std::copy(pose.begin(), pose.end(), record.pose);
    std::memcpy(at, &record, sizeof record);
    at += sizeof record;
  }
  const auto ask = [&](std::uint64_t revision) {
    return poses_done(*call(FrameType::kSetPoses, payload, FrameType::kPosesDone, 0, revision));
  };
  revision_of_ids();
  try {
    return ask(poses_revision);
  } catch (const RequestError& error) {
    if (error.code != static_cast<std::uint16_t>(wire::ErrorCode::kWrongScene) || !scene) throw;
    // The scene changed, by an attachment perhaps. Where an id still means the same body with the same parent, so does
    // its pose, and the update can be sent again. The caller has not seen the new scene: its queries stay those for the
    // old.
    const SceneInfo now = fetch_scene();
    for (const auto& [body, pose] : poses) {
      if (body >= scene->bodies.size()) continue;
      if (body >= now.bodies.size() || now.bodies[body].name != scene->bodies[body].name ||
          now.bodies[body].parent != scene->bodies[body].parent)
        throw;
    }
    if (ids_mean_the_same(now, true)) poses_revision = now.revision;  // the next update's, too
    return ask(now.revision);
  }
}

// --- Client

Client::Client(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Client::Impl& Client::impl() const {
  if (!impl_) throw std::logic_error("this client was moved from");
  return *impl_;
}

Check Client::check(const Query& query) {
  return check_of(distances(as_check(query)));
}
Reply Client::distances(const Query& query) {
  return Reply(impl().receive(impl().send_query(FrameType::kQuery, query), FrameType::kReply));
}

Pending Client::submit(const Query& query) {
  return Pending(impl_, impl().send_query(FrameType::kQuery, query));
}

PosesDone Client::set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns,
                            std::int64_t sequence) {
  return impl().send_poses(poses, stamp_ns, sequence);
}

PosesDone Client::set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns,
                            std::int64_t sequence) {
  std::vector<std::pair<std::uint32_t, Pose7>> by_id;
  by_id.reserve(poses.size());
  for (const auto& [name, pose] : poses) by_id.emplace_back(body(name), pose);
  return impl().send_poses(by_id, stamp_ns, sequence);
}

PosesDone Client::attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child,
                         std::span<const std::uint32_t> allow) {
  wire::AttachRecord record;
  record.child = child;
  record.parent = parent;
  record.has_pose = X_parent_child != nullptr;
  if (X_parent_child) std::copy(X_parent_child->begin(), X_parent_child->end(), record.pose);
  std::vector<std::byte> records;
  if (!allow.empty())
    wire::append_record(records, static_cast<std::uint16_t>(wire::AttachTag::kAllow), wire::kRecordRequired,
                        std::as_bytes(allow));
  return impl().change_pairs(FrameType::kAttach, std::as_bytes(std::span(&record, 1)), std::move(records));
}

PosesDone Client::allow(std::uint32_t a, std::uint32_t b) {
  const wire::AllowRecord record{a, b, 1, {}};
  return impl().change_pairs(FrameType::kAllow, std::as_bytes(std::span(&record, 1)));
}
PosesDone Client::forbid(std::uint32_t a, std::uint32_t b) {
  const wire::AllowRecord record{a, b, 0, {}};
  return impl().change_pairs(FrameType::kAllow, std::as_bytes(std::span(&record, 1)));
}

PosesDone Client::set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns,
                             std::int64_t sequence) {
  std::vector<std::byte> payload;
  wire::PosesHeader header;
  header.count = positions.size();
  header.stamp_ns = stamp_ns;
  header.sequence = sequence;
  wire::append(payload, header);
  for (const auto& [joint, position] : positions) {
    wire::JointRecord record;
    record.joint = joint;
    record.position = position;
    wire::append(payload, record);
  }
  const std::uint64_t revision = impl().revision_of_ids();
  return impl().poses_done(*impl().call(FrameType::kSetJoints, payload, FrameType::kPosesDone, 0, revision));
}

PosesDone Client::set_points(std::uint32_t body, std::span<const std::array<float, 3>> xyz,
                             std::optional<double> radius, std::int64_t stamp_ns, std::int64_t sequence) {
  wire::PointsHeader header;
  header.count = xyz.size();
  header.stamp_ns = stamp_ns;
  header.sequence = sequence;
  header.radius = radius.value_or(0);
  header.has_radius = radius.has_value();
  header.body = body;
  const std::uint64_t revision = impl().revision_of_ids();
  const std::span<const std::byte> head = std::as_bytes(std::span(&header, 1));
  const std::uint64_t request = impl().send(FrameType::kSetPoints, head, std::as_bytes(xyz), 0, revision, {});
  return impl().poses_done(*impl().receive(request, FrameType::kPosesDone));
}

JointsInfo Client::joints() {
  const std::uint64_t revision = scene().revision;
  const auto frame = impl().call(FrameType::kGetJoints, {}, FrameType::kJoints, 0);
  const auto parts = impl().checked([&] { return wire::parse_joints(impl().body_of(*frame)); });
  JointsInfo info;
  info.scene_revision = parts.header.scene_revision;
  if (info.scene_revision != revision) impl().scene_is_old = true;  // ids are of the scene that the caller sees next
  for (std::uint64_t i = 0; i < parts.joints.size(); ++i) {
    const wire::JointStateRecord r = parts.joints[i];
    info.joints.push_back({wire::name_of(r.name), r.lower, r.upper, r.position, static_cast<Status>(r.status),
                           r.beyond_limits != 0, r.stamp_ns, r.receipt_ns ? parts.header.now_ns - r.receipt_ns : -1});
  }
  for (std::uint64_t i = 0; i < parts.groups.size(); ++i) {
    const wire::GroupRecord r = parts.groups[i];
    JointGroupInfo group{wire::name_of(r.name), {}};
    for (std::uint32_t m = 0; m < r.member_count; ++m) group.joints.push_back(parts.members[r.first_member + m]);
    info.groups.push_back(std::move(group));
  }
  return info;
}

SceneChanged Client::reload(Duration timeout) {
  return impl().change_scene(FrameType::kReload, {}, timeout);
}

SceneChanged Client::add_body(const NewBody& body) {
  return impl().change_scene(FrameType::kAddBody, payload_of(body), impl().connection.timeout(),
                             body.parent == kNone ? 0 : impl().revision_of_ids(), records_of(body));
}

SceneChanged Client::remove_body(std::string_view name) {
  wire::RemoveBodyRecord record;
  set_body_name(record.name, name);
  return impl().change_scene(FrameType::kRemoveBody, std::as_bytes(std::span(&record, 1)), impl().connection.timeout());
}

const SceneInfo& Client::scene() {
  return impl().get_scene();
}
void Client::refresh() {
  impl().look_at_scene();
}

std::uint32_t Client::body(std::string_view name) {
  const auto& bodies = scene().bodies;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    if (bodies[i].name == name) return static_cast<std::uint32_t>(i);
  unknown_name("body", name, bodies);
}

std::uint32_t Client::group(std::string_view name) {
  if (name == "*") return kEveryBody;
  const auto& groups = scene().groups;
  for (std::size_t i = 0; i < groups.size(); ++i)
    if (groups[i].name == name) return static_cast<std::uint32_t>(i) | kGroupBit;
  unknown_name("group", name, groups);
}

std::vector<IdPair> Client::pairs(const Query& query) {
  const auto frame = impl().receive(impl().send_query(FrameType::kPairs, query), FrameType::kPairTable);
  const auto table = impl().checked([&] { return wire::parse_pair_table(impl().body_of(*frame)); });
  std::vector<IdPair> pairs(table.pairs.size());
  if (!pairs.empty()) std::memcpy(pairs.data(), table.pairs.data(), table.pairs.size_bytes());
  return pairs;
}

std::string Client::certificate(const Query& query, std::optional<std::span<const std::uint64_t>> rows) {
  const auto frame = impl().receive(impl().send_query(FrameType::kCertify, query, rows), FrameType::kCertificate);
  const std::span<const std::byte> text = impl().body_of(*frame);
  return {reinterpret_cast<const char*>(text.data()), text.size()};
}

std::vector<BodyStateInfo> Client::body_states() {
  const auto frame = impl().call(FrameType::kGetStates, {}, FrameType::kBodyStates, 0);
  const auto parts = impl().checked([&] { return wire::parse_states(impl().body_of(*frame)); });
  std::vector<BodyStateInfo> states(parts.states.size());
  for (std::size_t i = 0; i < states.size(); ++i) {
    const wire::BodyStateRecord r = parts.states[i];
    std::copy(std::begin(r.pose), std::end(r.pose), states[i].pose.begin());
    states[i].status = static_cast<Status>(r.status);
    states[i].parent = r.parent;
    states[i].stamp_ns = r.stamp_ns;
    states[i].age_ns = r.receipt_ns ? parts.header.now_ns - r.receipt_ns : -1;
  }
  return states;
}

std::vector<std::pair<std::string, std::uint64_t>> Client::stats() {
  const auto frame = impl().call(FrameType::kGetStats, {}, FrameType::kStats, 0);
  const auto counters = impl().checked([&] { return wire::parse_stats(impl().body_of(*frame)); });
  std::vector<std::pair<std::string, std::uint64_t>> stats;
  for (std::uint64_t i = 0; i < counters.size(); ++i)
    stats.emplace_back(wire::name_of(counters[i].name), counters[i].value);
  return stats;
}

Client::Duration Client::ping(std::span<const std::byte> payload) {
  const auto start = std::chrono::steady_clock::now();
  const auto frame =
      impl().call(FrameType::kPing, payload, FrameType::kPong, sizeof(wire::FrameHeader) + payload.size());
  const Duration round_trip = std::chrono::steady_clock::now() - start;
  const auto echo = impl().body_of(*frame);
  if (!std::equal(echo.begin(), echo.end(), payload.begin(), payload.end()))
    throw ConnectionError(url() + ": the echo is not what was sent");
  return round_trip;
}

void Client::set_timeout(Duration timeout) {
  impl().connection.set_timeout(timeout);
}
std::string Client::url() const {
  return impl().url();
}
std::uint64_t Client::epoch() const {
  return impl().connection.epoch();
}
std::uint64_t Client::acknowledge_epoch() {
  return impl().connection.acknowledge_epoch();
}

// --- Pending

Pending::Pending(std::shared_ptr<Client::Impl> client, std::uint64_t request_id)
    : client_(std::move(client)), request_id_(request_id) {}
Pending::Pending(Pending&&) noexcept = default;
Pending& Pending::operator=(Pending&& other) noexcept {
  std::swap(client_, other.client_);
  std::swap(request_id_, other.request_id_);
  std::swap(frame_, other.frame_);
  return *this;
}
Pending::~Pending() {
  if (!client_ || client_->connection.forked()) return;
  client_->sent_in_records.erase(request_id_);
  if (frame_) return;
  try {
    client_->connection.forget(request_id_);
  } catch (const std::exception&) {
    // The connection is gone, and the reply with it.
  }
}

bool Pending::ready() {
  return wait_for(std::chrono::nanoseconds(0));
}

bool Pending::wait_for(std::chrono::nanoseconds timeout) {
  if (!client_) throw std::logic_error("this reply was fetched already");
  if (frame_) return true;
  // Taken as it is, so that an error frame is thrown where the answer is asked for.
  frame_ = client_->connection.await(request_id_, deadline_in(timeout));
  return frame_ != nullptr;
}

Reply Pending::get() {
  if (!client_) throw std::logic_error("this reply was fetched already");
  // Given up first: whatever is thrown, the request is over.
  const std::shared_ptr<Client::Impl> client = std::move(client_);
  if (!frame_) return Reply(client->receive(request_id_, FrameType::kReply));
  return Reply(client->interpret(std::move(frame_), FrameType::kReply));
}

Client connect(const std::string& url, std::chrono::nanoseconds timeout) {
  return connect(url, ConnectOptions{.timeout = timeout});
}

Client connect(const std::string& url, const ConnectOptions& options) {
  return connect(std::span(&url, 1), options);
}

Client connect(std::span<const std::string> urls, const ConnectOptions& options) {
  return Client(std::make_shared<Client::Impl>(urls, options));
}

}  // namespace clearance
