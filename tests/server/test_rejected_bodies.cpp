// New bodies that are rejected, each with its reason.
#include "tests/server/bodies_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

TEST_F(Bodies, WhatCannotBeAddedIsRejectedAndChangesNothing) {
  Loop::Options options;
  options.max_added_bodies = 2;
  options.max_added_vertices = 8;
  start_editable(small_scene(), options);
  EXPECT_NE(rejection(box_frame("cup")).find("is already that of a body"), std::string::npos);
  EXPECT_NE(rejection(box_frame("arm")).find("is already that of a group"), std::string::npos);
  EXPECT_NE(rejection(box_frame("")).find("name is empty"), std::string::npos);
  EXPECT_EQ(rejection(box_frame("x", 99)), "add_body: the parent, body 99, is not in the scene");
  const auto odd = [](auto spoil, std::size_t vertices = 0) {
    wire::NewBodyRecord record;
    wire::set_name(record.name, "odd");
    record.vertex_count = vertices;
    spoil(record);
    std::vector<std::byte> payload;
    wire::append(payload, record);
    payload.resize(payload.size() + vertices * sizeof(wire::VertexRecord));
    return simple_frame(FrameType::kAddBody, 1, payload);
  };
  EXPECT_NE(rejection(odd([](auto&) {})).find("body \"odd\""), std::string::npos) << "the hull of nothing";
  EXPECT_NE(rejection(odd([](auto& r) { r.shape = 2, r.size[0] = -1; })).find("sphere radius: expected"),
            std::string::npos);
  EXPECT_NE(rejection(odd([](auto& r) { r.shape = 2, r.size[0] = NAN; })).find("sphere radius: expected"),
            std::string::npos);
  EXPECT_NE(rejection(odd([](auto& r) { r.shape = 2, r.size[0] = 1, r.has_pose = 1; })).find("pose: expected"),
            std::string::npos)
      << "a quaternion of zeros";
  EXPECT_EQ(rejection(odd([](auto& r) { r.shape = 9; })), "new body: shape 9 is not one of 0 to 8");
  EXPECT_EQ(rejection(odd([](auto& r) { r.shape = 1; }, 1)), "new body: vertices are only for a hull");
  EXPECT_EQ(rejection(odd([](auto&) {}, 9), ErrorCode::kTooLarge),
            "add_body: 9 vertices are more than the 8 that an added body may have (limit max-added-vertices)");
  EXPECT_EQ(change(odd([](auto&) {}, 8)).body, 4u) << "eight times the origin: a point";
  change(box_frame("crate"));
  EXPECT_EQ(rejection(box_frame("one more")),
            "add_body: 2 bodies were added already, the maximum (limit max-added-bodies)");
  change(remove_frame("odd"));
  EXPECT_EQ(change(box_frame("one more")).body, 5u);
  EXPECT_EQ(a_.sinks, 0);
}

TEST_F(Bodies, AMeshThatMakesNoSenseIsRejected) {
  Loop::Options options;
  options.max_added_triangles = 4;
  start_editable(small_scene(), options);
  const auto open = std::span(kTetrahedron).first(3);
  EXPECT_EQ(rejection(mesh_frame("m", open, 4)),
            "body \"m\": mesh_as: solid: the mesh encloses no volume: the edge from (0, 0, 0) to (0, 1, 0) of triangle "
            "0 belongs to no other triangle: the mesh is open there");
  const wire::TriangleRecord beyond[] = {{{0, 1, 4}}};
  for (const std::uint8_t how : {0, 3, 4})
    EXPECT_EQ(rejection(mesh_frame("m", beyond, how)), "body \"m\": triangle 0 names the vertex 4, and there are 4");
  EXPECT_EQ(rejection(mesh_frame("m", open, 5)), "new body: mesh_as 5 is not one of 0 to 4");
  EXPECT_EQ(rejection(mesh_frame("m", {}, 4)), "new body: mesh_as is for a mesh, and there are no triangles");
  EXPECT_EQ(rejection(mesh_frame("m", open, 3, wire::BodyShape::kBox)), "new body: triangles are only for vertices");
  const std::vector<wire::TriangleRecord> many(5, kTetrahedron[0]);
  EXPECT_EQ(rejection(mesh_frame("m", many, 3), ErrorCode::kTooLarge),
            "add_body: 5 triangles are more than the 4 that an added body may have (limit max-added-triangles)");
  EXPECT_EQ(rejection(uncertain_frame("crate", std::uint64_t{0}, 21), ErrorCode::kBadFrame),
            "new body: triangles (record 21) have 8 bytes, expected 12 for each, and one at least");
  EXPECT_EQ(rejection(uncertain_frame("crate", std::uint16_t{0}, 22), ErrorCode::kBadFrame),
            "new body: mesh_as (record 22) has 2 bytes, expected 1");
  EXPECT_EQ(change(mesh_frame("m", kTetrahedron, 4)).body, 4u);
}

