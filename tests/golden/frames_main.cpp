// clearance-golden-frames: the bytes of requests, replies and LCM messages. A change of the contract changes lines of
// tests/golden/frames.txt.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "clearance_lcm/frame_t.hpp"
#include "clearance_lcm/joint_update_t.hpp"
#include "clearance_lcm/points_t.hpp"
#include "clearance_lcm/pose_update_t.hpp"
#include "server/base/log.h"
#include "server/lcm/lcm_translate.h"
#include "tests/client/plan_payload.h"
#include "tests/lcm/sample_query.h"
#include "tests/server/conversation.h"
#include "tests/server/sample_requests.h"
#include "tests/source_file.h"
#include "wire/shm_layout.h"

namespace clearance::golden {
namespace {

using fuzz::Conversation;
using wire::FrameType;
using Bytes = std::vector<std::byte>;

// --- values that vary between runs or machines

constexpr std::byte kMasked{0xEE};

/// Overwrites bytes of the payload, unless all of them are 0.
void mask(Bytes& frame, std::size_t at, std::size_t size = 8) {
  const auto begin = frame.begin() + static_cast<std::ptrdiff_t>(at), end = begin + static_cast<std::ptrdiff_t>(size);
  if (std::any_of(begin, end, [](std::byte b) { return b != std::byte{0}; })) std::fill(begin, end, kMasked);
}
void mask_members(Bytes& frame, std::initializer_list<std::size_t> members) {
  for (const std::size_t member : members) mask(frame, sizeof(wire::FrameHeader) + member);
}

/// Rounds the numbers of a reply; answers.csv has digests of all their bits.
void round_columns(Bytes& frame, const wire::FrameHeader& header) {
  const auto parts = wire::split_payload(header, std::span(frame).subspan(sizeof header));
  std::uint32_t joints = 0;
  const wire::ReplyHeader reply = wire::parse_reply(parts.body, parts.records, &joints);
  for (int f = 0; f < kFieldCount; ++f) {
    constexpr std::uint32_t kDoubles = kFieldDistance | kFieldLower | kFieldUpper | kFieldPoints | kFieldNormal |
                                       kFieldGradient | kFieldGradientJoints | kFieldFreeScale | kSecondOrderFields;
    if (!(reply.fields & kDoubles & 1u << f)) continue;
    std::byte* column = frame.data() + sizeof header + sizeof reply +
                        wire::column_offset(reply.rows, reply.fields, Field(1u << f), joints);
    for (std::uint64_t i = 0; i < reply.rows * field_bytes(f, joints) / sizeof(double); ++i) {
      double value;
      std::memcpy(&value, column + 8 * i, sizeof value);
      value = static_cast<double>(static_cast<float>(value));
      std::memcpy(column + 8 * i, &value, sizeof value);
    }
  }
}

/// Masks clocks, revisions (which are digests of the scene) and the daemon's epoch.
Bytes comparable(Bytes frame) {
  wire::FrameHeader header;
  std::memcpy(&header, frame.data(), sizeof header);
  mask(frame, offsetof(wire::FrameHeader, scene_revision));
  if (wire::epoch_of(header, std::span(frame).subspan(sizeof header))) mask(frame, frame.size() - 8);
  const std::size_t end = frame.size() - header.records_bytes;
  switch (static_cast<FrameType>(header.type)) {
    case FrameType::kReply:
      round_columns(frame, header);
      mask_members(frame, {offsetof(wire::ReplyHeader, scene_revision), offsetof(wire::ReplyHeader, oldest_receipt_ns),
                           offsetof(wire::ReplyHeader, pairs_evaluated), offsetof(wire::ReplyHeader, engine_ns),
                           offsetof(wire::ReplyHeader, server_ns), offsetof(wire::ReplyHeader, pose_age_ns)});
      break;
    case FrameType::kScene:
      mask_members(frame, {offsetof(wire::SceneHeader, scene_revision)});
      break;
    case FrameType::kPairTable:
      mask_members(frame, {offsetof(wire::PairsHeader, scene_revision)});
      break;
    case FrameType::kPosesDone:
      mask_members(frame, {offsetof(wire::PosesResult, scene_revision)});
      break;
    case FrameType::kSceneChanged:
      mask_members(frame, {offsetof(wire::SceneChange, scene_revision), offsetof(wire::SceneChange, seconds)});
      break;
    case FrameType::kBodyStates:
      mask_members(frame, {offsetof(wire::StatesHeader, now_ns)});
      for (std::size_t at = sizeof header + sizeof(wire::StatesHeader); at < end; at += sizeof(wire::BodyStateRecord))
        mask(frame, at + offsetof(wire::BodyStateRecord, receipt_ns));
      break;
    case FrameType::kJoints: {
      mask_members(frame, {offsetof(wire::JointsHeader, scene_revision), offsetof(wire::JointsHeader, now_ns)});
      wire::JointsHeader joints;
      std::memcpy(&joints, frame.data() + sizeof header, sizeof joints);
      for (std::uint32_t i = 0; i < joints.joint_count; ++i)
        mask(frame, sizeof header + sizeof joints + i * sizeof(wire::JointStateRecord) +
                        offsetof(wire::JointStateRecord, receipt_ns));
      break;
    }
    case FrameType::kStats:  // two counters show the layout; the set of counters is no contract
      mask(frame, offsetof(wire::FrameHeader, payload_bytes));
      frame.erase(frame.begin() + sizeof header + 2 * sizeof(wire::CounterRecord), frame.end());
      for (const std::size_t i : {0, 1})
        mask(frame, sizeof header + i * sizeof(wire::CounterRecord) + offsetof(wire::CounterRecord, value));
      break;
    case FrameType::kCertificate:  // a document with its own format
      mask(frame, offsetof(wire::FrameHeader, payload_bytes));
      frame.resize(sizeof header + 16);
      break;
    default:
      break;
  }
  return frame;
}

// --- the record

/// Lines of 32 bytes, with their offsets; lines of zeros are left out.
void write(std::ostream& out, const std::string& name, const Bytes& bytes) {
  out << "--- " << name << ", " << bytes.size() << " bytes\n";
  for (std::size_t at = 0; at < bytes.size(); at += 32) {
    const auto line = std::span(bytes).subspan(at, std::min<std::size_t>(32, bytes.size() - at));
    if (std::all_of(line.begin(), line.end(), [](std::byte b) { return b == std::byte{0}; })) continue;
    char text[24];
    std::snprintf(text, sizeof text, "%04zx", at);
    out << text;
    for (std::size_t i = 0; i < line.size(); ++i) {
      std::snprintf(text, sizeof text, "%s%02x", i % 8 ? "" : " ", std::to_integer<unsigned>(line[i]));
      out << text;
    }
    out << '\n';
  }
}

template <class Message>
void write_message(std::ostream& out, const std::string& name, const Message& message) {
  write(out, name, encode(message));
}

// --- frames

template <class Record>
Bytes record_frame(FrameType type, const Record& record) {
  return simple_frame(type, 50, std::as_bytes(std::span(&record, 1)));
}

/// Kinds of requests that sample_requests() lacks.
std::vector<std::pair<std::string, Bytes>> more_requests() {
  std::vector<std::pair<std::string, Bytes>> all;
  TestQuery query;
  query.pairs = {{0, 1}};
  all.emplace_back("certify", query.frame(40, FrameType::kCertify));
  wire::AllowRecord allow;
  allow.a = 0;
  allow.b = 2;
  all.emplace_back("allow", record_frame(FrameType::kAllow, allow));
  wire::NewBodyRecord cloud;
  wire::set_name(cloud.name, "cloud");
  cloud.shape = static_cast<std::uint8_t>(wire::BodyShape::kCloud);
  cloud.has_pose = 1;
  cloud.pose[3] = 1;
  all.emplace_back("add_cloud", record_frame(FrameType::kAddBody, cloud));
  Bytes points;
  wire::PointsHeader header;
  header.count = 2;
  header.stamp_ns = 1000;
  header.body = 9;  // small_scene(), five bodies of sample_requests(), "cloud"
  wire::append(points, header);
  for (const float x : {0.5f, 0.f, 2.f, 1.f, 1.f, 2.f}) wire::append(points, x);
  all.emplace_back("set_points", simple_frame(FrameType::kSetPoints, 41, points));
  wire::RemoveBodyRecord remove;
  wire::set_name(remove.name, "cloud");
  all.emplace_back("remove_body", record_frame(FrameType::kRemoveBody, remove));
  query.plan_configurations = 3;
  query.bodies = {1};
  all.emplace_back("open_plan", query.frame(42, FrameType::kOpenPlan));
  all.emplace_back("run_plan", record_frame(FrameType::kRunPlan, wire::PlanRecord{1, 0}));
  all.emplace_back("close_plan", record_frame(FrameType::kClosePlan, wire::PlanRecord{1, 0}));
  return all;
}

/// In an order in which one daemon can answer them: no query waits, and the named bodies exist.
std::vector<std::pair<std::string, Bytes>> ordered_requests() {
  auto all = sample_requests();
  std::stable_partition(all.begin(), all.end(), [](const auto& request) { return request.first == "poses"; });
  const auto reload = std::find_if(all.begin(), all.end(), [](const auto& r) { return r.first == "reload"; });
  const auto more = more_requests();
  all.insert(reload, more.begin(), more.end());
  return all;
}

void write_exchange(std::ostream& out, Conversation& daemon, const std::string& name, const Bytes& request) {
  write(out, name, comparable(request));
  write(out, name + ", answered", comparable(daemon.reply_to(request)));
}

void write_frames(std::ostream& out) {
  Conversation daemon(small_scene());
  for (const auto& [name, request] : ordered_requests()) write_exchange(out, daemon, name, request);

  engine::Scene scene;
  scene.add_robot("arm", {.urdf = source_file("tests/engine/robot/arm.urdf"), .home = {{{"joint4", -1.5}}}});
  Conversation arm(std::move(scene));
  Bytes positions;
  wire::PosesHeader header;
  header.count = 1;
  header.stamp_ns = 1000;
  wire::append(positions, header);
  wire::append(positions, wire::JointRecord{0, 0, 0.5});
  write_exchange(out, arm, "arm_set_joints", simple_frame(FrameType::kSetJoints, 60, positions));
  write_exchange(out, arm, "arm_joints", simple_frame(FrameType::kGetJoints, 61));
  TestQuery query;
  query.joints = {0, 3};
  query.positions = {0.1, -1.0};
  query.header.fields = kFieldStatus | kFieldPair;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  write_exchange(out, arm, "arm_query", query.frame(62));
  query.header.fields = kFieldVerdict | kFieldPair;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kAny);
  write_exchange(out, arm, "arm_check", query.frame(63));
  query.pairs = {{3, 10}, {6, 9}};
  query.header.fields = kFieldLower | kSecondOrderFields;
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kNearest);
  const std::uint32_t k = 2;
  const double velocities[] = {0.5, -0.25};
  wire::append_record(query.records, 17, wire::kRecordRequired, std::as_bytes(std::span(&k, 1)));
  wire::append_record(query.records, static_cast<std::uint16_t>(wire::QueryRecord::kVelocities), wire::kRecordRequired,
                      std::as_bytes(std::span(velocities)));
  write_exchange(out, arm, "arm_rates", query.frame(64));

