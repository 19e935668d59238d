#include "client/client.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <thread>

#include "client/client_impl.h"
#include "wire/api/joints_named.h"
#include "wire/api/unknown_name.h"
#include "wire/api/velocities.h"

namespace clearance {

using wire::FrameType;

Client::Client(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;
Client::~Client() = default;

Client::Impl& Client::impl() const {
  if (!impl_) throw std::logic_error("this client was moved from");
  return *impl_;
}

UpdateResult Client::set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns,
                               std::int64_t sequence, std::span<const Twist6> velocities) {
  expect_velocities(velocities.size(), poses.size());
  return impl().send_poses(poses, stamp_ns, sequence, velocities);
}

UpdateResult Client::set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns,
                               std::int64_t sequence) {
  std::vector<std::pair<std::uint32_t, Pose7>> by_id;
  by_id.reserve(poses.size());
  for (const auto& [name, pose] : poses) by_id.emplace_back(body(name), pose);
  return impl().send_poses(by_id, stamp_ns, sequence, {});
}

UpdateResult Client::attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child,
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

UpdateResult Client::allow(std::uint32_t a, std::uint32_t b) {
  const wire::AllowRecord record{a, b, 1, {}};
  return impl().change_pairs(FrameType::kAllow, std::as_bytes(std::span(&record, 1)));
}
UpdateResult Client::forbid(std::uint32_t a, std::uint32_t b) {
  const wire::AllowRecord record{a, b, 0, {}};
  return impl().change_pairs(FrameType::kAllow, std::as_bytes(std::span(&record, 1)));
}

UpdateResult Client::set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns,
                                std::int64_t sequence, std::span<const double> velocities) {
  expect_velocities(velocities.size(), positions.size());
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
  const std::uint64_t request =
      impl().send(FrameType::kSetJoints, payload, {}, 0, revision, wire::velocity_records(std::as_bytes(velocities)));
  return impl().poses_done(*impl().receive(request, FrameType::kPosesDone));
}

UpdateResult Client::set_points(std::uint32_t body, std::span<const std::array<float, 3>> xyz,
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

Joints Client::joints(std::string_view group) {
  return joints_named(joint_states(), group);
}
JointsInfo Client::joint_states() {
  const std::uint64_t revision = scene().revision;
  JointsInfo info = impl().fetch_joints();
  if (info.scene_revision != revision) impl().scene_is_old = true;  // ids refer to the scene that the caller reads next
  return info;
}

const JointsInfo& Client::Impl::joints_at(std::uint64_t scene_revision, std::uint64_t snapshot_revision) {
  const bool is_known = joints && joints->scene_revision == scene_revision &&
                        (snapshot_revision == 0 || joints->joints.empty() || joints_snapshot == snapshot_revision);
  if (!is_known) {
    joints = fetch_joints();
    joints_snapshot = snapshot_revision;
  }
  return *joints;
}

JointsInfo Client::Impl::fetch_joints() {
  const auto frame = call(FrameType::kGetJoints, {}, FrameType::kJoints, 0);
  const auto parts = checked([&] { return wire::parse_joints(body_of(*frame)); });
  JointsInfo info;
  info.scene_revision = parts.header.scene_revision;
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

SceneChanged Client::replace(const NewBody& shape) {
  return impl().change_scene(FrameType::kAddBody, payload_of(shape), impl().connection.timeout(), 0,
                             records_of(shape, true));
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

bool Client::wait_covers(Duration timeout) {
  constexpr std::chrono::milliseconds kPeriod{50};
  const auto begin = std::chrono::steady_clock::now();
  while (true) {
    const auto counters = stats();
    if (std::none_of(counters.begin(), counters.end(), [](const auto& c) {
          return c.second > 0 && (c.first == "engine.covers_pending" || c.first == "engine.joint_tables_pending");
        }))
      return true;
    if (std::chrono::steady_clock::now() - begin >= timeout) return false;
    std::this_thread::sleep_for(kPeriod);
  }
}

Client::Duration Client::ping(std::span<const std::byte> payload) {
  const auto start = std::chrono::steady_clock::now();
  const auto frame =
      impl().call(FrameType::kPing, payload, FrameType::kPong, sizeof(wire::FrameHeader) + payload.size());
  const Duration round_trip = std::chrono::steady_clock::now() - start;
  const auto echo = impl().body_of(*frame);
  if (!std::equal(echo.begin(), echo.end(), payload.begin(), payload.end()))
    throw ConnectionError(url() + ": the echo differs from the request");
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
