// Members of the wire's structs by name, for Python's dtypes. A struct of protocol.h or payloads.h with an unlisted member does not
// compile.
#pragma once

#include <cstddef>
#include <string>
#include <type_traits>

#include "wire/payloads.h"

namespace clearance::wire {

/// numpy's format of a type, such as "<u4", "(7,)<f8" or "S16".
template <class T>
std::string numpy_format() {
  if constexpr (std::is_array_v<T>) {
    using Item = std::remove_extent_t<T>;
    const std::string count = std::to_string(std::extent_v<T>);
    return std::is_same_v<Item, char> ? "S" + count : "(" + count + ",)" + numpy_format<Item>();
  } else {
    static_assert(std::is_arithmetic_v<T>);
    return (std::is_floating_point_v<T> ? "<f" : std::is_signed_v<T> ? "<i" : "<u") + std::to_string(sizeof(T));
  }
}

// CLEARANCE_EACH(f, r, a, b, ...): f(r, a) f(r, b) ..., for at most 64 members.
#define CLEARANCE_PARENTHESES ()
#define CLEARANCE_EXPAND(...) CLEARANCE_EXPAND2(CLEARANCE_EXPAND2(CLEARANCE_EXPAND2(CLEARANCE_EXPAND2(__VA_ARGS__))))
#define CLEARANCE_EXPAND2(...) CLEARANCE_EXPAND1(CLEARANCE_EXPAND1(CLEARANCE_EXPAND1(CLEARANCE_EXPAND1(__VA_ARGS__))))
#define CLEARANCE_EXPAND1(...) CLEARANCE_EXPAND0(CLEARANCE_EXPAND0(CLEARANCE_EXPAND0(CLEARANCE_EXPAND0(__VA_ARGS__))))
#define CLEARANCE_EXPAND0(...) __VA_ARGS__
#define CLEARANCE_EACH(f, r, ...) __VA_OPT__(CLEARANCE_EXPAND(CLEARANCE_EACH_NEXT(f, r, __VA_ARGS__)))
#define CLEARANCE_EACH_NEXT(f, r, a, ...) \
  f(r, a) __VA_OPT__(CLEARANCE_EACH_AGAIN CLEARANCE_PARENTHESES(f, r, __VA_ARGS__))
#define CLEARANCE_EACH_AGAIN() CLEARANCE_EACH_NEXT

/// For each struct, calls begin(name), then member(name, numpy format) for each member in order.
template <class Begin, class Member>
void for_each_struct(Begin begin, Member member) {
#define CLEARANCE_SIZE(type, name) +sizeof(type::name)
#define CLEARANCE_MEMBER(type, name) member(#name, numpy_format<decltype(type::name)>());
#define CLEARANCE_STRUCT(type, ...)                                                                        \
  static_assert(CLEARANCE_EACH(CLEARANCE_SIZE, type, __VA_ARGS__) == sizeof(type), "every byte is named"); \
  begin(#type);                                                                                            \
  CLEARANCE_EACH(CLEARANCE_MEMBER, type, __VA_ARGS__)

  CLEARANCE_STRUCT(FrameHeader, magic, version, type, request_id, payload_bytes, scene_revision, client_id,
                   records_bytes, flags, reserved)
  CLEARANCE_STRUCT(RecordHeader, tag, flags, bytes)
  CLEARANCE_STRUCT(QueryHeader, max_distance, abs_tol, rel_tol, pair_count, body_count, configuration_count, fields,
                   max_results, max_pose_age_ns, all_pairs, precision, signed_distance, reduce, padding,
                   min_pose_stamp_ns, deadline_ns, wait_for, padding2, reserved)
  CLEARANCE_STRUCT(ReplyHeader, rows, total, configurations, pairs, fields, reduce, padding, scene_revision,
                   snapshot_revision, snapshot_stamp_ns, oldest_receipt_ns, pairs_evaluated, engine_ns, server_ns,
                   backend, snapshot_sequence, pose_age_ns)
  CLEARANCE_STRUCT(PosesHeader, count, stamp_ns, sequence, reserved)
  CLEARANCE_STRUCT(PointsHeader, count, stamp_ns, sequence, radius, body, has_radius, padding, reserved)
  CLEARANCE_STRUCT(PoseRecord, body, padding, pose)
  CLEARANCE_STRUCT(JointRecord, joint, padding, position)
  CLEARANCE_STRUCT(AttachRecord, child, parent, has_pose, padding, pose)
  CLEARANCE_STRUCT(AllowRecord, a, b, allow, padding)
  CLEARANCE_STRUCT(PosesResult, revision, scene_revision, applied, bad, unknown, fixed)
  CLEARANCE_STRUCT(SceneHeader, scene_revision, body_count, group_count, member_count, padding, pair_count, backend,
                   reserved)
  CLEARANCE_STRUCT(BodyRecord, name, parent, is_static, is_solid, is_cloud, padding, piece_count, padding2,
                   vertex_count, model_error, extent, hull_excess, empty_share, triangle_count)
  CLEARANCE_STRUCT(GroupRecord, name, first_member, member_count, reserved)
  CLEARANCE_STRUCT(PairsHeader, scene_revision, count)
  CLEARANCE_STRUCT(StatesHeader, count, revision, now_ns, reserved)
  CLEARANCE_STRUCT(BodyStateRecord, pose, stamp_ns, receipt_ns, parent, status, padding, reserved)
  CLEARANCE_STRUCT(JointsHeader, scene_revision, revision, now_ns, joint_count, group_count, member_count, padding,
                   reserved)
  CLEARANCE_STRUCT(JointStateRecord, name, lower, upper, position, stamp_ns, receipt_ns, status, beyond_limits, padding,
                   reserved)
  CLEARANCE_STRUCT(PlanHeader, plan, memory_bytes, memory_handle, device_uuid, poses_offset, positions_offset, rows,
                   configurations, pairs, body_count, joint_count, fields, column_count, scene_revision,
                   snapshot_revision, reserved)
  CLEARANCE_STRUCT(PlanColumnRecord, field, row_bytes, offset)
  CLEARANCE_STRUCT(PlanRecord, plan, reserved)
  CLEARANCE_STRUCT(PlanResult, plan, snapshot_revision, took_ns, reserved)
  CLEARANCE_STRUCT(NewBodyRecord, name, parent, shape, is_static, has_pose, padding, size, radius, pose, vertex_count,
                   reserved)
  CLEARANCE_STRUCT(BodyUncertaintyRecord, uncertainty_position, uncertainty_angle, padding, max_speed)
  CLEARANCE_STRUCT(VertexRecord, xyz)
  CLEARANCE_STRUCT(TriangleRecord, vertices)
  CLEARANCE_STRUCT(RemoveBodyRecord, name)
  CLEARANCE_STRUCT(SceneChange, scene_revision, body_count, body, seconds, reserved)
  CLEARANCE_STRUCT(CounterRecord, name, value)
  CLEARANCE_STRUCT(ErrorHeader, code, padding, text_bytes, needed_bytes)

#undef CLEARANCE_STRUCT
#undef CLEARANCE_MEMBER
#undef CLEARANCE_SIZE
}

}  // namespace clearance::wire
