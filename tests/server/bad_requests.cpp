#include "tests/server/bad_requests.h"

#include <cmath>
#include <limits>

#include "tests/server/core/memory_transport.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

class List {
 public:
  /// A frame whose header `change` modifies.
  template <class Change>
  void frame(const std::string& name, const std::vector<std::byte>& frame, ErrorCode code, const std::string& text,
             Change change) {
    BadRequest request;
    request.name = name;
    std::memcpy(&request.header, frame.data(), sizeof request.header);
    request.payload.assign(frame.begin() + sizeof request.header, frame.end());
    request.code = code;
    request.text = text;
    change(request.header);
    requests.push_back(std::move(request));
  }
  void frame(const std::string& name, const std::vector<std::byte>& bytes, ErrorCode code, const std::string& text) {
    frame(name, bytes, code, text, [](wire::FrameHeader&) {});
  }
  /// A query whose header is changed after it was built, so that counts and contents may disagree.
  template <class Change>
  void query(const std::string& name, const TestQuery& query, ErrorCode code, const std::string& text, Change change) {
    std::vector<std::byte> bytes = query.frame(7);
    wire::QueryHeader header;
    std::memcpy(&header, bytes.data() + sizeof(wire::FrameHeader), sizeof header);
    change(header);
    std::memcpy(bytes.data() + sizeof(wire::FrameHeader), &header, sizeof header);
    frame(name, bytes, code, text);
  }
  void query(const std::string& name, const TestQuery& q, ErrorCode code, const std::string& text) {
    query(name, q, code, text, [](wire::QueryHeader&) {});
  }

  std::vector<BadRequest> requests;
};

TestQuery pairs_query(std::vector<IdPair> pairs) {
  TestQuery query;
  query.pairs = std::move(pairs);
  return query;
}

/// A body without configurations, and errors of velocities that nothing has.
TestQuery speed_errors_query() {
  TestQuery query;
  query.bodies = {1};
  query.header.all_pairs = 1;
  query.header.fields = kFieldRateBounds;
  const double errors[] = {0.1, 0.1};
  wire::append_record(query.records, static_cast<std::uint16_t>(wire::QueryRecord::kSpeedErrors), wire::kRecordRequired,
                      std::as_bytes(std::span(errors)));
  return query;
}

TestQuery moved_query(std::vector<std::uint32_t> bodies) {
  TestQuery query;
  query.configurations.resize(bodies.size(), Pose7{0, 0, 1, 1, 0, 0, 0});
  query.bodies = std::move(bodies);
  return query;
}

/// A frame of a payload with an arbitrary size.
template <class Record>
std::vector<std::byte> record_frame(FrameType type, const Record& record, std::size_t extra = 0,
                                    std::uint64_t scene_revision = 0) {
  const std::vector<std::byte> zeros(extra);
  return wire::FrameBuilder(wire::make_header(type, 7, 0, scene_revision))
      .add(record)
      .add_bytes(zeros.data(), extra)
      .take();
}

void add_frames(List& list) {
  const auto ping = simple_frame(FrameType::kPing, 7, std::vector<std::byte>(24));
  list.frame("wrong magic", ping, ErrorCode::kBadFrame, "frame: magic is 0x46495245, expected 0x31524c43",
             [](auto& h) { h.magic = 0x46495245; });
  list.frame("wrong version", ping, ErrorCode::kWrongVersion, "frame: version 9, this side speaks version 1",
             [](auto& h) { h.version = 9; });
  list.frame("payload shorter than said", ping, ErrorCode::kBadFrame,
             "frame: the header announces a payload of 25 bytes, 24 came", [](auto& h) { h.payload_bytes = 25; });
  list.frame("payload longer than said", ping, ErrorCode::kBadFrame,
             "frame: the header announces a payload of 0 bytes, 24 came", [](auto& h) { h.payload_bytes = 0; });
  list.frame("absurd payload", ping, ErrorCode::kBadFrame,
             "frame: a payload of 18446744073709551615 bytes is more than the 2147483584 allowed",
             [](auto& h) { h.payload_bytes = ~std::uint64_t{0}; });
  list.frame("reserved words of the frame", ping, ErrorCode::kBadFrame, "frame: reserved words must be 0",
             [](auto& h) { h.reserved[0] = 1; });
  list.frame("unknown type", ping, ErrorCode::kUnknownType, "frame: type 99 is no request",
             [](auto& h) { h.type = 99; });
  list.frame("a reply as a request", ping, ErrorCode::kUnknownType, "frame: type kReply is no request",
             [](auto& h) { h.type = static_cast<std::uint16_t>(FrameType::kReply); });
  for (const auto& [name, type] : {std::pair{"kDescribe", FrameType::kDescribe},
                                   {"kGetStates", FrameType::kGetStates},
                                   {"kGetStats", FrameType::kGetStats}})
    list.frame(std::string(name) + " with a payload", simple_frame(type, 7, std::vector<std::byte>(8)),
               ErrorCode::kBadFrame, "a " + std::string(name) + " frame has no payload, got 8 bytes");
}

