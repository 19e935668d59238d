// Requests of most kinds: seeds of the fuzzer, and half of the recorded frames (tests/golden/frames.txt).
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/core/memory_transport.h"
#include "wire/mesh_as.h"
#include "wire/wire.h"

namespace clearance {

/// Requests by name, as a client sends them to the daemon of small_scene().
inline std::vector<std::pair<std::string, std::vector<std::byte>>> sample_requests() {
  using Data = std::vector<std::byte>;
  std::vector<std::pair<std::string, Data>> all;
  const auto query = [&](const std::string& name, auto change) {
    TestQuery q;
    change(q);
    all.emplace_back("query_" + name, q.frame(all.size() + 1));
  };
  const Pose7 here{0.2, 0.1, 0.4, 1, 0, 0, 0}, there{0.3, -0.1, 0.5, 0.9, 0.1, 0.2, 0.3};
  query("all_pairs", [](TestQuery&) {});
  query("pairs", [](TestQuery& q) { q.pairs = {{0, 1}, {1, 2}, {2, 0}}; });
  query("group_against_all", [](TestQuery& q) { q.pairs = {{kGroupBit, kEveryBody}}; });
  query("configurations_f32", [&](TestQuery& q) {
    q.bodies = {1, 2};
    q.configurations = {here, there, there, here};
    q.header.precision = 1;
    q.header.fields = kKnownFields & ~(kFieldPoints32 | kFieldPairLower | kFieldGradientJoints | kMotionFields |
                                       kFieldFreeScale | kFieldVerdict | kSecondOrderFields);
  });
  query("signed_with_points", [&](TestQuery& q) {
    q.bodies = {1};
    q.configurations = {{0, 0, 0, 1, 0, 0, 0}};
    q.header.signed_distance = 1;
    q.header.fields = kDefaultFields | kFieldPoints | kFieldNormal | kFieldGradient;
  });
  query("within", [](TestQuery& q) {
    q.header.reduce = static_cast<std::uint8_t>(Reduce::kWithin);
    q.header.max_distance = 0.3;
    q.header.max_results = 2;
  });
  query("nearest_stale", [](TestQuery& q) {
    q.header.reduce = static_cast<std::uint8_t>(Reduce::kNearest);
    q.header.fields = kDefaultFields | kFieldFlags;
    q.header.max_pose_age_ns = 1000;
  });
  query("least_float32", [&](TestQuery& q) {
    q.bodies = {1};
    q.configurations = {here, there};
    q.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
    q.header.fields = kFieldBounds | kFieldPoints32;
  });
  query("waits_for_poses", [](TestQuery& q) {
    q.header.min_pose_stamp_ns = 1000;  // of the poses below
    q.header.deadline_ns = 1'000'000'000;
    q.header.wait_for = 1;
  });
  const auto add_record = [](TestQuery& q, std::uint16_t tag, std::uint16_t flags, std::uint64_t value) {
    wire::append_record(q.records, tag, flags, std::as_bytes(std::span(&value, 1)));
  };
  query("with_a_deadline", [&](TestQuery& q) { q.header.deadline_ns = 3'600'000'000'000; });
  query("with_an_unknown_record", [&](TestQuery& q) {
    q.header.reduce = static_cast<std::uint8_t>(Reduce::kAny);
    add_record(q, 5, wire::kRecordRequired, std::bit_cast<std::uint64_t>(0.25));  // margin
    add_record(q, 500, 0, 7);
  });
  TestQuery pairs;
  pairs.bodies = {1};
  all.emplace_back("pairs", pairs.frame(20, wire::FrameType::kPairs));

  all.emplace_back("ping", simple_frame(wire::FrameType::kPing, 21, std::as_bytes(std::span("hello", 5))));
  all.emplace_back("describe", simple_frame(wire::FrameType::kDescribe, 22));
  all.emplace_back("states", simple_frame(wire::FrameType::kGetStates, 23));
  all.emplace_back("stats", simple_frame(wire::FrameType::kGetStats, 24));
  Data poses;
  wire::PosesHeader header;
  header.count = 2;
  header.stamp_ns = 1000;
  wire::append(poses, header);
  for (const std::uint32_t body : {1u, 3u}) {
    wire::PoseRecord record;
    record.body = body;
    std::copy(there.begin(), there.end(), record.pose);
    wire::append(poses, record);
  }
  all.emplace_back("poses", simple_frame(wire::FrameType::kSetPoses, 25, poses));
  all.emplace_back("joints", simple_frame(wire::FrameType::kGetJoints, 26));
  Data positions;
  wire::append(positions, header);
  for (const std::uint32_t joint : {0u, 2u}) wire::append(positions, wire::JointRecord{joint, 0, 0.5});
  all.emplace_back("set_joints", simple_frame(wire::FrameType::kSetJoints, 27, positions));
  query("in_joint_space", [&](TestQuery& q) {
    q.joints = {0, 1};
    q.positions = {0.1, 0.2, 0.3, 0.4};
  });
  wire::AttachRecord attach;
  attach.child = 1;
  attach.parent = 2;
  attach.has_pose = 1;
  std::copy(here.begin(), here.end(), attach.pose);
  const auto new_body = [&](const std::string& name, wire::BodyShape shape,
                            std::span<const wire::VertexRecord> vertices,
                            std::span<const wire::TriangleRecord> triangles = {}, MeshAs mesh_as = {}) {
    wire::NewBodyRecord record;
    wire::set_name(record.name, name);
    record.shape = static_cast<std::uint8_t>(shape);
    record.parent = 2;
    if (shape != wire::BodyShape::kHull) std::fill(std::begin(record.size), std::end(record.size), 0.1);
    record.has_pose = 1;
    std::copy(here.begin(), here.end(), record.pose);
    record.vertex_count = vertices.size();
    Data payload;
    wire::append(payload, record);
    wire::append_bytes(payload, vertices.data(), vertices.size_bytes());
    Data records;
    if (!triangles.empty()) {
      using wire::NewBodyTag;
      const auto add_tagged = [&records](NewBodyTag tag, std::span<const std::byte> bytes) {
        wire::append_record(records, static_cast<std::uint16_t>(tag), wire::kRecordRequired, bytes);
      };
      add_tagged(NewBodyTag::kTriangles, std::as_bytes(triangles));
      add_tagged(NewBodyTag::kMeshAs, std::as_bytes(std::span(&mesh_as, 1)));
    }
    const auto of_body = wire::make_header(wire::FrameType::kAddBody, all.size() + 1, payload.size());
    wire::FrameBuilder frame(wire::with_records(of_body, records.size()));
    frame.add_bytes(payload.data(), payload.size()).add_bytes(records.data(), records.size());
    all.emplace_back("add_" + name, frame.take());
  };
  new_body("capsule", wire::BodyShape::kCapsule, {});
  const wire::VertexRecord corners[] = {{{0, 0, 0}}, {{1, 0, 0}},       {{0, 1, 0}},
                                        {{0, 0, 1}}, {{0.2, 0.2, 0.2}}, {{1, 1, 1}}};
  new_body("hull", wire::BodyShape::kHull, corners);
  const wire::TriangleRecord faces[] = {{{0, 2, 1}}, {{0, 1, 3}}, {{1, 2, 3}}, {{0, 3, 2}}};
  new_body("solid", wire::BodyShape::kHull, std::span(corners).first(4), faces, MeshAs::kSolid);
  new_body("surface", wire::BodyShape::kHull, corners, std::span(faces).first(2), MeshAs::kSurface);
  new_body("mesh", wire::BodyShape::kHull, corners, faces, MeshAs::kHull);
  all.emplace_back("reload", simple_frame(wire::FrameType::kReload, 27));
  all.emplace_back("attach", simple_frame(wire::FrameType::kAttach, 26, std::as_bytes(std::span(&attach, 1))));
  return all;
}

}  // namespace clearance