TEST_F(Bodies, ACloudThatMakesNoSenseIsRejected) {
  Loop::Options options;
  options.max_added_points = 2;
  start_editable(small_scene(), options);
  const auto cloud = [](std::span<const float> xyz, wire::BodyShape shape = wire::BodyShape::kCloud, double voxel = 0) {
    wire::NewBodyRecord record;
    wire::set_name(record.name, "cloud");
    record.shape = static_cast<std::uint8_t>(shape);
    record.size[0] = voxel;
    std::vector<std::byte> payload, records;
    wire::append(payload, record);
    wire::append_record(records, 23, wire::kRecordRequired, std::as_bytes(xyz));
    return extended(simple_frame(FrameType::kAddBody, 1, payload), records);
  };
  const float two[] = {0, 0, 1, 2, 3, 4}, far[] = {0, NAN, 0}, three[9] = {};
  EXPECT_EQ(rejection(cloud(std::span(two).first(2)), ErrorCode::kBadFrame),
            "new body: points (record 23) have 8 bytes, expected 12 for each");
  EXPECT_EQ(rejection(cloud(two, wire::BodyShape::kBox)), "new body: points are only for a cloud");
  EXPECT_EQ(rejection(cloud(three), ErrorCode::kTooLarge),
            "add_body: 3 points are more than the 2 that an added body may have (limit max-added-points)");
  EXPECT_NE(rejection(cloud(far)).find("body \"cloud\""), std::string::npos);
  EXPECT_NE(rejection(cloud(two, wire::BodyShape::kCloud, NAN)).find("voxel"), std::string::npos);
  const std::uint32_t body = change(cloud(two)).body;
  EXPECT_EQ(body, 4u);
  EXPECT_TRUE(is_cloud(loop_->engine().scene().bodies()[body]));
}

TEST_F(Bodies, UncertaintiesThatMakeNoSenseAreRejected) {
  start_editable(small_scene());
  const auto rejected = [&](const wire::BodyUncertaintyRecord& uncertainties, const std::string& text) {
    EXPECT_NE(rejection(uncertain_frame("crate", uncertainties)).find(text), std::string::npos) << text;
  };
  rejected({-1, 0, 0, 0}, "body \"crate\": uncertainty.position: expected a number of metres >= 0, got -1");
  rejected({NAN, 0, 0, 0}, "uncertainty.position: expected a number of metres >= 0, got nan");
  rejected({0, 4, 0, 0}, "uncertainty.angle: expected 0 to 3.2 radians, got 4");
  rejected({0, 0, INFINITY, 0}, "padding: expected a number of metres >= 0, got inf");
  rejected({0, 0, 0, -0.5}, "max_speed: expected a number of metres a second >= 0, got -0.5");
  EXPECT_EQ(rejection(uncertain_frame("crate", 1.0), ErrorCode::kBadFrame),
            "new body: uncertainty (record 20) has 8 bytes, expected 32");
  EXPECT_EQ(rejection(uncertain_frame("crate", wire::BodyUncertaintyRecord{}, 19), ErrorCode::kNotSupported),
            "new body: record 19 is required but unknown to this side");
  EXPECT_EQ(change(uncertain_frame("crate", wire::BodyUncertaintyRecord{})).body, 4u);
}

TEST_F(Bodies, WhereNoneCanBeMadeTheyAreRejected) {
  start(small_scene());
  EXPECT_EQ(rejection(box_frame("crate"), ErrorCode::kNotSupported), "bodies can be neither added nor removed here");
}

}  // namespace
}  // namespace clearance