void add_query_sizes(List& list) {
  list.frame("query without a header", simple_frame(FrameType::kQuery, 7), ErrorCode::kBadFrame,
             "query: the payload has 0 bytes, fewer than its header of 128");
  list.frame("query cut in its header", simple_frame(FrameType::kQuery, 7, std::vector<std::byte>(100)),
             ErrorCode::kBadFrame, "query: the payload has 100 bytes, fewer than its header of 128");
  list.query("fewer pairs than said", pairs_query({{0, 1}, {0, 2}}), ErrorCode::kBadFrame,
             "query: 3 pairs, 0 bodies and 0 configurations need a payload of 152 bytes, got 144",
             [](auto& q) { q.pair_count = 3; });
  list.query("more pairs than said", pairs_query({{0, 1}, {0, 2}}), ErrorCode::kBadFrame,
             "query: 1 pairs, 0 bodies and 0 configurations need a payload of 136 bytes, got 144",
             [](auto& q) { q.pair_count = 1; });
  list.query("fewer configurations than said", moved_query({1}), ErrorCode::kBadFrame,
             "query: 0 pairs, 1 bodies and 2 configurations need a payload of 248 bytes, got 192",
             [](auto& q) { q.configuration_count = 2; });
  list.query("absurd counts", moved_query({1}), ErrorCode::kBadFrame,
             "query: 4294967295 pairs, 4294967295 bodies and 4294967295 configurations need a payload of more than "
             "2^64 bytes, got 192",
             [](auto& q) { q.pair_count = q.body_count = q.configuration_count = ~0u; });
  list.query("reserved words of the query", TestQuery(), ErrorCode::kBadFrame, "query: reserved words must be 0",
             [](auto& q) { q.reserved[0] = 1; });
  TestQuery too_large = moved_query({1});
  too_large.configurations.resize(200, too_large.configurations[0]);
  too_large.pairs.resize(65536, IdPair{0, 1});
  too_large.header.fields = kDefaultFields | kFieldGradient | kFieldPoints;
  list.query("more than a frame may hold", too_large, ErrorCode::kTooLarge, "reply: 13107200 rows need 2");
}

void add_query_values(List& list, std::uint64_t scene_revision) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const auto value = [&list](const std::string& name, const std::string& text, auto change) {
    list.query(name, TestQuery(), ErrorCode::kBadQuery, text, change);
  };
  value("max_distance NaN", "query: max_distance must be a number of metres >= 0, got nan",
        [&](auto& q) { q.max_distance = nan; });
  value("max_distance negative", "query: max_distance must be a number of metres >= 0, got -0.5",
        [](auto& q) { q.max_distance = -0.5; });
  value("abs_tol NaN", "query: abs_tol must be a finite number of metres >= 0, got nan",
        [&](auto& q) { q.abs_tol = nan; });
  value("abs_tol infinite", "query: abs_tol must be a finite number of metres >= 0, got inf",
        [&](auto& q) { q.abs_tol = inf; });
  value("rel_tol NaN", "query: rel_tol must be finite, got nan", [&](auto& q) { q.rel_tol = nan; });
  value("rel_tol 1", "rel_tol: expected a ratio below 1, got 1.0", [](auto& q) { q.rel_tol = 1; });
  value("precision", "query: precision 3 is not one of 0 to 1", [](auto& q) { q.precision = 3; });
  value("signed_distance", "query: signed_distance 2 is not one of 0 to 1", [](auto& q) { q.signed_distance = 2; });
  value("reduce", "query: reduce 7 is not one of 0 to 4", [](auto& q) { q.reduce = 7; });
  value("fields", "query: fields has unknown bits: 2147483648", [](auto& q) { q.fields |= 1u << 31; });
  value("max_pose_age_ns", "query: max_pose_age_ns must be >= 0, got -5", [](auto& q) { q.max_pose_age_ns = -5; });
  value("configurations without bodies", "query: 4 configurations of no bodies and no joints",
        [](auto& q) { q.configuration_count = 4; });
  list.query("all pairs and some", pairs_query({{0, 1}}), ErrorCode::kBadQuery,
             "query: all_pairs is set, yet 1 pairs are named", [](auto& q) { q.all_pairs = 1; });
  list.query("unknown group", pairs_query({{0, 1}, {kGroupBit | 5, 0}}), ErrorCode::kBadQuery,
             "pairs[1]: unknown group 5; the scene has 1");
  list.query("a body with itself", pairs_query({{2, 2}}), ErrorCode::kBadQuery, "pairs[0]: body 2 with itself");
  list.query("unknown moved body", moved_query({1, 40}), ErrorCode::kBadQuery, "bodies[1]: unknown body 40");
  list.query("static moved body", moved_query({0}), ErrorCode::kBadQuery,
             "bodies[0]: 'table' is static and cannot be moved");
  list.query("body moved twice", moved_query({1, 2, 1}), ErrorCode::kBadQuery, "bodies[2]: 'cup' is named twice");
  list.query("errors of the velocities of no configurations", speed_errors_query(), ErrorCode::kBadQuery,
             "speed_errors: only with configurations");
  TestQuery wrong_scene;
  wrong_scene.scene_revision = scene_revision + 1;
  list.query("query for another scene", wrong_scene, ErrorCode::kWrongScene,
             "the scene is revision " + std::to_string(scene_revision) + ", the query is for " +
                 std::to_string(scene_revision + 1));
  list.frame("pairs with configurations", moved_query({1}).frame(7), ErrorCode::kBadFrame,
             "query: 0 pairs, 1 bodies and 0 configurations need a payload of 136 bytes, got 192",
             [](auto& h) { h.type = static_cast<std::uint16_t>(FrameType::kPairs); });
}