  // Replies of a daemon with a GPU.
  write(out, "plan", simple_frame(FrameType::kPlan, 1, wire::plan_payload()));
  write(out, "plan_done", record_frame(FrameType::kPlanDone, wire::PlanResult{1, 5, 100'000, {}}));
  shm::Message hello;
  hello.kind = static_cast<std::uint32_t>(shm::MessageKind::kHello);
  hello.wire_version = wire::kVersion;
  Bytes greeting;
  wire::append(greeting, hello);
  write(out, "shm_hello", greeting);
}

// --- LCM

void write_queries(std::ostream& out) {
  clearance_lcm::query_t query = sample_lcm_query();
  query.request_id = 8;
  query.max_distance = 0.5;
  query.wait_for = 2;
  write_message(out, "query_t", query);
  write(out, "query_t, as a frame", query_frame_of(query));
  clearance_lcm::query_t joints{};
  joints.client_id = 7;
  joints.joint_count = 2;
  joints.joints = {"arm/joint1", "arm/joint4"};
  joints.row_count = 1;
  joints.positions = {{0.5, -1.5}};
  joints.max_evaluations = 3;
  write_message(out, "query_t of joints", joints);
  const std::uint32_t ids[] = {0, 3};
  write(out, "query_t of joints, as a frame", query_frame_of(joints, ids));
}

void write_updates(std::ostream& out) {
  clearance_lcm::pose_update_t poses{};
  poses.publisher_id = 5;
  poses.sequence = 1;
  poses.stamp_ns = 1000;
  poses.count = 1;
  poses.names = {"cup"};
  poses.poses = {{0.5, 0.25, 1, 1, 0, 0, 0}};
  write_message(out, "pose_update_t", poses);
  clearance_lcm::joint_update_t joints{};
  joints.publisher_id = 5;
  joints.count = 1;
  joints.names = {"arm/joint1"};
  joints.positions = {0.5};
  write_message(out, "joint_update_t", joints);
  clearance_lcm::points_t points{};
  points.publisher_id = 5;
  points.body = "cloud";
  points.total = points.count = points.parts = 1;
  points.xyz = {{1, 2, 3}};
  write_message(out, "points_t", points);
  auto part = frame_part(simple_frame(FrameType::kPing, 3), 0);
  part.client_id = 9;
  part.request_id = 3;
  part.sequence = 1;
  write_message(out, "frame_t", part);
}

/// Publications of the daemon, derived from its replies.
void write_publications(std::ostream& out) {
  Conversation daemon(small_scene());
  const auto answer = [&](const Bytes& request) { return comparable(daemon.reply_to(request)); };
  const Bytes nearest = answer(nearest_query_frame());
  FrameBytes reply(nearest.size());
  std::copy(nearest.begin(), nearest.end(), reply.bytes.get());
  write_message(out, "reply_t", ReplyParts(std::move(reply), 11, 12, 13)[0]);
  write_message(out, "distances_t", distances_messages(nearest, 11, 12).at(0));
  write_message(out, "scene_t", scene_messages(answer(simple_frame(FrameType::kDescribe, 1)), 11).at(0));
  write_message(out, "states_t", states_messages(answer(simple_frame(FrameType::kGetStates, 1)), 11, 12, 13).at(0));
  clearance_lcm::status_t status{};
  status.server_id = 11;
  status.sequence = 12;
  status.backend = "cpu";
  status.count = 1;
  status.names = {"lcm.gaps"};
  status.values = {3};
  write_message(out, "status_t", status);
}

// --- the program

constexpr const char* kRenew = "build/bin/clearance-golden-frames --write tests/golden/frames.txt";

int check(const std::string& path, const std::string& now) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("cannot read " + path);
  std::istringstream fresh(now);
  std::string expected, got, section;
  int different = 0;
  while (true) {
    const bool more = bool(std::getline(file, expected)), also = bool(std::getline(fresh, got));
    if (!more && !also) break;
    if (more && expected.starts_with("---")) section = expected;
    if (more && also && expected == got) continue;
    if (++different <= 10)
      std::cerr << section << "\n  recorded " << (more ? expected : "nothing") << "\n  now      "
                << (also ? got : "nothing") << '\n';
  }
  if (different > 0) std::cerr << different << " lines differ; if that is intended: " << kRenew << '\n';
  return different > 0;
}

int run(const std::string& mode, const std::string& path) {
  log::start("off");
  std::ostringstream out;
  out << "# Frames and LCM messages, in hexadecimal; lines of zeros are left out, and ee stands for what differs from "
         "run to run.\n# Written by "
      << kRenew << "\n";
  write_frames(out);
  write_queries(out);
  write_updates(out);
  write_publications(out);
  if (mode == "--check") return check(path, out.str());
  std::ofstream file(path);
  if (!(file << out.str()).flush()) throw std::runtime_error("cannot write " + path);
  return 0;
}

}  // namespace
}  // namespace clearance::golden

int main(int argc, char** argv) {
  const std::string mode = argc == 3 ? argv[1] : "";
  if (mode != "--check" && mode != "--write") {
    std::fprintf(stderr, "usage: clearance-golden-frames --check|--write FILE\n");
    return 2;
  }
  try {
    return clearance::golden::run(mode, argv[2]);
  } catch (const std::exception& error) {
    std::cerr << "clearance-golden-frames: " << error.what() << '\n';
    return 2;
  }
}