void add_moves(List& list, std::uint64_t scene_revision) {
  wire::PosesHeader poses;
  list.frame("poses without a header", simple_frame(FrameType::kSetPoses, 7, std::vector<std::byte>(31)),
             ErrorCode::kBadFrame, "poses: the payload has 31 bytes, fewer than its header of 32");
  poses.count = 2;
  list.frame("fewer poses than said", record_frame(FrameType::kSetPoses, poses, sizeof(wire::PoseRecord)),
             ErrorCode::kBadFrame, "poses: 2 poses need a payload of 160 bytes, got 96");
  poses.count = std::uint64_t{1} << 58;
  list.frame("absurd count of poses", record_frame(FrameType::kSetPoses, poses), ErrorCode::kBadFrame,
             "poses: 288230376151711744 poses need a payload of more than 2^64 bytes, got 32");
  poses.count = 1;
  list.frame("poses for another scene",
             record_frame(FrameType::kSetPoses, poses, sizeof(wire::PoseRecord), scene_revision + 1),
             ErrorCode::kWrongScene,
             "the request is for scene revision " + std::to_string(scene_revision + 1) + ", the daemon's is " +
                 std::to_string(scene_revision) + ": fetch the scene again");
  poses.reserved[0] = 1;
  list.frame("reserved words of the poses", record_frame(FrameType::kSetPoses, poses, sizeof(wire::PoseRecord)),
             ErrorCode::kBadFrame, "poses: reserved words must be 0");

  wire::AttachRecord attach;
  attach.child = 1;
  attach.parent = 2;
  list.frame("attachment too long", record_frame(FrameType::kAttach, attach, 8), ErrorCode::kBadFrame,
             "attach: its contents need a payload of 72 bytes, got 80");
  attach.has_pose = 1;
  list.frame("attachment with no rotation", record_frame(FrameType::kAttach, attach), ErrorCode::kBadQuery,
             "attach: the pose of 'cup' is not usable");
  attach.has_pose = 2;
  list.frame("has_pose", record_frame(FrameType::kAttach, attach), ErrorCode::kBadFrame,
             "attach: has_pose 2 is neither 0 nor 1");
  attach.has_pose = 0;
  attach.child = 9;
  list.frame("unknown child", record_frame(FrameType::kAttach, attach), ErrorCode::kBadQuery,
             "attach: unknown child, body 9");
  attach.child = 1;
  attach.parent = 9;
  list.frame("unknown parent", record_frame(FrameType::kAttach, attach), ErrorCode::kBadQuery,
             "attach: unknown parent, body 9");
  attach.parent = 1;
  list.frame("a body that follows itself", record_frame(FrameType::kAttach, attach), ErrorCode::kBadQuery,
             "attach: 'cup' would follow itself through 'cup'");
  attach.child = 0;
  list.frame("static child", record_frame(FrameType::kAttach, attach), ErrorCode::kBadQuery,
             "attach: 'table' is static");
  attach.child = 1;
  attach.parent = 3;
  list.frame("parent without a pose", record_frame(FrameType::kAttach, attach), ErrorCode::kBadQuery,
             "attach: 'link2' has no usable pose");
}

}  // namespace

std::vector<BadRequest> bad_requests(std::uint64_t scene_revision) {
  List list;
  add_frames(list);
  add_query_sizes(list);
  add_query_values(list, scene_revision);
  add_moves(list, scene_revision);
  return std::move(list.requests);
}

std::vector<std::byte> good_query(std::uint64_t request_id) {
  return pairs_query({{0, 1}}).frame(request_id);
}

}  // namespace clearance
